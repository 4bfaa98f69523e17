"""A detector over a set of annotated images: every measure of docs/evaluation.md in one pass.

Images are read, searched and coded one at a time; what stays is run lengths and one small record a berry.
"""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from punnet.data.dataset import AnnotatedImage
from punnet.errors import FileFormatError, PunnetError
from punnet.perception.choosing import COLOUR, load_detector
from punnet.perception.coco_scoring import Collection
from punnet.perception.colour import ColourConfig
from punnet.perception.comparing import BerryRecord, ImageRecord, compare_image, truth_of_image
from punnet.perception.confusion import (
    Confusion,
    confuse_classes,
    confuse_stages,
    confuse_visibility,
    found_by_occlusion,
    found_by_size,
    ripeness_error,
)
from punnet.perception.detector import Detector
from punnet.perception.keypoint_errors import measure_keypoints
from punnet.perception.learned import LearnedDetector
from punnet.perception.matching import match_masks
from punnet.perception.metrics import DetectionScores, ScoreSettings, score_detections

__all__ = [
    "EVALUATION_SCHEMA",
    "Evaluation",
    "EvaluationSettings",
    "evaluate_detector",
    "prepare_detector",
]

EVALUATION_SCHEMA = "punnet-evaluation/1"
WORST_IMAGES = 12
UNSURE_SCORE = 0.05
"""From here on detections of a learned detector count for average precision."""


@dataclass(frozen=True, slots=True)
class EvaluationSettings:
    """What is measured how.

    Parameters
    ----------
    scores
        Thresholds and OKS constants of average precision, for which every detection counts.
    user_score
        Detections from this score on count for everything else: that is what a user sees.
    match_iou
        IoU from which a detection is a berry, for everything but average precision.
    """

    scores: ScoreSettings
    user_score: float
    match_iou: float = 0.5


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What came of it.

    Parameters
    ----------
    detector, data
        Names.
    settings
        How it was measured.
    scores
        Average precision and recall.
    images
        One record an image that was scored.
    seconds
        Of each of them, image in memory to berries.
    skipped
        (photograph, why) of each image that was left out.
    """

    detector: str
    data: str
    settings: EvaluationSettings
    scores: DetectionScores
    images: tuple[ImageRecord, ...]
    seconds: tuple[float, ...]
    skipped: tuple[tuple[Path, str], ...]

    @property
    def berries(self) -> list[BerryRecord]:
        """Records of all annotated berries."""
        return [berry for image in self.images for berry in image.berries]

    @property
    def classes(self) -> Confusion:
        """Annotated by found class."""
        return confuse_classes(self.images)

    @property
    def visibility(self) -> Confusion | None:
        """Annotated by found visibility of key-points."""
        return confuse_visibility(self.berries)

    def worst(self, count: int = WORST_IMAGES) -> list[ImageRecord]:
        """The images with most mistakes, at most ``count``; none without a mistake."""
        ordered = sorted(self.images, key=lambda image: (-image.mistakes, image.index))
        return [image for image in ordered[:count] if image.mistakes]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, null where nothing was annotated."""
        berries = self.berries
        error, known = ripeness_error(berries)
        stages, visibility = confuse_stages(berries), self.visibility
        return {
            "schema": EVALUATION_SCHEMA,
            "detector": self.detector,
            "data": self.data,
            **self.scores.to_json(),
            "user_score": self.settings.user_score,
            "match_iou": self.settings.match_iou,
            "keypoint_sigmas": list(self.settings.scores.sigmas),
            "keypoint_errors": [row.to_json() for row in measure_keypoints(berries)],
            "visibility": None if visibility is None else visibility.to_json(),
            "class_confusion": self.classes.to_json(),
            "stage_confusion": None if stages is None else stages.to_json(),
            "ripeness_error": {"mean": None if math.isnan(error) else round(error, 6), "berries": known},
            "found_by_size": [share.to_json() for share in found_by_size(berries)],
            "found_by_occlusion": [share.to_json() for share in found_by_occlusion(berries)],
            "latency": self.latency(),
            "worst_images": [
                {
                    "photo": image.path.name,
                    "berries": len(image.berries),
                    "missed": image.missed,
                    "misnamed": image.misnamed,
                    "false": len(image.false_classes),
                }
                for image in self.worst()
            ],
            "skipped": [{"photo": str(path), "error": error} for path, error in self.skipped],
        }

    def latency(self) -> dict[str, Any]:
        """Median and 90th percentile of seconds an image, image in memory to berries, and on what machine."""
        seconds = np.array(self.seconds)
        return {
            "median_seconds": round(float(np.median(seconds)), 5) if seconds.size else None,
            "ninety_percent_seconds": round(float(np.percentile(seconds, 90)), 5) if seconds.size else None,
            "machine": _machine(),
        }


