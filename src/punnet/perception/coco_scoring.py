"""The bridge to ``faster-coco-eval``: containers in, its precision and recall tables out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.scene import CLASSES, KEYPOINTS, Strawberries

__all__ = [
    "COCO_THRESHOLDS",
    "Collection",
    "ImageEntries",
    "ThresholdScores",
    "Truth",
    "collect",
    "score_collection",
]

COCO_THRESHOLDS = tuple(round(0.5 + 0.05 * step, 2) for step in range(10))
# COCO takes every detected key-point at its coordinates; nothing is similar to a point this far away.
NOT_FOUND = -1e6
Kind = Literal["segm", "keypoints"]


@dataclass(frozen=True, eq=False)
class Truth:
    """What is annotated in one image.

    Parameters
    ----------
    berries
        Those that count.
    ignored
        Those too little seen to count (COCO's ``iscrowd``): a detection of the same class that lies on one is neither right
        nor wrong.
    """

    berries: Strawberries
    ignored: Strawberries


@dataclass(frozen=True, eq=False)
class ImageEntries:
    """COCO dictionaries of one image, masks as compressed run lengths."""

    truths: list[dict[str, Any]]
    ignored: list[dict[str, Any]]
    detections: list[dict[str, Any]]


class Collection:
    """Annotations and detections of a set of images as COCO entries; category ids are class + 1.

    Masks are run-length coded when an image is added, so a large set does not lie in memory.
    """

    def __init__(self) -> None:
        self.images: list[dict[str, Any]] = []
        self.truths: list[dict[str, Any]] = []
        self.detections: list[dict[str, Any]] = []

    def add(self, truth: Strawberries | Truth, found: Strawberries) -> ImageEntries:
        """Take in one image.

        Raises
        ------
        ShapeError
            If image sizes differ, or berries lack masks.
        """
        index = len(self.images)
        if isinstance(truth, Strawberries):
            truth = Truth(truth, Strawberries.empty(truth.image_size))
        size = truth.berries.image_size
        if truth.ignored.image_size != size or found.image_size != size:
            raise ShapeError(
                f"evaluation: image {index} is {size} in truth but {found.image_size} in predicted "
                f"(ignored: {truth.ignored.image_size})"
            )
        encoder = _Encoder(size)
        image_id = index + 1
        entries = ImageEntries(
            truths=_entries(truth.berries, encoder, image_id, len(self.truths)),
            ignored=_entries(truth.ignored, encoder, image_id, len(self.truths) + len(truth.berries)),
            detections=_entries(found, encoder, image_id, len(self.detections)),
        )
        for entry in entries.ignored:
            entry |= {"iscrowd": 1, "keypoints": [0.0] * (3 * len(KEYPOINTS)), "num_keypoints": 0}
        self.images.append({"id": image_id, "height": size[0], "width": size[1]})
        self.truths += entries.truths + entries.ignored
        self.detections += entries.detections
        return entries

    def counted(self, berry_class: int | None) -> int:
        """How many annotations of a class count; of all classes for None."""
        return _count([entry for entry in self.truths if not entry["iscrowd"]], berry_class)

    def found(self, berry_class: int | None) -> int:
        """How many detections are of a class; of all classes for None."""
        return _count(self.detections, berry_class)


def _count(entries: Sequence[dict[str, Any]], berry_class: int | None) -> int:
    return sum(berry_class is None or entry["category_id"] == berry_class + 1 for entry in entries)


@dataclass(frozen=True, slots=True, eq=False)
class ThresholdScores:
    """AP by threshold, AP and recall averaged over .50:.05:.95; NaN without annotations.

    ``precision`` holds, by threshold, the interpolated precision (101,) at recall 0, .01 … 1; empty without annotations.
    """

    ap: dict[float, float]
    ap_mean: float
    ar: float
    precision: dict[float, NDArray[np.float64]]


def collect(truth: Iterable[Strawberries | Truth], predicted: Iterable[Strawberries]) -> Collection:
    """Turn two series of images' berries into COCO entries, one image at a time.

    Raises
    ------
    ShapeError
        If the series differ in length or image sizes, or berries lack masks.
    """
    collection = Collection()
    for index, (annotated, found) in enumerate(zip_longest(truth, predicted)):
        if annotated is None or found is None:
            raise ShapeError(
                f"evaluation: only one of truth and predicted has an image {index}; give as many of both"
            )
        collection.add(annotated, found)
    return collection


class _Encoder:
    """Run lengths of masks that fill a small part of the image: only that part is turned to column order."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._plane = np.zeros(size, dtype=np.uint8, order="F")

    def encode(self, mask: NDArray[np.bool_]) -> dict[str, Any]:
        from faster_coco_eval.core import mask as run_lengths

        rows = np.flatnonzero(mask.any(axis=1))
        if not rows.size:
            return dict(run_lengths.encode(self._plane))
        band = mask[rows[0] : rows[-1] + 1]
        columns = np.flatnonzero(band.any(axis=0))
        part = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
        self._plane[part] = mask[part]
        encoded = dict(run_lengths.encode(self._plane))
        self._plane[part] = 0
        return encoded


def _entries(berries: Strawberries, encoder: _Encoder, image_id: int, count: int) -> list[dict[str, Any]]:
    return [_entry(berries, berry, encoder, image_id, count + berry + 1) for berry in range(len(berries))]


def _entry(
    berries: Strawberries, berry: int, encoder: _Encoder, image_id: int, entry_id: int
) -> dict[str, Any]:
    if berries.masks is None:
        raise ShapeError(
            f"evaluation: the berries of image {image_id - 1} have no masks; average precision needs them"
        )
    mask: NDArray[np.bool_] = berries.masks[berry]
    left, top, right, bottom = berries.boxes[berry].tolist()
    entry: dict[str, Any] = {
        "id": entry_id,
        "image_id": image_id,
        "category_id": int(berries.classes[berry]) + 1,
        "segmentation": encoder.encode(mask),
        "bbox": [left, top, right - left, bottom - top],
        "area": int(mask.sum()),
        "iscrowd": 0,
        "score": float(berries.scores[berry]),
        "keypoints": [0.0] * (3 * len(KEYPOINTS)),
        "num_keypoints": 0,
    }
    if berries.keypoints is not None and berries.visibility is not None:
        known = np.isfinite(berries.keypoints[berry]).all(axis=1)
        flags = np.minimum(berries.visibility[berry], 2) * known
        points = np.where(known[:, None], berries.keypoints[berry], NOT_FOUND)
        entry["keypoints"] = np.column_stack((points, flags)).ravel().tolist()
        entry["num_keypoints"] = int((flags > 0).sum())
    return entry


def score_collection(
    collection: Collection,
    kind: Kind,
    thresholds: Sequence[float],
    sigmas: Sequence[float],
    most_detections: int,
    *,
    merged: bool,
) -> list[ThresholdScores]:
    """Scores of each class, or with ``merged`` of all berries as one class.

    Parameters
    ----------
    collection
        What :func:`collect` gave.
    kind
        ``segm`` compares masks by IoU, ``keypoints`` points by OKS.
    thresholds
        Where average precision is told.
    sigmas
        (5,) COCO's σ by key-point.
    most_detections
        Detections an image and class that count.
    """
    categories = (
        [{"id": 1, "name": "berry"}] if merged else [{"id": k + 1, "name": c} for k, c in enumerate(CLASSES)]
    )
    evaluated = tuple(sorted({*COCO_THRESHOLDS, *thresholds}))
    if not collection.truths or (
        kind == "keypoints" and not any(t["num_keypoints"] for t in collection.truths)
    ):
        empty = ThresholdScores(
            dict.fromkeys(thresholds, math.nan), math.nan, math.nan, dict.fromkeys(thresholds, np.zeros(0))
        )
        return [empty] * len(categories)
    precision, recall = _tables(collection, kind, evaluated, sigmas, most_detections, categories)
    positions = {threshold: evaluated.index(threshold) for threshold in evaluated}
    standard = [positions[threshold] for threshold in COCO_THRESHOLDS]
    return [
        ThresholdScores(
            ap={t: _average(precision[positions[t], :, k]) for t in thresholds},
            ap_mean=_average(precision[standard, :, k]),
            ar=_average(recall[standard, k]),
            precision={t: _known(precision[positions[t], :, k]) for t in thresholds},
        )
        for k in range(len(categories))
    ]


def _tables(
    collection: Collection,
    kind: Kind,
    thresholds: Sequence[float],
    sigmas: Sequence[float],
    most_detections: int,
    categories: list[dict[str, Any]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Precision (threshold, recall step, class) and recall (threshold, class); −1 without annotations."""
    from faster_coco_eval import COCO, COCOeval_faster

    merged = len(categories) == 1

    def copies(entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
        # The evaluation writes into the entries it is given.
        return [{**entry, "category_id": 1} if merged else dict(entry) for entry in entries]

    annotated = COCO(
        {"images": collection.images, "annotations": copies(collection.truths), "categories": categories}
    )
    found = annotated.loadRes(copies(collection.detections))
    evaluation = COCOeval_faster(annotated, found, iouType=kind, kpt_oks_sigmas=list(sigmas))
    evaluation.params.iouThrs = np.array(thresholds)
    evaluation.params.maxDets = [most_detections]
    # By default only what is annotated is evaluated, and the tables change shape.
    evaluation.params.imgIds = [image["id"] for image in collection.images]
    evaluation.params.catIds = [category["id"] for category in categories]
    evaluation.params.areaRng = [[0, 1e10]]
    evaluation.params.areaRngLbl = ["all"]
    evaluation.evaluate()
    evaluation.accumulate()
    precision = np.asarray(evaluation.eval["precision"], dtype=np.float64)
    recall = np.asarray(evaluation.eval["recall"], dtype=np.float64)
    return precision[:, :, :, 0, 0], recall[:, :, 0, 0]


def _known(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values[values > -1]


def _average(values: NDArray[np.float64]) -> float:
    known = _known(values)
    return float(known.mean()) if known.size else math.nan
