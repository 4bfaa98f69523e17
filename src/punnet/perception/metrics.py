"""Average precision and recall of masks (IoU) and key-points (OKS), as COCO has them (thesis 3.4.1, Eq. 3.7).

Matching and interpolation are those of ``faster-coco-eval``, which reproduces pycocotools; this module only
turns :class:`~punnet.scene.Strawberries` into what it reads and its tables into named numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.perception.coco_scoring import COCO_THRESHOLDS, Collection, Truth, collect, score_collection
from punnet.scene import CLASSES, KEYPOINTS, Strawberries

__all__ = [
    "COCO_THRESHOLDS",
    "IOU_THRESHOLDS",
    "KEYPOINT_SIGMAS",
    "OKS_THRESHOLDS",
    "ClassScores",
    "DetectionScores",
    "ScoreSettings",
    "Truth",
    "evaluate_detections",
    "score_detections",
]

IOU_THRESHOLDS = (0.5, 0.7, 0.9)
OKS_THRESHOLDS = (0.1, 0.3, 0.5)
# COCO's σ: the spread of human annotation in units of √(mask area); the k of Eq. 3.7 is 2σ. Estimated on
# StrawDI's annotations by benchmarks/keypoint_constants.py, which says how; order of KEYPOINTS.
KEYPOINT_SIGMAS = (0.110, 0.040, 0.026, 0.050, 0.050)
EVERY_CLASS = "any class"
MEAN_OF_CLASSES = "mean"


@dataclass(frozen=True, slots=True, eq=False)
class ClassScores:
    """Scores of one class. NaN where nothing was annotated.

    Parameters
    ----------
    name
        Class, or "mean" of the classes, or "any class": berries found whatever class they were given.
    truths, detections
        How many were annotated, how many found.
    mask_ap
        Average precision by IoU threshold.
    mask_ap_mean, mask_ar
        AP and recall averaged over IoU .50:.05:.95.
    keypoint_ap
        Average precision by OKS threshold.
    keypoint_ap_mean, keypoint_ar
        AP and recall averaged over OKS .50:.05:.95.
    mask_precision, keypoint_precision
        Interpolated precision (101,) at recall 0, .01 … 1, by threshold; empty without annotations and for "mean".
    """

    name: str
    truths: int
    detections: int
    mask_ap: dict[float, float]
    mask_ap_mean: float
    mask_ar: float
    keypoint_ap: dict[float, float]
    keypoint_ap_mean: float
    keypoint_ar: float
    mask_precision: dict[float, NDArray[np.float64]] = field(default_factory=dict)
    keypoint_precision: dict[float, NDArray[np.float64]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, NaN as null."""
        return {
            "class": self.name,
            "truths": self.truths,
            "detections": self.detections,
            "mask_ap": {f"{t:g}": _nullable(value) for t, value in self.mask_ap.items()},
            "mask_ap_50_95": _nullable(self.mask_ap_mean),
            "mask_ar_50_95": _nullable(self.mask_ar),
            "keypoint_ap": {f"{t:g}": _nullable(value) for t, value in self.keypoint_ap.items()},
            "keypoint_ap_50_95": _nullable(self.keypoint_ap_mean),
            "keypoint_ar_50_95": _nullable(self.keypoint_ar),
        }


@dataclass(frozen=True, slots=True, eq=False)
class DetectionScores:
    """Scores of a detector over a set of images.

    Parameters
    ----------
    images
        How many.
    rows
        One per class in the order of :data:`~punnet.scene.CLASSES`, then "mean" and "any class".
    """

    images: int
    rows: tuple[ClassScores, ...]

    def __getitem__(self, name: str) -> ClassScores:
        """Scores of the class ``name``."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"no class '{name}'; there are {', '.join(row.name for row in self.rows)}")

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, NaN as null."""
        return {"images": self.images, "classes": [row.to_json() for row in self.rows]}


