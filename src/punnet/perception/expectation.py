"""What a network's probabilities promise: how well its masks and key-points can be expected to lie."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["expected_iou", "place_keypoints"]

_TINY = 1e-30
_SPREADS = 3.5


def expected_iou(masks: NDArray[np.float32], threshold: float) -> NDArray[np.float64]:
    """Intersection over union (N,) to be expected of masks (N, M, M) of probabilities that are cut at a threshold.

    The intersection is expected to be the sum of the probabilities inside, the union all cells inside and the sum of the
    probabilities outside. 0 where no cell is inside.
    """
    inside = masks > threshold
    cells = inside.sum(axis=(1, 2), dtype=np.float64)
    shared = np.where(inside, masks, 0.0).sum(axis=(1, 2), dtype=np.float64)
    total = masks.sum(axis=(1, 2), dtype=np.float64)
    return np.asarray(shared / np.maximum(cells + total - shared, _TINY))


def place_keypoints(
    heatmaps: NDArray[np.float32],
    regions: NDArray[np.float32],
    areas: NDArray[np.float64],
    sigmas: Sequence[float],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where each key-point's similarity to the true one (OKS, Eq. 3.7) is expected to be highest, and how high.

    The softmax of a heat-map says where the point may be. Blurred with the fall-off of OKS, which is a Gaussian, it says
    what similarity a place can expect. Of two places that may be right, that with more around it is taken, and of a wide
    one the middle; the highest cell alone tells neither.

    Parameters
    ----------
    heatmaps
        (N, P, K, K) logits.
    regions
        (N, 4) xyxy pixels that the maps lie over.
    areas
        (N,) of the masks, square pixels.
    sigmas
        (P,) COCO's σ of each key-point.

    Returns
    -------
    points
        (N, P, 2) pixels, finer than the maps' cells.
    similarity
        (N, P) expected there, in 0…1.
    """
    count, kinds, _, cells = heatmaps.shape
    if not count:
        return np.zeros((0, kinds, 2)), np.zeros((0, kinds))
    sides = np.maximum(regions[:, 2:] - regions[:, :2], 1.0) / cells
    probability = np.exp(np.ascontiguousarray(heatmaps) - heatmaps.max(axis=(2, 3), keepdims=True))
    probability /= probability.sum(axis=(2, 3), keepdims=True)
    spreads = 2.0 * np.sqrt(np.maximum(areas, 1.0))[:, None] * np.asarray(sigmas)
    falloff, reach = _falloff(spreads[:, :, None] / sides[:, None], cells)
    expected = np.empty(heatmaps.shape, dtype=np.float32)
    for at in np.ndindex(count, kinds):
        along_u, along_v = (
            line[cells - 1 - far : cells + far] for line, far in zip(falloff[at], reach[at], strict=True)
        )
        expected[at] = cv2.sepFilter2D(probability[at], -1, along_u, along_v, borderType=cv2.BORDER_CONSTANT)
    highest = expected.reshape(count, kinds, -1).argmax(axis=2)
    row, column = np.divmod(highest, cells)
    berries, all_kinds = np.arange(count)[:, None], np.arange(kinds)
    across, down = expected[berries, all_kinds, row], expected[berries, all_kinds, :, column]
    places = np.stack((column + _summit(across, column), row + _summit(down, row)), axis=2)
    points = (places + 0.5) * sides[:, None] + regions[:, None, :2]
    return points, np.minimum(expected[berries, all_kinds, row, column], 1.0).astype(np.float64)


def _falloff(spreads: NDArray[np.float64], cells: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Gaussians (..., 2·cells − 1) of height 1 in the middle, and how many cells (...) to each side count: down to 1/500."""
    distance = np.arange(1 - cells, cells)
    lines = np.exp(-0.5 * np.square(distance / spreads[..., None])).astype(np.float32)
    return lines, np.minimum(np.ceil(_SPREADS * spreads), cells - 1).astype(np.int64)


def _summit(lines: NDArray[np.float32], top: NDArray[np.int64]) -> NDArray[np.float64]:
    """Where between cells lines (N, P, K) are highest, from their highest cell (N, P): −½ … ½; 0 at an end."""
    last = lines.shape[-1] - 1
    near = np.clip(top[..., None] + np.array([-1, 0, 1]), 0, last)
    left, middle, right = np.moveaxis(
        np.log(np.maximum(np.take_along_axis(lines, near, axis=-1), _TINY)).astype(np.float64), -1, 0
    )
    bend = left - 2.0 * middle + right
    offset = np.where(bend < -1e-9, 0.5 * (left - right) / np.where(bend < -1e-9, bend, -1.0), 0.0)
    return np.asarray(np.where((top > 0) & (top < last), np.clip(offset, -0.5, 0.5), 0.0))
