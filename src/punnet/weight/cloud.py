"""The points of one berry: taken from its mask and the depth picture, freed of what is not the berry."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, cloud_from_depth

__all__ = ["berry_cloud", "depth_layer", "relief_height"]

LAYER_GAP = 0.012
"""Metres without a reading that part one thing from what is behind it (a berry's own points lie closer)."""

_EDGE_PIXELS = 2
_FEWEST_INSIDE = 40
_LEAST_RELIEF_POINTS = 60


def depth_layer(depths: NDArray[np.floating]) -> tuple[float, float]:
    """Nearest and farthest depth of the layer that holds most of ``depths`` (P,) metres.

    Layers are parted by at least :data:`LAYER_GAP` without a reading: a mask that leaks on to the background,
    or has a leaf in front of it, has two. Of equal layers the nearer is taken. NaN, NaN without depths.
    """
    ordered = np.sort(np.asarray(depths, dtype=np.float64).ravel())
    if not ordered.size:
        return float("nan"), float("nan")
    # Stray readings between two layers must not bridge them: only each hundredth reading is looked at.
    stride = max(1, ordered.size // 100)
    coarse = ordered[stride // 2 :: stride]
    parts = np.split(coarse, np.flatnonzero(np.diff(coarse) > LAYER_GAP) + 1)
    largest = max(parts, key=len)
    return float(largest[0]), float(largest[-1])


def berry_cloud(
    camera: CameraIntrinsics, depth: NDArray[np.float32], mask: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Camera-frame points (P, 3) of the berry under ``mask`` (H, W), without its edge and without outliers.

    Two pixels of the outline are left out, where stereo mixes the berry with what is behind it; then only the
    layer of depth that holds most points is kept. May be empty.
    """
    inside = mask
    eroded = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=_EDGE_PIXELS) > 0
    if eroded.sum() >= _FEWEST_INSIDE:
        inside = eroded
    cloud = cloud_from_depth(camera, depth, np.asarray(inside))
    if not len(cloud):
        return cloud
    nearest, farthest = depth_layer(cloud[:, 2])
    margin = LAYER_GAP / 4
    return np.asarray(cloud[(cloud[:, 2] >= nearest - margin) & (cloud[:, 2] <= farthest + margin)])


def relief_height(points: NDArray[np.float64], dome: NDArray[np.float64]) -> float:
    """Fit the ellipsoidal dome whose height, metres, is half the berry's extent towards the camera.

    Least squares of range = a + b x + c y − h · dome, so that neither tilt nor offset counts.

    Parameters
    ----------
    points
        (P, 3): x, y across the view of the berry, z the range.
    dome
        (P,) the unit dome √(1 − ρ²) at each point, ρ from 0 in the outline's middle to 1 at its edge.

    Returns
    -------
    float
        h in metres, 0 for a flat surface; NaN for fewer than 60 points.
    """
    if len(points) < _LEAST_RELIEF_POINTS:
        return float("nan")
    x, y, z = points.T
    design = np.column_stack((np.ones_like(x), x - x.mean(), y - y.mean(), -dome))
    scale = np.maximum(np.abs(design).max(axis=0), 1e-12)
    solution = np.linalg.lstsq(design / scale, z - z.mean(), rcond=None)[0] / scale
    return float(solution[3])