@dataclass(frozen=True, slots=True)
class ScoreSettings:
    """How detections are scored.

    Parameters
    ----------
    iou_thresholds, oks_thresholds
        Where average precision is told, in (0, 1).
    sigmas
        (5,) COCO's σ by key-point; k of Eq. 3.7 is 2σ.
    most_detections
        Only so many of an image's detections of a class count, the best.

    Raises
    ------
    ConfigurationError
        If a threshold lies outside (0, 1), or ``sigmas`` are not five positive numbers.
    """

    iou_thresholds: tuple[float, ...] = IOU_THRESHOLDS
    oks_thresholds: tuple[float, ...] = OKS_THRESHOLDS
    sigmas: tuple[float, ...] = KEYPOINT_SIGMAS
    most_detections: int = 100

    def __post_init__(self) -> None:
        for name in ("iou_thresholds", "oks_thresholds"):
            thresholds = getattr(self, name)
            if not thresholds or not all(0 < threshold < 1 for threshold in thresholds):
                raise ConfigurationError(f"evaluation: {name} must lie in (0, 1), got {list(thresholds)}")
        if len(self.sigmas) != len(KEYPOINTS) or not all(math.isfinite(s) and s > 0 for s in self.sigmas):
            raise ConfigurationError(
                f"evaluation: sigmas must be {len(KEYPOINTS)} positive numbers, got {list(self.sigmas)}"
            )
        if self.most_detections < 1:
            raise ConfigurationError(
                f"evaluation: most_detections must be at least 1, got {self.most_detections}"
            )


def evaluate_detections(
    truth: Iterable[Strawberries | Truth],
    predicted: Iterable[Strawberries],
    settings: ScoreSettings | None = None,
) -> DetectionScores:
    """Score detections against annotations, image by image in the same order.

    Both may be generators: masks are run-length coded as they come, so a large set never lies in memory at
    once.

    Parameters
    ----------
    truth
        Annotated berries, an item an image; as a :class:`Truth` where some are to be ignored.
    predicted
        Found berries, an item an image.
    settings
        Thresholds and OKS constants.

    Raises
    ------
    ShapeError
        If the two differ in length or image sizes, or one side lacks masks.
    """
    return score_detections(collect(truth, predicted), settings)


def score_detections(collection: Collection, settings: ScoreSettings | None = None) -> DetectionScores:
    """Score what was collected.

    As in COCO, annotated berries without any visible or hidden key-point do not count for OKS. The scale s of
    Eq. 3.7 is the square root of the annotated mask's area.
    """
    settings = ScoreSettings() if settings is None else settings
    rows: list[ClassScores] = []
    for merged, names in ((False, CLASSES), (True, (EVERY_CLASS,))):
        masks = score_collection(
            collection,
            "segm",
            settings.iou_thresholds,
            settings.sigmas,
            settings.most_detections,
            merged=merged,
        )
        points = score_collection(
            collection,
            "keypoints",
            settings.oks_thresholds,
            settings.sigmas,
            settings.most_detections,
            merged=merged,
        )
        rows += [
            ClassScores(
                name=name,
                truths=collection.counted(None if merged else k),
                detections=collection.found(None if merged else k),
                mask_ap=masks[k].ap,
                mask_ap_mean=masks[k].ap_mean,
                mask_ar=masks[k].ar,
                keypoint_ap=points[k].ap,
                keypoint_ap_mean=points[k].ap_mean,
                keypoint_ar=points[k].ar,
                mask_precision=masks[k].precision,
                keypoint_precision=points[k].precision,
            )
            for k, name in enumerate(names)
        ]
    rows.insert(len(CLASSES), _mean_row(rows[: len(CLASSES)]))
    return DetectionScores(images=len(collection.images), rows=tuple(rows))


def _mean_row(rows: Sequence[ClassScores]) -> ClassScores:
    """COCO's mean over the classes that were annotated."""
    return ClassScores(
        name=MEAN_OF_CLASSES,
        truths=sum(row.truths for row in rows),
        detections=sum(row.detections for row in rows),
        mask_ap={t: _mean([row.mask_ap[t] for row in rows]) for t in rows[0].mask_ap},
        mask_ap_mean=_mean([row.mask_ap_mean for row in rows]),
        mask_ar=_mean([row.mask_ar for row in rows]),
        keypoint_ap={t: _mean([row.keypoint_ap[t] for row in rows]) for t in rows[0].keypoint_ap},
        keypoint_ap_mean=_mean([row.keypoint_ap_mean for row in rows]),
        keypoint_ar=_mean([row.keypoint_ar for row in rows]),
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def _nullable(value: float) -> float | None:
    return value if math.isfinite(value) else None
