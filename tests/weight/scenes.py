"""Exact pictures of an ellipsoid before a wall, by intersecting each ray: a truth to weigh against."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, back_project
from punnet.scene import Frame, Strawberries

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
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = back_project(camera, np.stack((u, v), axis=-1), np.ones(u.shape))
    scaled, origin = rays / half_axes, np.asarray(centre) / half_axes
    a, b = (scaled**2).sum(axis=-1), scaled @ origin
    discriminant = b * b - a * (origin @ origin - 1.0)
    mask = discriminant > 0
    depth = np.where(mask, (b - np.sqrt(np.maximum(discriminant, 0.0))) / a, wall).astype(np.float32)
    rgb = np.where(mask[..., None], (180, 30, 30), (60, 120, 60)).astype(np.uint8)
    return Frame(rgb, depth, camera), np.asarray(mask)


def one_berry(mask: NDArray[np.bool_]) -> Strawberries:
    rows, columns = np.nonzero(mask)
    box = (columns.min(), rows.min(), columns.max(), rows.max()) if len(rows) else (0, 0, 0, 0)
    return Strawberries(mask.shape, np.array([box], dtype=float), masks=mask[None])
