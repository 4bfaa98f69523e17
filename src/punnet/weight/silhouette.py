"""The outline of one berry, seen as if the camera looked straight at it.

A pinhole camera draws a ball near the picture's border as an ellipse, up to 40% larger in area than in the
middle. Sizes are therefore taken on the plane across the line of sight to the berry, in units of distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, back_project

__all__ = ["Silhouette", "hidden_share", "measure_silhouette", "near_something_nearer", "tidy_mask"]

_HALF_PIXEL = 0.28
"""Pixels by which the hull of pixel centres lies inside the outline they were sampled from, on average."""

_RING = 3


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A convex outline on the plane at distance 1 across the line of sight; sizes are per metre of it.

    Parameters
    ----------
    R_view_camera
        (3, 3) rotation of camera coordinates into the view's: z along the line of sight.
    centre
        (2,) centroid.
    area, length
        Enclosed area, and extent along the berry's axis.
    spread
        (2, 2) covariance of the area; √(xᵀ spread⁻¹ x)/2 is 1 on the ellipse of equal moments.
    corners
        (K, 2) of the outline, in turn.
    """

    R_view_camera: NDArray[np.float64]
    centre: NDArray[np.float64]
    area: float
    length: float
    spread: NDArray[np.float64]
    corners: NDArray[np.float64]

    @property
    def width(self) -> float:
        """Width of the ellipse of this area and length."""
        return 4.0 * self.area / (math.pi * self.length)

    def on_plane(self, camera: CameraIntrinsics, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where pixels (P, 2) of ``camera`` lie on the plane, (P, 2)."""
        return _on_plane(camera, self.R_view_camera, pixels)

    def dome(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """√(1 − ρ²) at (P, 2) points of the plane, ρ = 1 on the ellipse of equal moments; 0 outside."""
        offset = directions - self.centre
        squared = np.einsum("ij,ij->i", offset @ np.linalg.inv(self.spread), offset) / 4.0
        return np.asarray(np.sqrt(np.clip(1.0 - squared, 0.0, None)))


def tidy_mask(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Free a mask (H, W) of specks and threads, and keep its largest piece."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    if not opened.any():
        return np.zeros_like(mask)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    return np.asarray(labels == 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA])))


def measure_silhouette(
    camera: CameraIntrinsics, mask: NDArray[np.bool_], axis: NDArray[np.float64] | None = None
) -> Silhouette:
    """Measure the convex hull of a mask (H, W) that is not empty.

    Parameters
    ----------
    axis
        (2, 2) pixels (u, v) of the berry's top and bottom; without it the length is the longest extent.
    """
    # The corners of the hull are on the outlines of the mask's pieces.
    pieces, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(np.concatenate(pieces))[:, 0, :].astype(np.float64)
    if len(hull) < 3:  # a line of pixels
        corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
        hull = (hull[:, None] + corners).reshape(-1, 2)
        hull = cv2.convexHull(hull.astype(np.float32))[:, 0, :].astype(np.float64)
    middle = back_project(camera, (hull.min(axis=0) + hull.max(axis=0)) / 2.0, 1.0)
    R = _looking_along(middle)
    outline = _on_plane(camera, R, hull)
    area, centre, spread = _moments(outline)
    edge = _HALF_PIXEL * 2.0 / (camera.fx + camera.fy)
    perimeter = float(np.linalg.norm(np.diff(outline, axis=0, append=outline[:1]), axis=1).sum())
    direction = _axis_direction(camera, R, axis, spread)
    extent = float(np.ptp(outline @ direction)) + 2.0 * edge
    grown = (area + perimeter * edge) / area
    outward = outline - centre
    outward *= 1.0 + edge / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), edge)
    return Silhouette(R, centre, area * grown, extent, spread * grown, centre + outward)


def _looking_along(ray: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation into a view whose z is ``ray``, by the shortest turn from the camera's own."""
    z = ray / np.linalg.norm(ray)
    turn = np.cross(z, (0.0, 0.0, 1.0))
    skew = np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + z[2]))


def _on_plane(
    camera: CameraIntrinsics, R: NDArray[np.float64], pixels: NDArray[np.float64]
) -> NDArray[np.float64]:
    rays = back_project(camera, pixels, np.ones(len(pixels))) @ R.T
    return np.asarray(rays[:, :2] / rays[:, 2:])


def _moments(polygon: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Area, centroid and covariance of a simple polygon, by triangles about its first corner."""
    a = polygon[0]
    b, c = polygon[1:-1] - a, polygon[2:] - a
    weights = (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]) / 2.0
    area = float(weights.sum())
    centre = weights @ (b + c) / 3.0 / area
    total = b + c
    second = sum(np.einsum("i,ij,ik->jk", weights, part, part) for part in (b, c, total)) / (12.0 * area)
    return abs(area), a + centre, np.asarray(second - np.outer(centre, centre))


def _axis_direction(
    camera: CameraIntrinsics,
    R: NDArray[np.float64],
    axis: NDArray[np.float64] | None,
    spread: NDArray[np.float64],
) -> NDArray[np.float64]:
    if axis is not None and np.isfinite(axis).all():
        top, bottom = _on_plane(camera, R, np.asarray(axis, dtype=np.float64))
        difference = bottom - top
        size = float(np.linalg.norm(difference))
        if size > 2.0 / camera.fy:
            return np.asarray(difference / size)
    return np.asarray(np.linalg.eigh(spread)[1][:, -1])


def hidden_share(mask: NDArray[np.bool_], near: NDArray[np.bool_]) -> float:
    """Share of a mask's outline, 0 … 1, that is :func:`near_something_nearer`: there the berry goes on behind it."""
    shown = mask.view(np.uint8)
    whole = cv2.erode(shown, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    inner = shown > whole
    return int(np.count_nonzero(inner & near)) / max(1, int(np.count_nonzero(inner)))


def near_something_nearer(
    depth: NDArray[np.float32], mask: NDArray[np.bool_], nearer_than: float
) -> NDArray[np.bool_]:
    """Which pixels (H, W) have, within three, the picture's border or something outside the mask nearer than that."""
    nearer = ((depth > 0) & (depth < nearer_than) & ~mask).view(np.uint8)
    kernel = np.ones((2 * _RING + 1, 2 * _RING + 1), np.uint8)
    return np.asarray(
        cv2.dilate(nearer, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=1).view(np.bool_)
    )
