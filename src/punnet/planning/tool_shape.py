"""The picker and the arm behind it as capsules, for asking how near they come to things.

Sizes are the picker's of :mod:`punnet.sim.picker`, the thesis' UPH: two grasping fingers, two separation fingers above
them, the housing, the camera. All in the flange frame (x up, y right, z forward at home).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.planning.capsules import Capsules
from punnet.robot import COMING_IN, GRIP_OPENING, T_FLANGE_TOOL

__all__ = ["ARM", "CARRIED", "OPENING", "SLOT", "SOLID", "Placed", "placed"]

_REACH = float(T_FLANGE_TOOL[2, 3])
_TIP = _REACH + 0.004
_GAP = COMING_IN * GRIP_OPENING  # half of it, between the fingers as they come in
_FINGER = _GAP + 0.0055  # y of their middles
_HINGE = np.array([0.028, 0.018, 0.095])  # of a separation finger, of which the paddle is 0.1 long
_OPEN = 0.36  # radians


def _capsules(*parts: tuple[tuple[float, float, float], tuple[float, float, float], float]) -> Capsules:
    starts, ends, radii = zip(*parts, strict=True)
    return Capsules(np.array(starts), np.array(ends), np.array(radii))


def _paddle(
    side: float, angle: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    x, y, z = (float(value) for value in _HINGE)
    tip = (x, side * (y + 0.1 * float(np.sin(angle))), z + 0.1 * float(np.cos(angle)))
    return (x, side * y, z), tip, 0.008


SOLID = _capsules(
    ((-0.003, -_FINGER, 0.09), (-0.003, -_FINGER, _TIP), 0.006),
    ((-0.003, _FINGER, 0.09), (-0.003, _FINGER, _TIP), 0.006),
    _paddle(-1.0, 0.0),
    _paddle(1.0, 0.0),
    ((0.0, 0.0, 0.03), (0.0, 0.0, 0.075), 0.034),
    ((0.080, -0.035, 0.031), (0.080, 0.035, 0.031), 0.014),
)
"""What the picker is made of as it comes in: fingers, closed paddles, housing, camera."""

SLOT = _capsules(((0.0, 0.0, 0.10), (0.0, 0.0, _REACH - 0.004), _FINGER))
"""The gap between the grasping fingers, up to their middles: a stem in it is gripped, or dragged along when the tool leaves."""

OPENING = _capsules(*(_paddle(side, share * _OPEN) for side in (-1.0, 1.0) for share in (0.5, 1.0)))
"""Where the paddles go when they open at the stem; they fold again before the tool leaves."""

CARRIED = _capsules(((-0.028, 0.0, _REACH), (-0.046, 0.0, _REACH), 0.014))
"""The fruit that hangs in the grip when the tool leaves."""

ARM = _capsules(
    ((0.0, 0.0, 0.0), (0.0, 0.0, -0.107), 0.055),
    ((-0.088, 0.0, -0.107), (0.0, 0.0, -0.107), 0.060),
)
"""The wrist behind the flange."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Capsules in the base frame: ``starts`` and ``ends`` (..., B, 3), ``radii`` (B,)."""

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    radii: NDArray[np.float64]

    def points(self, count: int) -> NDArray[np.float64]:
        """``count`` points (..., B, count, 3) spread evenly over each segment."""
        share = np.linspace(0.0, 1.0, count)[:, None]
        return np.asarray(self.starts[..., None, :] + share * (self.ends - self.starts)[..., None, :])


def placed(capsules: Capsules, T_base_flange: NDArray[np.float64]) -> Placed:
    """Capsules of the flange frame at flange poses (..., 4, 4)."""
    R, p = T_base_flange[..., :3, :3], T_base_flange[..., None, :3, 3]
    turned = np.swapaxes(R, -1, -2)
    return Placed(capsules.starts @ turned + p, capsules.ends @ turned + p, capsules.radii)
