"""The visible surface of a berry, rebuilt from its depth points, and points sampled from it.

The depth pictures of stereo cameras come in steps: a berry's points lie on a few sheets (thesis fig. 4.9a). The surface is the
Delaunay triangulation of the points as the camera sees them, smoothed along the rays, without triangles that span gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.spatial import Delaunay, QhullError

from punnet.errors import ShapeError

__all__ = ["Surface", "rebuild_surface", "sample_surface"]

LONGEST_EDGE = 0.008
"""Metres: a triangle with a longer edge spans a gap between two things, not the berry."""

_SMOOTHINGS = 3


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles in the camera frame.

    Parameters
    ----------
    vertices
        (V, 3) metres.
    triangles
        (T, 3) indices of vertices; may be empty, where the points lie on a line.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]

    @property
    def areas(self) -> NDArray[np.float64]:
        """(T,) square metres."""
        a, b, c = (self.vertices[self.triangles[:, corner]] for corner in range(3))
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def rebuild_surface(cloud: NDArray[np.floating], most_points: int = 1500) -> Surface:
    """The visible surface through ``cloud`` (P, 3) metres in the camera frame, z > 0.

    Parameters
    ----------
    cloud
        Points of one berry; their order does not matter.
    most_points
        Larger clouds are thinned, evenly in the image, to about so many.

    Raises
    ------
    ShapeError
        If the cloud is not (P, 3) with at least one point, or a point does not lie before the camera.
    """
    points = np.asarray(cloud, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise ShapeError(f"cloud must be (P, 3) with P ≥ 1, got {points.shape}")
    if not (np.isfinite(points).all() and (points[:, 2] > 0).all()):
        raise ShapeError("cloud: every point must be finite and lie before the camera (z > 0)")
    points = points[np.lexsort(points.T)]
    # Sorted by depth, then y, then x: an even stride thins all parts of the berry alike.
    points = points[:: max(1, round(len(points) / most_points))]
    seen = points[:, :2] / points[:, 2:]
    try:
        triangles = np.asarray(Delaunay(seen - seen.mean(axis=0)).simplices, dtype=np.int64)
    except (QhullError, ValueError):  # fewer than three points, or all on a line
        return Surface(points, np.empty((0, 3), dtype=np.int64))
    points = _smooth(points, triangles)
    corners = points[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    kept = triangles[longest <= LONGEST_EDGE]
    return Surface(points, kept if len(kept) else triangles)


def _smooth(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Move each vertex along its ray to the mean depth of itself and its neighbours, a few times."""
    n = len(points)
    starts = triangles.ravel()
    ends = np.roll(triangles, 1, axis=1).ravel()
    lengths = np.linalg.norm(points[starts, :2] - points[ends, :2], axis=1)
    near = lengths <= LONGEST_EDGE
    starts, ends = starts[near], ends[near]
    rows = np.concatenate((starts, ends, np.arange(n)))
    columns = np.concatenate((ends, starts, np.arange(n)))
    links = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    links.data[:] = 1.0  # an edge of two triangles counts once
    depths = points[:, 2]
    share = 1.0 / np.asarray(links.sum(axis=1)).ravel()
    for _ in range(_SMOOTHINGS):
        depths = share * (links @ depths)
    return np.asarray(points * (depths / points[:, 2])[:, None])


def sample_surface(surface: Surface, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """``count`` points (count, 3) drawn evenly by area; of a surface without triangles, its vertices at random."""
    areas = surface.areas
    if not len(areas) or not areas.sum() > 0:
        return surface.vertices[generator.integers(len(surface.vertices), size=count)]
    chosen = surface.triangles[generator.choice(len(areas), size=count, p=areas / areas.sum())]
    # Uniform in the triangle: fold the unit square's upper half over its diagonal.
    u, v = generator.random((2, count))
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    a, b, c = (surface.vertices[chosen[:, corner]] for corner in range(3))
    return np.asarray(a + u[:, None] * (b - a) + v[:, None] * (c - a))
