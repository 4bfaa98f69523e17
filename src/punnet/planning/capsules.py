"""Distances between line segments, many at a time: a capsule is a segment with a radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError

__all__ = ["Capsules", "segment_distances"]

_SHORT = 1e-9  # metres²: a segment below it is a point


@dataclass(frozen=True, eq=False)
class Capsules:
    """N capsules: segments from ``starts`` (N, 3) to ``ends`` (N, 3) and ``radii`` (N,), metres.

    Raises
    ------
    ShapeError
        If the shapes disagree or a number is not finite.
    """

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    radii: NDArray[np.float64]

    def __post_init__(self) -> None:
        starts = np.asarray(self.starts, dtype=np.float64).reshape(-1, 3)
        ends = np.asarray(self.ends, dtype=np.float64).reshape(-1, 3)
        radii = np.asarray(self.radii, dtype=np.float64)
        if ends.shape != starts.shape or radii.shape != (len(starts),):
            raise ShapeError(
                f"capsules: need (N, 3), (N, 3) and (N,), got {starts.shape}, {ends.shape}, {radii.shape}"
            )
        if not (np.isfinite(starts).all() and np.isfinite(ends).all() and np.isfinite(radii).all()):
            raise ShapeError("capsules: all numbers must be finite")
        for name, value in (("starts", starts), ("ends", ends), ("radii", radii)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """N."""
        return len(self.radii)

    def points(self, count: int) -> NDArray[np.float64]:
        """``count`` points (N, count, 3) spread evenly over each segment, its ends among them."""
        share = np.linspace(0.0, 1.0, count)[:, None] if count > 1 else np.full((1, 1), 0.5)
        return np.asarray(self.starts[:, None] + share * (self.ends - self.starts)[:, None])


def segment_distances(
    starts: ArrayLike, ends: ArrayLike, other_starts: ArrayLike, other_ends: ArrayLike
) -> NDArray[np.float64]:
    """Distance (M, N) in metres between each of M and each of N segments, given by their ends (M, 3) and (N, 3).

    Closest points of two segments as in Ericson, *Real-Time Collision Detection*, section 5.1.9. Every product is one
    of matrices, so that nothing of size (M, N, 3) is made; in single precision, good to 0.2 mm for segments within a
    metre of the origin.
    """
    p1, q1, p2, q2 = (np.asarray(v, dtype=np.float32) for v in (starts, ends, other_starts, other_ends))
    d1, d2 = q1 - p1, q2 - p2
    a, e = np.square(d1).sum(axis=1)[:, None], np.square(d2).sum(axis=1)[None]
    a, e = np.maximum(a, np.float32(_SHORT)), np.maximum(e, np.float32(_SHORT))
    b = d1 @ d2.T
    c = (d1 * p1).sum(axis=1)[:, None] - d1 @ p2.T  # d1 · (p1 − p2)
    f = p1 @ d2.T - (d2 * p2).sum(axis=1)[None]  # d2 · (p1 − p2)
    denominator = np.maximum(a * e - b * b, np.float32(1e-6) * a * e)
    s = np.clip((b * f - c * e) / denominator, 0.0, 1.0)
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    apart = np.square(p1).sum(axis=1)[:, None] + np.square(p2).sum(axis=1)[None] - 2.0 * (p1 @ p2.T)
    square = apart + s * s * a + t * t * e + 2.0 * (s * c - t * f - s * t * b)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)), dtype=np.float64)
