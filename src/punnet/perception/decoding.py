"""From a network's raw detections to :class:`~punnet.scene.Strawberries`, in NumPy and OpenCV alone.

Masks are not laid over the image as torchvision's ``paste_masks_in_image`` does, which rounds their regions to whole
pixels: of masks that are perfect, on StrawDI reduced to 640 pixels, one in seven is left with an IoU under .9. Here the
resampling is the exact inverse of training's. Key-points are not its ``heatmaps_to_keypoints``'s either, the highest
cells, but the places that can expect most of OKS (:mod:`punnet.perception.expectation`).
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.perception.colour import box_around
from punnet.perception.expectation import expected_iou, place_keypoints
from punnet.perception.network import RawDetections
from punnet.scene import KEYPOINTS, Strawberries, Visibility

__all__ = ["Patch", "decode_detections", "paste_mask", "without_duplicates"]

_LOG = logging.getLogger(__name__)
DUPLICATE_IOU = 0.7
MASK_BYTES = 4_000_000_000
POWERS = (0.5, 0.25)  # of the IoU and of the OKS to be expected, in a score


@dataclass(frozen=True, eq=False)
class Patch:
    """A mask without the empty image around it: ``inside`` (h, w) bool, its first pixel at (top, left)."""

    top: int
    left: int
    inside: NDArray[np.bool_]

    @property
    def area(self) -> int:
        """Pixels in it."""
        return int(np.count_nonzero(self.inside))

    def window(self) -> tuple[slice, slice]:
        """Rows and columns in the image."""
        height, width = self.inside.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)


def paste_mask(
    probabilities: NDArray[np.float32], region: NDArray[np.float64], size: tuple[int, int], threshold: float
) -> Patch:
    """Resample a mask (M, M) over its region (4,) xyxy and cut it at the threshold and the image's edges.

    The exact inverse of RoIAlign, by which networks are shown their masks in training: the pixel with index ``i`` lies at
    ``(i - x0) * M / (x1 - x0) - 1/2`` cells.
    """
    cells = len(probabilities)
    (u0, v0), (u1, v1) = np.floor(region[:2]), np.ceil(region[2:]) + 1
    left, top = max(int(u0), 0), max(int(v0), 0)
    right, bottom = min(int(u1), size[1]), min(int(v1), size[0])
    if right <= left or bottom <= top:
        return Patch(top, left, np.zeros((0, 0), dtype=np.bool_))
    density = cells / np.maximum(region[2:] - region[:2], 1e-3)
    first = (np.array([left, top]) - region[:2]) * density - 0.5
    to_cells = np.array([[density[0], 0.0, first[0]], [0.0, density[1], first[1]]])
    # Outside its region there is no berry: the border is constant zero.
    resampled = cv2.warpAffine(
        probabilities, to_cells, (right - left, bottom - top), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    return Patch(top, left, np.asarray(resampled) > threshold)


def without_duplicates(patches: list[Patch], labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows to keep, best first: none that is empty, or of another class and nearly the same pixels as a better one."""
    areas = _areas(patches)
    kept: list[int] = []
    for i in np.flatnonzero(areas > 0):
        rivals = (
            k
            for k in kept
            if labels[k] != labels[i] and DUPLICATE_IOU * areas[k] < areas[i] < areas[k] / DUPLICATE_IOU
        )
        if not any(_iou(patches[i], patches[k], areas[i] + areas[k]) > DUPLICATE_IOU for k in rivals):
            kept.append(int(i))
    return np.array(kept, dtype=np.int64)


def _rows(patches: list[Patch], raw: RawDetections, unsure_below: float) -> NDArray[np.int64]:
    """Rows to keep: the sure ones without duplicates, and all unsure ones that are not empty."""
    sure = int(np.count_nonzero(raw.scores >= unsure_below))
    unsure = sure + np.flatnonzero(_areas(patches[sure:]) > 0)
    return np.concatenate((without_duplicates(patches[:sure], raw.labels[:sure]), unsure))


def _areas(patches: list[Patch]) -> NDArray[np.int64]:
    return np.array([patch.area for patch in patches], dtype=np.int64)


