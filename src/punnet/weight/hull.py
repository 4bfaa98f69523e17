"""The convex hull of a berry's points, and the principal components of its surface (thesis section 4.3.1).

The depth of a berry comes in few layers with gaps; the hull gives it a closed surface. The components are those
of the surface, not of the hull's corners: how many corners lie where is noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from punnet.errors import ShapeError

__all__ = ["HullComponents", "hull_components"]

_FLAT = 1e-5
"""Thickness over extent from which on it is left to Qhull whether points have a hull."""
_MOST_LAYERED = 8
"""Points a layer from which it pays to look at layers one by one."""


@dataclass(frozen=True, eq=False)
class HullComponents:
    """Principal components of a hull's surface.

    Parameters
    ----------
    directions
        (3, 3) unit vectors in rows, that of the largest extent first; of each, the entry that is largest by amount is
        positive.
    deviations
        (3,) metres, standard deviation of the surface along each.
    extents
        (3,) metres from end to end along each.
    area, volume
        Square metres and cubic metres.
    """

    directions: NDArray[np.float64]
    deviations: NDArray[np.float64]
    extents: NDArray[np.float64]
    area: float
    volume: float


def hull_components(
    points: NDArray[np.float64], R_view_camera: NDArray[np.float64] | None = None
) -> HullComponents:
    """Principal components of the convex hull of ``points`` (P, 3) metres, whatever their order and density.

    Directions are given in the view that ``R_view_camera`` (3, 3) turns the points into, as they are if None.
    Over a triangle (a, b, c) of area A: ∫x = A (a+b+c)/3 and, with s = a+b+c, ∫xxᵀ = A (aaᵀ + bbᵀ + ccᵀ + ssᵀ)/12.

    Raises
    ------
    ShapeError
        If the points are fewer than four or lie in a plane: they have no hull.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ShapeError(f"hull: need finite points (P, 3), got {points.shape}")
    try:
        turn = np.eye(3) if R_view_camera is None else R_view_camera.T
        turned = (_candidates(points) - points[:1]) @ turn if len(points) > 3 else points
        # Moving points by rounding errors is half the work of merging the facets of a layer; flat ones it would hide.
        hull = ConvexHull(turned, qhull_options="Qt" if _is_flat(turned) else "QJ")
    except (QhullError, ValueError) as error:
        raise ShapeError(f"hull: {len(points)} points have none, they are too few or flat") from error
    triangles = hull.points[hull.simplices]
    a, b, c = (triangles[:, corner] for corner in range(3))
    p, q = (b - a).T, (c - a).T
    normals = np.stack((p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]))
    weight = np.sqrt(np.einsum("ij,ij->j", normals, normals)) / 2.0
    total = a + b + c
    centre = weight @ total / 3.0 / weight.sum()
    second = sum((part.T * weight) @ part for part in (a, b, c, total))
    spread = np.asarray(second) / (12.0 * weight.sum()) - np.outer(centre, centre)
    variances, vectors = np.linalg.eigh(spread)
    directions = vectors.T[::-1]
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions = directions * np.where(largest < 0, -1.0, 1.0)
    extents = np.ptp(hull.points[hull.vertices] @ directions.T, axis=0)
    deviations = np.sqrt(np.clip(variances[::-1], 0.0, None))
    return HullComponents(directions, deviations, extents, float(hull.area), float(hull.volume))


def _is_flat(points: NDArray[np.float64]) -> bool:
    if len(points) < 4:
        return True
    centred = points - points.mean(axis=0)
    thinnest, _, widest = np.linalg.eigvalsh(centred.T @ centred)
    return bool(thinnest <= _FLAT**2 * widest)


def _candidates(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Those of the points that can be corners of the hull.

    Depth comes in layers, and of the points of one layer only the corners of its own flat hull count: ten times
    fewer, and far quicker than asking for the hull of all. Points that do not come in layers are left as they are.
    """
    order = np.argsort(points[:, 2], kind="stable")
    depths = points[order, 2]
    begins = np.flatnonzero(np.diff(depths, prepend=-np.inf))
    if len(points) < _MOST_LAYERED * len(begins):
        return points
    flat = points[order, :2].astype(np.float32)
    chosen = [
        begin + cv2.convexHull(flat[begin:end], returnPoints=False).ravel()
        for begin, end in zip(begins, np.append(begins[1:], len(order)), strict=True)
    ]
    return points[order[np.concatenate(chosen)]]
