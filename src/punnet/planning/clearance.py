"""From which side to come in: the approach that keeps clear of the other berries and their stems.

Seen from above, stems are points (they hang nearly plumb) and the picker is a strip along its approach. An obstacle
counts only if it is as high as the strip. This looks at what the camera found; it knows nothing of what it did not see.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.planning.approach import approach_rotation, comfortable_angles
from punnet.scene import Frame, Strawberries

__all__ = ["Obstacles", "approach_directions", "clearance", "gaps", "obstacles_among"]

TOOL_LENGTH = 0.19
"""Metres of picker behind the grip point that pass through the plant."""
TOOL_BELOW, TOOL_ABOVE = 0.014, 0.045
"""Extent of the picker below and above the grip point, metres."""
STEM_LENGTH = 0.12
"""Metres of stem above a berry that are taken to hang plumb."""
AMPLE = 0.035
"""Metres of clearance beyond which more is no better: the half-width of the picker and a margin."""

_YAW_OFFSETS = np.deg2rad((0.0, -12.0, 12.0, -24.0, 24.0, -36.0, 36.0))
_PER_RADIAN = 0.012  # metres of clearance that a radian of turning must be worth


@dataclass(frozen=True, eq=False)
class Obstacles:
    """The other berries: ``picking_points`` (N, 3) on their stems, ``radii`` (N,) and ``lengths`` (N,), metres, base frame."""

    picking_points: NDArray[np.float64]
    radii: NDArray[np.float64]
    lengths: NDArray[np.float64]

    def __post_init__(self) -> None:
        n = len(self.picking_points)
        if self.picking_points.shape != (n, 3) or self.radii.shape != (n,) or self.lengths.shape != (n,):
            raise ShapeError(
                f"obstacles: need (N, 3), (N,) and (N,), got {self.picking_points.shape}, {self.radii.shape}, "
                f"{self.lengths.shape}"
            )


def obstacles_among(frame: Frame, berries: Strawberries, row: int) -> Obstacles:
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


def clearance(
    point: NDArray[np.float64], obstacles: Obstacles, yaws: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Least sideways distance (Y,) in metres between the picker's middle and an obstacle, for approaches at ``yaws`` (Y,).

    ``point`` (3,) is where to grip. Infinity where nothing is in the way; a fruit's distance is that of its surface.
    """
    return np.asarray(gaps(point, obstacles, yaws).min(axis=1, initial=np.inf))


def gaps(point: NDArray[np.float64], obstacles: Obstacles, yaws: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same distance to each obstacle (Y, N)."""
    offset = obstacles.picking_points - point
    calyx = offset[:, 2] - 0.015  # picking points lie about this far above the calyx
    stem = (calyx < TOOL_ABOVE) & (calyx + STEM_LENGTH > -TOOL_BELOW)
    fruit = (calyx > -TOOL_BELOW) & (calyx - obstacles.lengths < TOOL_ABOVE)
    forward = np.stack((np.cos(yaws), np.sin(yaws)), axis=1)
    along = forward @ offset[:, :2].T
    aside = np.abs(forward[:, :1] * offset[:, 1] - forward[:, 1:] * offset[:, 0])
    widths = np.where(fruit, obstacles.radii, 0.0)
    in_way = (stem | fruit) & (along > -TOOL_LENGTH - widths) & (along < 0.02 + widths)
    return np.asarray(np.where(in_way, aside - widths, np.inf), dtype=np.float64)


def approach_directions(
    point: NDArray[np.float64], obstacles: Obstacles
) -> tuple[NDArray[np.float64], float]:
    """Unit directions (Y, 3) in the base frame to come in along, the best first, and the best one's clearance in metres.

    Best is the widest clearance, up to :data:`AMPLE`; of equals the one nearest to the comfortable yaw.
    """
    yaw, pitch = comfortable_angles(point)
    yaws = float(yaw) + _YAW_OFFSETS
    room = clearance(point, obstacles, yaws)
    value = np.minimum(room, AMPLE) - _PER_RADIAN * np.abs(_YAW_OFFSETS)
    order = np.argsort(-value, kind="stable")
    directions = approach_rotation(yaws[order], np.full(len(yaws), float(pitch)))[:, :, 2]
    return directions, float(room[order[0]])
