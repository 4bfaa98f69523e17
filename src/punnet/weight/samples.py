"""Berries with a known weight, as cameras saw them: what weight estimators are trained and judged on."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage, Dataset
from punnet.errors import ConfigurationError, PunnetError, ShapeError
from punnet.perception.coco_scoring import Collection
from punnet.perception.detector import Detector
from punnet.perception.matching import match_masks
from punnet.scene import PLUCKABLE
from punnet.weight.observation import BerryObservation, observe

__all__ = [
    "LEAST_OVERLAP",
    "NOT_FOUND",
    "MissedBerry",
    "WeightSamples",
    "collect_samples",
    "join_samples",
    "plant_of",
]

LEAST_OVERLAP = 0.5
"""Least intersection over union at which a detector's mask is that of an annotated berry."""

NOT_FOUND = "not found by the detector"

_NUMBER = re.compile(r"\d+(\.\d+)?")


@dataclass(frozen=True)
class MissedBerry:
    """A berry of known weight that could not be observed: why, and the fields of :class:`WeightSamples`."""

    reason: str
    grams: float
    group: str
    occlusion: float
    image: int
    annotation: int


@dataclass(frozen=True, eq=False)
class WeightSamples:
    """N berries with a known weight, each as one image shows it.

    Parameters
    ----------
    observations
        N, what an estimator may see.
    grams
        (N,) true weights.
    groups
        N names of plants; splits never part a group.
    occlusion
        (N,) share of the fruit's outline that something else hides, as annotated; NaN unknown.
    distance
        (N,) metres, median depth of the berry's points.
    image, annotation
        (N,) ids in the data set.
    missed
        Berries of known weight that could not be observed; an estimator must not score better for them.
    skipped
        Why images were left out, one line each.

    Raises
    ------
    ShapeError
        If lengths differ.
    """

    observations: tuple[BerryObservation, ...]
    grams: NDArray[np.float64]
    groups: tuple[str, ...]
    occlusion: NDArray[np.float64]
    distance: NDArray[np.float64]
    image: NDArray[np.int64]
    annotation: NDArray[np.int64]
    missed: tuple[MissedBerry, ...] = ()
    skipped: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        lengths = {
            name: len(getattr(self, name))
            for name in ("observations", "grams", "groups", "occlusion", "distance", "image", "annotation")
        }
        if len(set(lengths.values())) != 1:
            raise ShapeError(f"weight samples: fields differ in length: {lengths}")

    def __len__(self) -> int:
        return len(self.observations)

    @property
    def refused(self) -> dict[str, int]:
        """How many berries were missed, by reason (numbers left out), the commonest first."""
        return dict(Counter(_NUMBER.sub("…", berry.reason) for berry in self.missed).most_common())

    def subset(self, indices: Iterable[int] | NDArray[np.integer[Any]]) -> WeightSamples:
        """The samples at ``indices``, in that order; what was missed or skipped is left behind."""
        chosen = [int(index) for index in indices]
        return WeightSamples(
            observations=tuple(self.observations[index] for index in chosen),
            grams=self.grams[chosen],
            groups=tuple(self.groups[index] for index in chosen),
            occlusion=self.occlusion[chosen],
            distance=self.distance[chosen],
            image=self.image[chosen],
            annotation=self.annotation[chosen],
        )


def collect_samples(
    dataset: Dataset,
    *,
    detector: Detector | None = None,
    progress: Callable[[], None] | None = None,
) -> WeightSamples:
    """Observe the ripe berries of known weight of a data set.

    Berries marked as crowd, without a weight, or unpluckable are no samples. Images that can't be read are skipped.

    Parameters
    ----------
    dataset
        With depth, cameras and weights.
    detector
        Whose masks, key-points and ripeness are observed, matched to the annotated masks (:data:`LEAST_OVERLAP`); the
        annotated ones if None.
    progress
        Called after each image.
    """
    rows: list[tuple[BerryObservation, AnnotatedImage, int]] = []
    missed: list[MissedBerry] = []
    skipped: list[str] = []
    for image in dataset:
        try:
            for index, seen in _observed(image, detector):
                if isinstance(seen, str):
                    missed.append(_missed(seen, image, index))
                else:
                    rows.append((_compact(seen), image, index))
        except PunnetError as error:
            skipped.append(str(error))
        if progress is not None:
            progress()
    annotations = [image.annotations[index] for _, image, index in rows]
    return WeightSamples(
        observations=tuple(seen for seen, _, _ in rows),
        grams=np.array([annotation.weight for annotation in annotations], dtype=np.float64),
        groups=tuple(plant_of(image) for _, image, _ in rows),
        occlusion=np.array([annotation.occlusion for annotation in annotations], dtype=np.float64),
        distance=np.array([np.median(seen.cloud[:, 2]) for seen, _, _ in rows], dtype=np.float64),
        image=np.array([image.id for _, image, _ in rows], dtype=np.int64),
        annotation=np.array([annotation.id for annotation in annotations], dtype=np.int64),
        missed=tuple(missed),
        skipped=tuple(skipped),
    )


def join_samples(parts: Sequence[WeightSamples]) -> WeightSamples:
    """All samples of several data sets; a group that two of them name alike stays one group.

    Raises
    ------
    ConfigurationError
        If there are no parts.
    """
    if not parts:
        raise ConfigurationError("weight samples: nothing to join")
    return WeightSamples(
        observations=tuple(seen for part in parts for seen in part.observations),
        groups=tuple(group for part in parts for group in part.groups),
        missed=tuple(berry for part in parts for berry in part.missed),
        skipped=tuple(line for part in parts for line in part.skipped),
        **{
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("grams", "occlusion", "distance", "image", "annotation")
        },
    )


def plant_of(image: AnnotatedImage) -> str:
    """Name of an image's plant: its group, or a name of its own."""
    return image.group or f"image-{image.id}"


def _missed(reason: str, image: AnnotatedImage, index: int) -> MissedBerry:
    annotation = image.annotations[index]
    return MissedBerry(
        reason, annotation.weight, plant_of(image), annotation.occlusion, image.id, annotation.id
    )


def _compact(seen: BerryObservation) -> BerryObservation:
    """The same with crops of its own, so that it does not keep the whole image in memory."""
    return replace(seen, rgb=seen.rgb.copy(), depth=seen.depth.copy(), mask=seen.mask.copy())


def _observed(image: AnnotatedImage, detector: Detector | None) -> list[tuple[int, BerryObservation | str]]:
    """(index of the annotation, what is seen of it or why nothing is) of the weighed berries of an image."""
    counted = [index for index, annotation in enumerate(image.annotations) if not annotation.crowd]
    wanted = [
        row
        for row, index in enumerate(counted)
        if image.annotations[index].class_index == PLUCKABLE and image.annotations[index].weight > 0
    ]
    if not wanted:
        return []
    frame, truth = image.frame(), image.berries()
    if truth.masks is None:
        return [(counted[row], "the annotation has no mask") for row in wanted]
    if detector is None:
        return [(counted[row], seen) for row, seen in zip(wanted, observe(frame, truth[wanted]), strict=True)]
    found = detector.detect(frame)
    matching = match_masks(Collection().add(truth, found), score=0.0, iou=LEAST_OVERLAP)
    match = matching.found_as(len(truth))
    hits = [row for row in wanted if match[row] >= 0]
    seen_as = dict(zip(hits, observe(frame, found[[int(match[row]) for row in hits]]), strict=True))
    return [(counted[row], seen_as.get(row, NOT_FOUND)) for row in wanted]
