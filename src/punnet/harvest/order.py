"""Which berry next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.scene import Strawberries

__all__ = ["picking_order"]

_ROW_DEPTH = 0.03
"""Berries whose distance from the robot differs by less than this (metres) count as hanging equally far in front."""


def picking_order(berries: Strawberries) -> NDArray[np.int64]:
    """Rows of the pluckable berries with a known picking point: those in front first, of these the lowest first.

    What hangs in front is in the way of what hangs behind; and the tool, which comes in above a berry, should not
    pass through one that hangs lower.
    """
    points = berries.picking_points
    candidates = np.flatnonzero(berries.pluckable & np.isfinite(points).all(axis=1))
    front = np.floor(points[candidates, 0] / _ROW_DEPTH)
    return np.asarray(candidates[np.lexsort((points[candidates, 2], front))], dtype=np.int64)