def prepare_detector(
    source: str | Path, *, score: float | None = None, colour: ColourConfig | None = None
) -> tuple[Detector, EvaluationSettings]:
    """Load a detector that gives its unsure detections too, and how to measure it.

    Parameters
    ----------
    source
        What :func:`punnet.perception.choosing.load_detector` takes.
    score
        From where on users see detections; the detector's own threshold if None.
    colour
        Settings of the colour baseline, whose scores tell so little that its threshold is left where it is.

    Raises
    ------
    BundleError, ConfigurationError
        If the detector can't be loaded.
    """
    colour = ColourConfig() if colour is None else colour
    if source == COLOUR:
        detector, own = load_detector(source, colour=colour), colour.score
    else:
        detector = LearnedDetector.from_bundle(source, score_threshold=score, unsure_score=UNSURE_SCORE)
        own = detector.score_threshold
    return detector, EvaluationSettings(ScoreSettings(), own if score is None else score)


def evaluate_detector(
    images: Iterable[AnnotatedImage],
    detector: Detector,
    settings: EvaluationSettings,
    *,
    data: str = "",
    progress: Callable[[], None] = lambda: None,
) -> Evaluation:
    """Let a detector look at annotated images, and measure what it says.

    Parameters
    ----------
    images
        The data set, or a part of it. An image that can't be read or scored is left out, and told in ``skipped``.
    detector
        What is measured. It should give its unsure detections too: average precision needs them.
    settings
        What is measured how.
    data
        Name of the data set.
    progress
        Called once an image.

    Raises
    ------
    FileFormatError
        If no image could be scored, or no annotation has a mask.
    """
    collection = Collection()
    records: list[ImageRecord] = []
    seconds: list[float] = []
    skipped: list[tuple[Path, str]] = []
    for index, image in enumerate(images):
        try:
            record, taken = _measure_image(index, image, detector, settings, collection)
            records.append(record)
            seconds.append(taken)
        except PunnetError as error:
            skipped.append((image.path, str(error)))
        progress()
    if not records:
        reason = f"; the first: {skipped[0][1]}" if skipped else ""
        raise FileFormatError(f"evaluation: none of {len(skipped)} images could be scored{reason}")
    if collection.truths and not collection.counted(None):
        raise FileFormatError("evaluation: no annotation has a mask, and masks are what is scored; add them")
    return Evaluation(
        detector=detector.name,
        data=data,
        settings=settings,
        scores=score_detections(collection, settings.scores),
        images=tuple(records),
        seconds=tuple(seconds),
        skipped=tuple(skipped),
    )


def _measure_image(
    index: int,
    image: AnnotatedImage,
    detector: Detector,
    settings: EvaluationSettings,
    collection: Collection,
) -> tuple[ImageRecord, float]:
    frame = image.frame()
    truth, annotations = truth_of_image(image)
    begin = perf_counter()
    found = detector.detect(frame)
    taken = perf_counter() - begin
    entries = collection.add(truth, found)
    matching = match_masks(entries, score=settings.user_score, iou=settings.match_iou)
    return compare_image(index, image, frame, truth.berries, annotations, found, matching), taken


def _machine() -> dict[str, Any]:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            processor = line.split(":", 1)[1].strip()
            break
    return {"processor": processor, "cores": cores}
