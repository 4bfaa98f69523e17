"""Between pixels and points. Camera frame is optical: x right, y down, z forward, metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.geometry.camera import CameraIntrinsics

__all__ = ["back_project", "cloud_from_depth", "project"]


def project(camera: CameraIntrinsics, points: ArrayLike) -> NDArray[np.float64]:
    """Camera-frame points (..., 3) in metres to pixels (..., 2) as (u right, v down).

    Points on or behind the image plane (z ≤ 0) become NaN.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.shape[-1:] != (3,):
        raise ShapeError(f"project: need (..., 3), got {points.shape}")
    z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    return np.stack(
        (camera.fx * points[..., 0] / z + camera.cx, camera.fy * points[..., 1] / z + camera.cy), axis=-1
    )


def back_project(camera: CameraIntrinsics, pixels: ArrayLike, depth: ArrayLike) -> NDArray[np.float64]:
    """Pixels (..., 2) and their depths (...) in metres to camera-frame points (..., 3)."""
    pixels = np.asarray(pixels, dtype=np.float64)
    z = np.asarray(depth, dtype=np.float64)
    if pixels.shape[-1:] != (2,):
        raise ShapeError(f"back_project: need pixels (..., 2), got {pixels.shape}")
    return np.stack(
        ((pixels[..., 0] - camera.cx) / camera.fx * z, (pixels[..., 1] - camera.cy) / camera.fy * z, z),
        axis=-1,
    )


def cloud_from_depth(
    camera: CameraIntrinsics, depth: NDArray[np.float32], mask: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Camera-frame cloud (P, 3) of the pixels with a reading (depth > 0), within ``mask`` (H, W) if given."""
    if depth.shape != (camera.height, camera.width):
        raise ShapeError(
            f"cloud_from_depth: depth is {depth.shape}, camera says {(camera.height, camera.width)}"
        )
    valid = depth > 0 if mask is None else (depth > 0) & mask
    v, u = np.nonzero(valid)
    return back_project(camera, np.stack((u, v), axis=-1), depth[v, u])
