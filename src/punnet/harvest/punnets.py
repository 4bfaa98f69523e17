"""Where in a punnet the next berry is laid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["slot_offset"]

_SLOTS = (2, 3)
_SLOT_PITCH = (0.046, 0.048)


def slot_offset(count: int) -> NDArray[np.float64]:
    """Where in a punnet the berry number ``count`` goes: (2,) metres from its middle, row by row, then again on top."""
    column, row = count % _SLOTS[0], (count // _SLOTS[0]) % _SLOTS[1]
    return np.array(
        [(column - (_SLOTS[0] - 1) / 2) * _SLOT_PITCH[0], ((_SLOTS[1] - 1) / 2 - row) * _SLOT_PITCH[1]]
    )
