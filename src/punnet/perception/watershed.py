"""Dividing a region into berries that touch: watershed of the distance transform."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["region_contacts", "solidity", "split_touching"]


def split_touching(
    mask: NDArray[np.uint8],
    *,
    neck: float,
    convex: float,
    edges: NDArray[np.uint8] | None = None,
) -> NDArray[np.int32]:
    """Label the berries of one connected region.

    Every local maximum of the distance to the background is a candidate berry. Two candidates are one berry
    if their union is convex enough and the neck between them is not narrow.

    Parameters
    ----------
    mask
        (H, W) uint8 0/1, one connected region with a margin of background around it.
    neck
        In (0, 1]: narrower than this share of the smaller candidate, a neck always divides.
    convex
        In (0, 1]: smallest share of its convex hull that a union fills.
    edges
        (H, W) uint8 0/1: pixels where depth jumps, treated as background when distances are measured.

    Returns
    -------
    labels
        (H, W) int32, 0 background, 1 … n the berries.
    """
    core = mask if edges is None else mask & (1 - edges)
    distance = cv2.distanceTransform(core, cv2.DIST_L2, 5)
    widest = float(distance.max())
    if widest < 2.0:
        return mask.astype(np.int32)
    smooth = np.asarray(cv2.GaussianBlur(distance, (0, 0), max(0.8, 0.08 * widest)), dtype=np.float32)
    labels, count = _climb(smooth, mask)
    if count <= 1:
        return mask.astype(np.int32)
    return _merge_convex(labels, smooth, count, neck, convex)


def _climb(distance: NDArray[np.float32], mask: NDArray[np.uint8]) -> tuple[NDArray[np.int32], int]:
    """Basins of the watershed: each pixel belongs to the maximum that steepest ascent from it leads to.

    Written out, because ``cv2.watershed`` floods by colour difference and cuts a distance relief in odd
    places.
    """
    height, width = mask.shape
    # A tilt too small to matter breaks ties, so that a plateau has one maximum.
    relief = np.pad(distance, 1, constant_values=-1.0) + np.linspace(
        0, 1e-4, (height + 2) * (width + 2)
    ).reshape(height + 2, width + 2)
    steps = [(dv, du) for dv in (-1, 0, 1) for du in (-1, 0, 1)]
    around = np.stack([relief[1 + dv : 1 + dv + height, 1 + du : 1 + du + width] for dv, du in steps])
    offsets = np.array([dv * width + du for dv, du in steps])
    target = np.arange(height * width) + offsets[around.argmax(axis=0)].ravel()
    target[mask.ravel() == 0] = np.flatnonzero(mask.ravel() == 0)
    while not np.array_equal(further := target[target], target):
        target = further
    inside = mask > 0
    _, numbers = np.unique(target.reshape(mask.shape)[inside], return_inverse=True)
    labels = np.zeros(mask.shape, np.int32)
    labels[inside] = numbers + 1
    return labels, int(labels.max())


def _merge_convex(
    labels: NDArray[np.int32], distance: NDArray[np.float32], count: int, neck: float, convex: float
) -> NDArray[np.int32]:
    """Join neighbours, most convex union first, until those left are notched or meet at a narrow neck."""
    peak = np.zeros(count + 1)
    np.maximum.at(peak, labels.ravel(), distance.ravel())
    area = np.bincount(labels.ravel(), minlength=count + 1).astype(np.float64)
    hulls = _hulls(labels, count)
    saddles = _saddles(labels, distance)
    owner = np.arange(count + 1)

    def filled(one: int, two: int) -> float:
        return float(area[one] + area[two]) / _hull_area(np.concatenate((hulls[one], hulls[two])))

    unions = {pair: filled(*pair) for pair in saddles}
    while True:
        open_pairs = [
            (unions[pair], pair)
            for pair, saddle in saddles.items()
            if unions[pair] >= convex and saddle >= neck * min(peak[pair[0]], peak[pair[1]])
        ]
        if not open_pairs:
            break
        _, (kept, gone) = max(open_pairs)
        owner[owner == gone] = kept
        peak[kept] = max(peak[kept], peak[gone])
        area[kept] += area[gone]
        hulls[kept] = np.concatenate((hulls[kept], hulls[gone]))
        saddles = _renamed(saddles, gone, kept)
        unions = {
            pair: filled(*pair) if kept in pair or pair not in unions else unions[pair] for pair in saddles
        }
    _, compact = np.unique(owner, return_inverse=True)
    return np.asarray(compact.astype(np.int32)[labels])


def _renamed(saddles: dict[tuple[int, int], float], gone: int, kept: int) -> dict[tuple[int, int], float]:
    renamed: dict[tuple[int, int], float] = {}
    for (one, two), height in saddles.items():
        low, high = sorted((kept if one == gone else one, kept if two == gone else two))
        if low != high:
            renamed[low, high] = max(height, renamed.get((low, high), 0.0))
    return renamed


def _hulls(labels: NDArray[np.int32], count: int) -> list[NDArray[np.int32]]:
    v, u = np.nonzero(labels)
    order = np.argsort(labels[v, u], kind="stable")
    points = np.column_stack((u, v))[order].astype(np.int32)
    ends = np.cumsum(np.bincount(labels[v, u], minlength=count + 1))
    return [np.zeros((0, 1, 2), np.int32)] + [
        np.asarray(cv2.convexHull(points[ends[k] : ends[k + 1]]), dtype=np.int32) for k in range(count)
    ]


def _hull_area(points: NDArray[np.int32]) -> float:
    hull = cv2.convexHull(points)
    # contourArea measures between pixel centres: half the perimeter and a pixel make it comparable with a
    # count.
    return float(cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1)


def solidity(mask: NDArray[np.uint8]) -> float:
    """Share of the convex hull that a region (H, W) 0/1 fills; 1 is convex."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return min(1.0, float(mask.sum()) / _hull_area(np.concatenate(outlines)))


def _saddles(labels: NDArray[np.int32], distance: NDArray[np.float32]) -> dict[tuple[int, int], float]:
    """Greatest distance on the border of each two neighbouring basins."""
    highest: dict[tuple[int, int], float] = {}
    for axis in (0, 1):
        near, far = np.moveaxis(labels, axis, 0)[:-1], np.moveaxis(labels, axis, 0)[1:]
        touching = (near != far) & (near > 0) & (far > 0)
        height = np.minimum(np.moveaxis(distance, axis, 0)[:-1], np.moveaxis(distance, axis, 0)[1:])[touching]
        pairs = np.sort(np.column_stack((near[touching], far[touching])), axis=1)
        for one, two, value in zip(pairs[:, 0].tolist(), pairs[:, 1].tolist(), height.tolist(), strict=True):
            highest[one, two] = max(highest.get((one, two), 0.0), value)
    return highest


def region_contacts(labels: NDArray[np.int32], step: int) -> dict[tuple[int, int], int]:
    """How many pixel pairs at distance ``step`` each two regions share; keys (i, j) with i < j."""
    pairs: list[NDArray[np.int64]] = []
    width = int(labels.max()) + 1
    for axis in (0, 1):
        near, far = np.moveaxis(labels, axis, 0)[:-step], np.moveaxis(labels, axis, 0)[step:]
        touching = (near != far) & (near > 0) & (far > 0)
        one, two = near[touching].astype(np.int64), far[touching].astype(np.int64)
        pairs.append(np.minimum(one, two) * width + np.maximum(one, two))
    keys, counts = np.unique(np.concatenate(pairs), return_counts=True)
    return {(int(key // width), int(key % width)): int(n) for key, n in zip(keys, counts, strict=True)}
