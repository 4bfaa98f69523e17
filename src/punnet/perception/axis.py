"""A berry's axis and its five key-points from the outline, calyx evidence and gravity (thesis 3.1.1)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["BerryAxis", "berry_axis", "filled_hull", "find_stem", "fruit_keypoints"]

Vector = NDArray[np.float64]

# How much each cue says about where the calyx is, relative to gravity = 1 (berries hang).
CALYX_WEIGHT = 1.2
ELONGATION_WEIGHT = 4.0
# Least share of the way from calyx to picking point that is green if a strand is this berry's stem.
LEAST_STEM = 0.6


@dataclass(frozen=True, slots=True)
class BerryAxis:
    """Where a berry lies in the image and which way its calyx is.

    Parameters
    ----------
    centre
        (2,) centroid (u, v) of the mask.
    up
        (2,) unit vector in the image from tip to calyx.
    calyx_evidence
        0 … 1: how clearly green lies on one side of the berry.
    """

    centre: Vector
    up: Vector
    calyx_evidence: float

    @property
    def left(self) -> Vector:
        """Unit vector to the left of someone who looks along the optical axis with ``up`` upward."""
        return np.array([self.up[1], -self.up[0]])


def berry_axis(mask: NDArray[np.uint8], leaf: NDArray[np.uint8], gravity_up: Vector) -> BerryAxis:
    """Axis of the berry ``mask`` (H, W) 0/1.

    The convex hull stands for the outline, so that sepals that hang over the fruit do not bend the axis.
    Three cues are added as vectors: gravity (weight 1), the direction in which green of ``leaf`` lies around
    the outline (weight: how one-sided it is), and the principal axis of the outline (weight: how elongated it
    is), which has no sign of its own and takes the one nearer to the other two.
    """
    hull = filled_hull(mask)
    v, u = np.nonzero(hull)
    pixels = np.stack((u, v), axis=1).astype(np.float64)
    centre = pixels.mean(axis=0)
    green, evidence = _calyx_direction(mask, hull, leaf, centre)
    direction = gravity_up + CALYX_WEIGHT * evidence * green
    if len(pixels) >= 3:
        spread, axes = np.linalg.eigh(np.cov((pixels - centre).T))
        elongation = 1.0 - float(np.sqrt(max(spread[0], 0.0) / max(spread[1], 1e-9)))
        principal = axes[:, 1] * np.sign(axes[:, 1] @ direction or 1.0)
        # An outline cut by a leaf or a neighbour is elongated across its axis: trust it less the more it lies
        # flat.
        principal_weight = ELONGATION_WEIGHT * elongation * max(float(principal @ _unit(direction)), 0.0) ** 2
        direction = direction + principal_weight * principal
    return BerryAxis(centre, _unit(direction, fallback=gravity_up), evidence)


def filled_hull(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Fill the convex hull of a mask (H, W) 0/1."""
    points = np.argwhere(mask)[:, ::-1].astype(np.int32)
    if len(points) < 3:
        return mask
    return np.asarray(cv2.fillConvexPoly(mask.copy(), cv2.convexHull(points), 1), dtype=np.uint8)


def _calyx_direction(
    mask: NDArray[np.uint8], hull: NDArray[np.uint8], leaf: NDArray[np.uint8], centre: Vector
) -> tuple[Vector, float]:
    reach = max(2, round(0.15 * float(np.sqrt(mask.sum()))))
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    ring = np.asarray(cv2.dilate(hull, window), dtype=np.uint8) & (1 - mask)
    v, u = np.nonzero(ring & leaf)
    total = int(ring.sum())
    if len(u) == 0 or total == 0:
        return np.zeros(2), 0.0
    away = np.stack((u, v), axis=1) - centre
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    resultant = away.sum(axis=0)
    length = float(np.linalg.norm(resultant))
    # A calyx covers about a quarter of the ring: that much green on one side is full evidence.
    return resultant / max(length, 1e-9), float(min(1.0, length / (0.25 * total)))