def decode_detections(
    raw: RawDetections,
    network_size: tuple[int, int],
    frame_size: tuple[int, int],
    mask_threshold: float,
    sigmas: Sequence[float],
    *,
    least_score: float = 0.0,
    unsure_below: float = 0.0,
) -> Strawberries:
    """Berries in the frame's own pixels, best first.

    A berry's score is how sure the network is of its class, times √(IoU to be expected of its mask), times ⁴√(OKS to be
    expected of its key-points): where to put what also matters to whoever acts on it. The powers were chosen for average
    precision on simulated images that are in no test (docs/table-3-3.md).

    Parameters
    ----------
    raw
        Detections in the pixels of the network's input.
    network_size
        (H, W) of the image that was put in, without the padding.
    frame_size
        (H, W) of the frame.
    mask_threshold
        Probability above which a pixel belongs to the berry.
    sigmas
        (5,) COCO's σ of the key-points.
    least_score
        Berries below it are left out.
    unsure_below
        Detections with a lower score are kept beside one of another class on the same pixels: average precision, which
        takes each class for itself, wants a berry's second-best class too.
    """
    factor = np.array([frame_size[1] / network_size[1], frame_size[0] / network_size[0]])
    raw, keypoints = _rated(raw, mask_threshold, sigmas, least_score)
    # Masks and key-points are measured from pixel to pixel, boxes from edge to edge.
    regions = (raw.regions + 0.5) * np.tile(factor, 2) - 0.5
    patches = [
        paste_mask(mask, region, frame_size, mask_threshold)
        for mask, region in zip(raw.masks, regions, strict=True)
    ]
    rows = _fitting(_rows(patches, raw, unsure_below), frame_size)
    raw, keypoints = raw[rows], (keypoints[rows] + 0.5) * factor - 0.5
    masks = np.zeros((len(rows), *frame_size), dtype=np.bool_)
    for mask, row in zip(masks, rows, strict=True):
        mask[patches[row].window()] = patches[row].inside
    visibility = raw.visibility.argmax(axis=2).astype(np.int64)
    outside = ((keypoints < -0.5) | (keypoints > np.array(frame_size[::-1]) - 0.5)).any(axis=2)
    visibility[outside] = Visibility.ABSENT
    keypoints[visibility == Visibility.ABSENT] = np.nan
    boxes = raw.boxes * np.tile(factor, 2)
    return Strawberries(
        image_size=frame_size,
        boxes=np.array(
            [box_around(*pair, frame_size) for pair in zip(boxes, keypoints, strict=True)]
        ).reshape(-1, 4),
        scores=np.clip(raw.scores, 0.0, 1.0),
        classes=raw.labels,
        masks=masks,
        keypoints=keypoints.reshape(len(rows), len(KEYPOINTS), 2),
        visibility=visibility,
        ripeness=np.clip(raw.ripeness, 0.0, 1.0),
    )


def _rated(
    raw: RawDetections, mask_threshold: float, sigmas: Sequence[float], least_score: float
) -> tuple[RawDetections, NDArray[np.float64]]:
    """Those with the score or more, best first by their new scores, and their key-points (N, 5, 2) in the network's pixels."""
    extents = raw.regions[:, 2:] - raw.regions[:, :2]
    areas = (raw.masks > mask_threshold).mean(axis=(1, 2)) * extents.prod(axis=1, dtype=np.float64)
    keypoints, similarity = place_keypoints(raw.heatmaps, raw.regions, areas, sigmas)
    there = 1.0 - raw.visibility[:, :, Visibility.ABSENT]
    oks = (similarity * there).sum(axis=1) / np.maximum(there.sum(axis=1), 1e-6)
    scores = raw.scores * expected_iou(raw.masks, mask_threshold) ** POWERS[0] * oks ** POWERS[1]
    order = np.argsort(-scores, kind="stable")
    order = order[scores[order] >= least_score]
    return replace(raw, scores=scores.astype(np.float32))[order], keypoints[order]


def _fitting(rows: NDArray[np.int64], size: tuple[int, int]) -> NDArray[np.int64]:
    """As many of the best rows as their full-size masks fit into memory."""
    most = max(1, MASK_BYTES // (size[0] * size[1]))
    if len(rows) > most:
        _LOG.warning(
            "image of %d×%d: kept the masks of %d of %d berries; give a smaller image",
            *size[::-1],
            most,
            len(rows),
        )
    return rows[:most]


def _iou(one: Patch, other: Patch, areas: int) -> float:
    top, left = max(one.top, other.top), max(one.left, other.left)
    bottom = min(one.window()[0].stop, other.window()[0].stop)
    right = min(one.window()[1].stop, other.window()[1].stop)
    if bottom <= top or right <= left:
        return 0.0
    shared = np.count_nonzero(
        one.inside[top - one.top : bottom - one.top, left - one.left : right - one.left]
        & other.inside[top - other.top : bottom - other.top, left - other.left : right - other.left]
    )
    return float(shared / (areas - shared))
