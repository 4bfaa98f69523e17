"""Exact pictures of an ellipsoid before a wall, by intersecting each ray: a truth to weigh against."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, back_project, project
from punnet.scene import Frame, Strawberries, Visibility

D435I = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
DENSITY = 0.92


def ellipsoid_grams(half_axes: tuple[float, float, float], density: float = DENSITY) -> float:
    return 4.0 / 3.0 * math.pi * math.prod(half_axes) * 1e6 * density


def ellipsoid_scene(
    centre: tuple[float, float, float],
    half_axes: tuple[float, float, float],
    *,
    camera: CameraIntrinsics = D435I,
    wall: float = 0.8,
) -> tuple[Frame, NDArray[np.bool_]]:
    """Frame with exact depth, and the mask, of an upright ellipsoid (camera axes) before a wall."""
    depth = np.full((camera.height, camera.width), wall, dtype=np.float32)
    mask = np.zeros((camera.height, camera.width), dtype=bool)
    # Rays are cast where the ellipsoid can be, not all over the picture.
    reach, nearest = max(half_axes), max(centre[2] - max(half_axes), 0.01)
    corners = np.add(centre, [[-reach, -reach, 0], [reach, reach, 0]])
    low, high = project(camera, corners)
    grow = (high - low) * (centre[2] / nearest - 1.0 + 0.2) + 2.0
    u0, v0 = np.clip(low - grow, 0, (camera.width, camera.height)).astype(int)
    u1, v1 = np.clip(high + grow, 0, (camera.width, camera.height)).astype(int)
    v, u = np.mgrid[v0:v1, u0:u1]
    rays = back_project(camera, np.stack((u, v), axis=-1), np.ones(u.shape))
    scaled, origin = rays / half_axes, np.asarray(centre) / half_axes
    a, b = (scaled**2).sum(axis=-1), scaled @ origin
    discriminant = b * b - a * (origin @ origin - 1.0)
    hit = discriminant > 0
    mask[v0:v1, u0:u1] = hit
    depth[v0:v1, u0:u1][hit] = ((b - np.sqrt(np.maximum(discriminant, 0.0))) / a)[hit]
    rgb = np.where(mask[..., None], (180, 30, 30), (60, 120, 60)).astype(np.uint8)
    return Frame(rgb, depth, camera), mask


def one_berry(mask: NDArray[np.bool_]) -> Strawberries:
    rows, columns = np.nonzero(mask)
    box = (columns.min(), rows.min(), columns.max(), rows.max()) if len(rows) else (0, 0, 0, 0)
    return Strawberries(mask.shape, np.array([box], dtype=float), masks=mask[None])


def with_keypoints(
    frame: Frame,
    berries: Strawberries,
    centre: tuple[float, float, float],
    half_axes: tuple[float, float, float],
) -> Strawberries:
    """The one berry with its five key-points, all visible, as annotations have them: grasps 8% inside the outline."""
    assert frame.camera is not None
    a, b, _ = half_axes
    offsets = np.array([(0, -b - 0.02, 0), (0, -b, 0), (0, b, 0), (-0.92 * a, 0, 0), (0.92 * a, 0, 0)])
    points = project(frame.camera, np.asarray(centre) + offsets)
    seen = np.full((1, 5), int(Visibility.VISIBLE))
    return berries.with_fields(keypoints=points[None], visibility=seen)
