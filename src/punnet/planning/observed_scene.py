"""What the camera saw around a target, as a planner avoids it: fruit, stems, and the rest of what has depth.

Every other berry is an upright capsule. A stem is too thin for the depth camera, but it hangs above its calyx: each berry
has one, plumb for the length that matters: a thin capsule, and a wider one above it, since higher up it leans. What is
left of the depth picture is kept in a grid of occupied cells: green things (leaves, stalks) give way and are soft,
everything else (gutter, pipes, posts, the table) is hard.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics
from punnet.planning.capsules import Capsules
from punnet.scene import Frame, Strawberries, Target

__all__ = ["STEM_LENGTH", "ObservedScene", "observe"]

STEM_LENGTH = 0.14
"""Metres of stem above a calyx that are taken to hang plumb, the upper ones only nearly."""
STEM_RADIUS = 0.0015
LEANING, LEANING_RADIUS = 0.05, 0.006
"""Metres above a calyx from which a stem leans to its truss, and how far to some side it may be there."""

_CALYX_BELOW = 0.015  # metres of the picking point above the calyx
_USUAL_RADIUS, _USUAL_LENGTH = 0.014, 0.036  # of a berry whose outline is not known
_LEAST_PIXELS = 25
_CARE_RIPE = 0.6
_FURTHEST = 0.30  # metres from the target within which anything counts
_CELL = 0.01
_STRIDE = 5
_GREENNESS = 0.06  # (2g − r − b) / (r + g + b) from which a thing is a plant's
_OWN_STEM = 0.03  # metres about the target's own stem in which nothing counts
_NEIGHBOURS = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class ObservedScene:
    """What to keep clear of, relative to ``origin`` (3,), the target's picking point, along the base's axes.

    Parameters
    ----------
    fruit, stems
        Of the other berries, N and 2 N capsules.
    care
        (N,) how much each fruit is to be kept clear of: what stays on the plant more than what is picked next.
    soft, hard
        (S, 3) and (H, 3) points of the depth picture.
    """

    origin: NDArray[np.float64]
    fruit: Capsules
    stems: Capsules
    care: NDArray[np.float64]
    soft: NDArray[np.float64]
    hard: NDArray[np.float64]

    @cached_property
    def _cells(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        return _occupied(self.soft), _occupied(self.hard)

    def soft_at(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 3), relative to the origin, lie within about a centimetre of a soft thing."""
        return _look_up(self._cells[0], points)

    def hard_at(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """The same of a hard thing, or below the table."""
        return np.asarray(_look_up(self._cells[1], points) | (points[..., 2] + self.origin[2] < 0.0))


def observe(frame: Frame, target: Target) -> ObservedScene:
    """What ``frame`` shows around ``target``, which must have a picking point; nothing where it lacks depth or a pose."""
    assert target.picking_point is not None
    origin = target.picking_point
    berries = target.among
    fruit, stems, care = _others(frame, berries, target)
    soft = hard = np.zeros((0, 3))
    if frame.depth is not None and frame.camera is not None and frame.T_base_camera is not None:
        points, green = _surroundings(frame, frame.camera, frame.T_base_camera, berries, origin)
        soft, hard = points[green], points[~green]
    return ObservedScene(origin, fruit, stems, care, soft, hard)


def _others(
    frame: Frame, berries: Strawberries | None, target: Target
) -> tuple[Capsules, Capsules, NDArray[np.float64]]:
    """Fruit, stems and care of the berries around the target."""
    nothing = Capsules(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    if berries is None or target.picking_point is None:
        return nothing, nothing, np.zeros(0)
    tops, lengths, radii, care = [], [], [], []
    for row in np.flatnonzero(berries.ids != target.berry_id):
        found = _measured(frame, berries, int(row))
        if found is None or np.linalg.norm(found[0] - target.picking_point) > _FURTHEST:
            continue
        tops.append(found[0] - target.picking_point)
        lengths.append(found[1])
        radii.append(found[2])
        care.append(_CARE_RIPE if berries.pluckable[row] else 1.0)
    if not tops:
        return nothing, nothing, np.zeros(0)
    top, length, radius = np.array(tops), np.array(lengths), np.array(radii)
    up = np.array([0.0, 0.0, 1.0])
    inset = np.minimum(radius, length / 2.0)[:, None] * up
    fruit = Capsules(top - inset, top - length[:, None] * up + inset, radius)
    leaning = top + LEANING * up
    stems = Capsules(
        np.concatenate((top, leaning)),
        np.concatenate((leaning, top + STEM_LENGTH * up)),
        np.repeat((STEM_RADIUS, LEANING_RADIUS), len(top)),
    )
    return fruit, stems, np.array(care)


def _measured(
    frame: Frame, berries: Strawberries, row: int
) -> tuple[NDArray[np.float64], float, float] | None:
    """Calyx (3,) in the base frame, length and radius of a berry in metres; None if it can't be placed in space."""
    point = berries.picking_points[row]
    known = bool(np.isfinite(point).all())
    outline = None if berries.masks is None else _outline(frame, berries.masks[row])
    if outline is not None:
        top, length, radius = outline
        # A picking point says best where the stem is; an outline that something hides says too little of the fruit.
        calyx = point - (0.0, 0.0, _CALYX_BELOW) if known else top
        return np.asarray(calyx), max(length, 1.5 * radius), radius
    if known:
        return np.asarray(point - (0.0, 0.0, _CALYX_BELOW)), _USUAL_LENGTH, _USUAL_RADIUS
    return None


def _outline(frame: Frame, mask: NDArray[np.bool_]) -> tuple[NDArray[np.float64], float, float] | None:
    """Top (3,), length and radius of the fruit that a mask (H, W) shows, by its depth."""
    if frame.depth is None or frame.camera is None or frame.T_base_camera is None:
        return None
    v, u = np.nonzero(mask)
    depth = frame.depth[v, u]
    read = depth > 0
    if read.sum() < _LEAST_PIXELS:
        return None
    camera, surface = frame.camera, float(np.median(depth[read]))
    left, right, top, bottom = float(u.min()), float(u.max()) + 1.0, float(v.min()), float(v.max()) + 1.0
    radius = (right - left) / 2.0 / camera.fx * surface
    distance = surface + 0.6 * radius  # from the middle of what is seen of a ball to its centre
    scale = distance / surface
    radius, height = radius * scale, (bottom - top) / camera.fy * distance
    middle = ((left + right - 1.0) / 2.0, (top + bottom - 1.0) / 2.0)
    ray = np.array([(middle[0] - camera.cx) / camera.fx, (middle[1] - camera.cy) / camera.fy, 1.0])
    centre = frame.T_base_camera[:3, :3] @ (distance * ray) + frame.T_base_camera[:3, 3]
    return centre + np.array([0.0, 0.0, height / 2.0]), height, radius


def _surroundings(
    frame: Frame,
    camera: CameraIntrinsics,
    T_base_camera: NDArray[np.float64],
    berries: Strawberries | None,
    origin: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points (N, 3), relative to ``origin``, of what is no berry, and whether each is green."""
    assert frame.depth is not None
    v, u = np.mgrid[_STRIDE // 2 : frame.height : _STRIDE, _STRIDE // 2 : frame.width : _STRIDE]
    depth = frame.depth[v, u].astype(np.float64)
    counts = depth > 0
    if berries is not None and berries.masks is not None and len(berries):
        # Depth bleeds over the edge of what is near: a berry's rim is not the leaf behind it.
        fruit = cv2.dilate(np.asarray(berries.masks.any(axis=0), dtype=np.uint8), np.ones((13, 13), np.uint8))
        counts &= fruit[v, u] == 0
    u, v, depth = u[counts], v[counts], depth[counts]
    local = np.stack(
        ((u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth), axis=1
    )
    points = local @ T_base_camera[:3, :3].T + T_base_camera[:3, 3] - origin
    aside = np.hypot(points[:, 0], points[:, 1])
    near = (np.abs(points).max(axis=1) < _FURTHEST) & ~((aside < _OWN_STEM) & (points[:, 2] > -_OWN_STEM))
    r, g, b = frame.rgb[v[near], u[near]].astype(np.float64).T
    return points[near], (2.0 * g - r - b) > _GREENNESS * np.maximum(r + g + b, 1.0)


def _occupied(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Cells (C, C, C) about the origin that hold a point or lie beside one that does."""
    half = round(_FURTHEST / _CELL) + 1
    cells = np.zeros((2 * half + 1,) * 3, dtype=np.bool_)
    index = np.rint(points / _CELL).astype(np.int64) + half
    around = np.clip((index[:, None] + _NEIGHBOURS).reshape(-1, 3), 0, 2 * half)
    cells[around[:, 0], around[:, 1], around[:, 2]] = True
    return cells


def _look_up(cells: NDArray[np.bool_], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    half = len(cells) // 2
    index = np.rint(points / _CELL).astype(np.int64) + half
    inside = ((index >= 0) & (index <= 2 * half)).all(axis=-1)
    index = np.clip(index, 0, 2 * half)
    return np.asarray(cells[index[..., 0], index[..., 1], index[..., 2]] & inside)
