"""Dividing a region into berries that touch: watershed of the distance transform."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["region_contacts", "split_touching"]


def split_touching(
    mask: NDArray[np.uint8], *, neck: float, edges: NDArray[np.uint8] | None = None
) -> NDArray[np.int32]:
    """Label the berries of one connected region.

    Every local maximum of the distance to the background is a candidate berry; two candidates stay apart only
    if the neck between them is narrower than ``neck`` times the smaller one's half width.

    Parameters
    ----------
    mask
        (H, W) uint8 0/1, one connected region with a margin of background around it.
    neck
        In (0, 1]: 1 divides at every waist, small values at none.
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
    smooth = cv2.GaussianBlur(distance, (0, 0), max(0.8, 0.08 * widest))
    markers = _markers(smooth, widest)
    count = int(markers.max())
    if count <= 1:
        return mask.astype(np.int32)
    labels = _flood(smooth, markers, mask)
    return _merge_without_neck(labels, smooth, count, neck)


def _markers(distance: NDArray[np.float32], widest: float) -> NDArray[np.int32]:
    reach = max(3, int(0.5 * widest) * 2 + 1)
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    peaks = (distance >= cv2.dilate(distance, window) - 1e-6) & (distance > max(1.5, 0.3 * widest))
    _, markers = cv2.connectedComponents(peaks.astype(np.uint8), connectivity=8)
    return np.asarray(markers, dtype=np.int32)


def _flood(
    distance: NDArray[np.float32], markers: NDArray[np.int32], mask: NDArray[np.uint8]
) -> NDArray[np.int32]:
    relief = (255.0 * (1.0 - distance / distance.max())).astype(np.uint8)
    background = int(markers.max()) + 1
    seeds = markers.copy()
    seeds[mask == 0] = background
    labels = cv2.watershed(cv2.merge((relief, relief, relief)), seeds)
    labels[labels == background] = 0
    # OpenCV leaves the boundary lines at −1: hand each of their pixels to a neighbouring berry.
    window = np.ones((3, 3), np.uint8)
    for _ in range(3):
        open_pixels = (mask > 0) & (labels <= 0)
        if not open_pixels.any():
            break
        grown = cv2.dilate(np.maximum(labels, 0).astype(np.float32), window).astype(np.int32)
        labels[open_pixels] = grown[open_pixels]
    return np.where(mask > 0, np.maximum(labels, 0), 0).astype(np.int32)


def _merge_without_neck(
    labels: NDArray[np.int32], distance: NDArray[np.float32], count: int, neck: float
) -> NDArray[np.int32]:
    peak = np.zeros(count + 1)
    np.maximum.at(peak, labels.ravel(), distance.ravel())
    parent = np.arange(count + 1)

    def root(label: int) -> int:
        while parent[label] != label:
            label = int(parent[label])
        return label

    passes = [
        (saddle / max(min(peak[i], peak[j]), 1e-6), i, j) for (i, j), saddle in _saddles(labels, distance)
    ]
    for ratio, i, j in sorted(passes, reverse=True):
        first, second = root(i), root(j)
        if first == second or ratio < neck:
            continue
        if peak[first] < peak[second]:
            first, second = second, first
        parent[second] = first
    roots = np.array([root(label) for label in range(count + 1)])
    _, compact = np.unique(roots, return_inverse=True)
    return compact.astype(np.int32)[labels]


def _saddles(labels: NDArray[np.int32], distance: NDArray[np.float32]) -> list[tuple[tuple[int, int], float]]:
    highest: dict[tuple[int, int], float] = {}
    for one, two, height in _neighbours(labels, 1, distance):
        key = (min(one, two), max(one, two))
        highest[key] = max(highest.get(key, 0.0), height)
    return list(highest.items())


def _neighbours(
    labels: NDArray[np.int32], step: int, values: NDArray[np.float32]
) -> list[tuple[int, int, float]]:
    found: list[tuple[int, int, float]] = []
    for axis in (0, 1):
        near = np.moveaxis(labels, axis, 0)[:-step]
        far = np.moveaxis(labels, axis, 0)[step:]
        touching = (near != far) & (near > 0) & (far > 0)
        lower = np.minimum(np.moveaxis(values, axis, 0)[:-step], np.moveaxis(values, axis, 0)[step:])
        found += list(
            zip(near[touching].tolist(), far[touching].tolist(), lower[touching].tolist(), strict=True)
        )
    return found


def region_contacts(labels: NDArray[np.int32], step: int) -> dict[tuple[int, int], int]:
    """How many pixel pairs at distance ``step`` each two regions share; keys (i, j) with i < j."""
    pairs: list[NDArray[np.int64]] = []
    width = int(labels.max()) + 1
    for axis in (0, 1):
        near = np.moveaxis(labels, axis, 0)[:-step].astype(np.int64)
        far = np.moveaxis(labels, axis, 0)[step:].astype(np.int64)
        touching = (near != far) & (near > 0) & (far > 0)
        one, two = near[touching], far[touching]
        pairs.append(np.minimum(one, two) * width + np.maximum(one, two))
    keys, counts = np.unique(np.concatenate(pairs), return_counts=True)
    return {(int(key // width), int(key % width)): int(n) for key, n in zip(keys, counts, strict=True)}