def fruit_keypoints(mask: NDArray[np.uint8], axis: BerryAxis) -> Vector:
    """(4, 2) pixels of top, bottom, left_grasp, right_grasp on the convex hull of ``mask``.

    The top is where the axis leaves the fruit, the bottom the tip near it; the grasping points lie where the
    fruit is widest across the axis.
    """
    v, u = np.nonzero(filled_hull(mask))
    relative = np.stack((u, v), axis=1).astype(np.float64) - axis.centre
    along, across = relative @ axis.up, relative @ axis.left
    width = float(across.max() - across.min()) + 1.0
    on_axis = np.abs(across) <= 0.75
    top = along[on_axis].max(initial=0.0) * axis.up
    # The tip is looked for near the axis, so that a bump aside does not pass for it.
    near = np.abs(across) <= max(0.75, 0.2 * width)
    lowest = along[near].min(initial=0.0)
    tip = across[near & (along <= lowest + 1.0)]
    bottom = lowest * axis.up + (float(tip.mean()) if len(tip) else 0.0) * axis.left
    widest = _widest_height(along, across)
    slice_ = np.abs(along - widest) <= 1.0
    left = across[slice_].max() * axis.left + widest * axis.up
    right = across[slice_].min() * axis.left + widest * axis.up
    return np.stack((top, bottom, left, right)) + axis.centre


def _widest_height(along: Vector, across: Vector) -> float:
    """Middle of the heights at which the fruit is at least 95% of its greatest width."""
    rows = np.round(along).astype(np.int64)
    rows -= (lowest := int(rows.min()))
    leftmost = np.full(rows.max() + 1, -np.inf)
    rightmost = np.full(rows.max() + 1, np.inf)
    np.maximum.at(leftmost, rows, across)
    np.minimum.at(rightmost, rows, across)
    widths = np.where(np.isfinite(leftmost), leftmost - np.where(np.isfinite(rightmost), rightmost, 0.0), 0.0)
    wide = np.flatnonzero(widths >= 0.95 * widths.max())
    return float((wide[0] + wide[-1]) / 2 + lowest)


def find_stem(
    leaf: NDArray[np.uint8], top: Vector, expected: Vector, *, reach: float, thickness: float
) -> Vector | None:
    """Find the stem near the pixel ``expected``; None if no green strand there leads to the calyx.

    Strands are looked for on the line through ``expected`` across the way from ``top``. Of those, the one is
    taken whose straight way down to the calyx is greenest, less a penalty for lying aside: a neighbour's stem
    may pass nearer, but background parts it from this berry.

    Parameters
    ----------
    leaf
        (H, W) uint8 0/1, green pixels.
    top
        (2,) pixel of the calyx.
    expected
        (2,) pixel at which the stem is expected.
    reach
        How far to either side to look, pixels.
    thickness
        Widest run of green that passes for a stem, pixels: wider ones are leaves.
    """
    upward = _unit(expected - top)
    across = np.array([upward[1], -upward[0]])
    offsets = np.arange(-np.ceil(reach + thickness), np.ceil(reach + thickness) + 1)
    green = _sample(leaf, expected + offsets[:, None] * across).astype(np.int8)
    steps = np.diff(np.concatenate(([0], green, [0])))
    starts, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    middles = (starts + ends - 1) / 2 - len(offsets) // 2
    best, best_merit = None, 0.0
    for middle in middles[(ends - starts <= thickness) & (np.abs(middles) <= reach)]:
        strand = expected + middle * across
        way = top + np.linspace(0.25, 1.0, 16)[:, None] * (strand - top)
        # A stem a pixel or two wide need not be straight: either neighbour will do.
        connected = float(np.max([_sample(leaf, way + side * across) for side in (-1, 0, 1)], axis=0).mean())
        merit = connected - 0.3 * abs(float(middle)) / reach
        if connected >= LEAST_STEM and merit > best_merit:
            best, best_merit = strand, merit
    return best


def _sample(mask: NDArray[np.uint8], points: Vector) -> NDArray[np.uint8]:
    """Values of ``mask`` at the pixels nearest to ``points`` (P, 2), 0 outside."""
    nearest = np.rint(points).astype(np.int64)
    inside = (nearest >= 0).all(axis=1) & (nearest[:, 0] < mask.shape[1]) & (nearest[:, 1] < mask.shape[0])
    values = np.zeros(len(points), dtype=np.uint8)
    values[inside] = mask[nearest[inside, 1], nearest[inside, 0]]
    return values


def _unit(vector: Vector, fallback: Vector | None = None) -> Vector:
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        return np.array([0.0, -1.0]) if fallback is None else fallback
    return vector / length
