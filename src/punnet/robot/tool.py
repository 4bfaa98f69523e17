"""Where the picker's parts sit on the flange.

The tool frame has the flange's axes: at the home pose x points up, y to the right and z forward, the way the tool
comes in. Its origin is the point between the grasping pads where the stem is held. The camera sits on top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import make_transform

__all__ = ["BLADE_ABOVE_GRIP", "COMING_IN", "GRIP_OPENING", "T_FLANGE_CAMERA", "T_FLANGE_TOOL"]

T_FLANGE_TOOL: NDArray[np.float64] = make_transform(np.eye(3), (0.0, 0.0, 0.19))
"""Tool (grip point) in the flange frame: 190 mm ahead of the flange."""

T_FLANGE_CAMERA: NDArray[np.float64] = make_transform(
    ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), (0.080, 0.0, 0.045)
)
"""Optical camera frame (x right, y down, z forward) in the flange frame: on top of the picker, looking along z."""

BLADE_ABOVE_GRIP = 0.006
"""The blade runs this far (metres) above the pads, so that the cut berry hangs in the grip by its stem."""

GRIP_OPENING = 0.017
"""Half of the gap between the pads when they are fully open, metres."""

COMING_IN = 0.4
"""Share of :data:`GRIP_OPENING` with which the tool goes into the plant: as much as a stem that was seen is located by.

Whatever stem is between the fingers when they close is gripped or can't get out: it is dragged along as the tool leaves."""
