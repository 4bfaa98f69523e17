"""The points of one berry: taken from its mask and the depth picture, freed of what is not the berry."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, cloud_from_depth

__all__ = [
    "LAYER_GAP",
    "LEAST_POINTS",
    "berry_points",
    "depth_layer",
    "least_squares",
    "median",
    "relief_height",
    "solve_normal",
]

LAYER_GAP = 0.012
"""Metres without a reading that part one thing from what is behind it (a berry's own points lie closer)."""

LEAST_POINTS = 20
"""Fewest points of a berry that is weighed."""

_EDGE_PIXELS = 2
_FEWEST_INSIDE = 40
_LEAST_RELIEF_POINTS = 60
_REGULARISATION = 1e-9
_OUTLIER_SPREADS = 5.0
_SMALLEST_OUTLIER = 0.004
"""Metres off the surface that are never an outlier: a berry is no paraboloid, and stereo is noisy."""


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


def berry_points(
    camera: CameraIntrinsics, depth: NDArray[np.float32], mask: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], dict[str, int]]:
    """Camera-frame points (P, 3) of the berry under ``mask`` (H, W), and how many pixels gave none, by reason.

    * ``no reading``: the camera gave no depth there;
    * ``edge``: two pixels of the outline, where stereo mixes the berry with what is behind or before it (kept where
      the mask is so small that hardly anything would be left);
    * ``other layer``: not in the layer of depth that holds most points;
    * ``outlier``: off the smooth surface, a paraboloid, through the rest.

    May be empty. The four numbers and P add up to the mask's pixels.
    """
    read = mask & (depth > 0)
    inside = np.asarray(
        cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=_EDGE_PIXELS) > 0
    )
    if inside.sum() < _FEWEST_INSIDE:
        inside = mask
    cloud = cloud_from_depth(camera, depth, inside & read)
    dropped = {"no reading": int((mask & ~read).sum()), "edge": int((read & ~inside).sum())}
    layer = _in_layer(cloud[:, 2])
    smooth = _on_surface(cloud[layer])
    dropped |= {"other layer": int((~layer).sum()), "outlier": int((~smooth).sum())}
    return cloud[layer][smooth], dropped


def _in_layer(depths: NDArray[np.float64]) -> NDArray[np.bool_]:
    nearest, farthest = depth_layer(depths)
    margin = LAYER_GAP / 4
    return np.asarray((depths >= nearest - margin) & (depths <= farthest + margin))


def _on_surface(cloud: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (P, 3) lie near the paraboloid through most of them; all if they are too few to tell."""
    kept = np.ones(len(cloud), dtype=np.bool_)
    if len(cloud) < _LEAST_RELIEF_POINTS:
        return kept
    middle = np.array([median(column) for column in cloud.T])
    size = max(float(np.ptp(cloud[:, :2], axis=0).max()), 1e-9)
    x, y, z = (cloud - middle).T / size
    design = np.stack((np.ones_like(x), x, y, x * x, x * y, y * y)).T
    for _ in range(2):
        some = design if kept.all() else design[kept]
        residual = np.abs(z - design @ least_squares(some, z[kept]))
        limit = max(_OUTLIER_SPREADS * 1.4826 * median(residual[kept]), _SMALLEST_OUTLIER / size)
        kept = residual <= limit
    return np.asarray(kept)


def median(values: NDArray[np.floating]) -> float:
    """Median of one or more numbers (N,); several times quicker than NumPy's for the few thousand of a berry."""
    half = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, half)[half])
    return float(np.partition(values, (half - 1, half))[half - 1 : half + 1].mean())


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
    rows = np.stack((np.ones_like(x), x - x.mean(), y - y.mean(), -dome))
    scale = np.maximum(np.abs(rows).max(axis=1), 1e-12)
    rows /= scale[:, None]
    return float(least_squares(rows.T, z - z.mean())[3] / scale[3])


def least_squares(design: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solution (K,) of ``design`` (P, K) · x ≈ ``target`` (P,), its columns of order one.

    By normal equations: of a few smooth columns that is exact enough, and forty times quicker than an orthogonal
    decomposition. Columns that say the same share what they explain.
    """
    return solve_normal(design.T @ design, design.T @ target, len(target))


def solve_normal(
    normal: NDArray[np.float64], projected: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """The same from ``designᵀ design`` (K, K) and ``designᵀ target`` (K,) of ``count`` points."""
    held = normal + _REGULARISATION * count * np.eye(len(normal))
    return np.asarray(np.linalg.solve(held, projected), dtype=np.float64)
