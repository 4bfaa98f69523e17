"""Which berry next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.planning.clearance import approach_directions, obstacles_among
from punnet.scene import Frame, Strawberries

__all__ = ["picking_order"]

_ROW_DEPTH = 0.03
"""Berries whose distance from the robot differs by less than this (metres) count as hanging equally far in front."""
_FREE = 0.022
"""Metres of clearance with which the picker passes without touching."""


def picking_order(frame: Frame, berries: Strawberries) -> NDArray[np.int64]:
    """Rows of the pluckable berries with a known picking point, in the order to pick them.

    Those that the picker can come at without touching another come first: what is picked may free the rest. Among
    equals, those in front before those behind, and the lowest first, since the tool comes in above a berry.
    """
    points = berries.picking_points
    candidates = np.flatnonzero(berries.pluckable & np.isfinite(points).all(axis=1))
    blocked = [
        approach_directions(points[row], obstacles_among(frame, berries, int(row)))[1] < _FREE
        for row in candidates
    ]
    front = np.floor(points[candidates, 0] / _ROW_DEPTH)
    order = np.lexsort((points[candidates, 2], front, np.array(blocked, dtype=np.bool_)))
    return np.asarray(candidates[order], dtype=np.int64)
