"""Which berry next, and what is in the way of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.planning.clearance import Obstacles, approach_directions
from punnet.scene import Frame, Strawberries

__all__ = ["obstacles", "picking_order"]

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
        approach_directions(points[row], obstacles(frame, berries, int(row)))[1] < _FREE for row in candidates
    ]
    front = np.floor(points[candidates, 0] / _ROW_DEPTH)
    order = np.lexsort((points[candidates, 2], front, np.array(blocked, dtype=np.bool_)))
    return np.asarray(candidates[order], dtype=np.int64)


def obstacles(frame: Frame, berries: Strawberries, row: int) -> Obstacles:
    """All located berries but ``row``, with sizes from their boxes at their distance from the camera."""
    points = berries.picking_points
    located = np.isfinite(points).all(axis=1)
    others = located & (np.arange(len(points)) != row)
    sizes = np.zeros((int(others.sum()), 2))
    if frame.camera is not None and frame.T_base_camera is not None:
        distance = np.linalg.norm(points[others] - frame.T_base_camera[:3, 3], axis=1)
        boxes = berries.boxes[others]
        sizes = (boxes[:, 2:] - boxes[:, :2]) / (frame.camera.fx, frame.camera.fy) * distance[:, None]
    return Obstacles(points[others], sizes[:, 0] / 2.0, sizes[:, 1])
