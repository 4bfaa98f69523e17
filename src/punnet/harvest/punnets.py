"""Where in a punnet the next berry is laid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["slot_offset"]

_SLOTS = np.array([(-1, 1), (1, -1), (1, 1), (-1, -1), (-1, 0), (1, 0)])
_FROM_MIDDLE = np.array((0.023, 0.048))


def slot_offset(count: int) -> NDArray[np.float64]:
    """Where in a punnet the berry number ``count`` goes: (2,) metres from its middle, then again on top.

    First from corner to far corner: what is let go on top of another berry presses it against the floor.
    """
    return np.asarray(_SLOTS[count % len(_SLOTS)] * _FROM_MIDDLE)
