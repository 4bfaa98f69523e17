"""Masks from one data set and key-points from another of the same photographs, put together by where they lie."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS

__all__ = ["merge_by_overlap"]

PICKING_POINT = KEYPOINTS.index("picking_point")
# A key-point that lies this far outside of the outline, in √area of the berry, says nothing for it any more.
REACH = 0.5
# The picking point, alone, is looked for this far: on StrawDI it lies up to two of them above the outline.
PICKING_REACH = 4.0
LEAST_OVERLAP = 0.5
SHOWN = 5


def merge_by_overlap(instances: Dataset, keypoints: Dataset) -> Dataset:
    """Give the berries of ``instances`` the key-points of ``keypoints``.

    Photographs are matched by name. In each, a set of key-points goes to the berry whose outline holds most of it (the
    picking point, which lies above the fruit, does not count unless it is all there is); points a little outside
    count in part. One set to one berry, the best assignment of all. With the points come the ``attributes`` that the
    berry has not itself. A set that fits no berry is left out with a warning, and its id is told in
    ``extra["unmatched_keypoints"]``.

    Raises
    ------
    FileFormatError
        If no photograph is in both, or two have the same name.
    """
    by_name = _by_name(keypoints)
    unmatched = {
        annotation.id for image in keypoints for annotation in image.annotations if _has_points(annotation)
    }
    images = []
    shared = set()
    names = _names(instances)
    for name, image in zip(names, instances, strict=True):
        other = by_name.get(name)
        if other is None:
            images.append(image)
            continue
        shared.add(name)
        if other.size != image.size:
            raise FileFormatError(
                f"{image.path}: is {image.size} (H, W) with the masks, {other.size} with the key-points"
            )
        given = dict(_assign(image, other))
        unmatched -= {annotation.id for annotation in given.values()}
        images.append(
            replace(
                image,
                annotations=tuple(
                    _with_keypoints(annotation, given.get(position))
                    for position, annotation in enumerate(image.annotations)
                ),
            )
        )
    if not shared:
        raise FileFormatError(
            f"{keypoints.name}: no photograph of the key-points is among those of the masks; "
            f"the first are {', '.join([*by_name][:2]) or 'none'} and {', '.join(names[:2]) or 'none'}"
        )
    extra = dict(instances.extra)
    if unmatched:
        some = ", ".join(str(number) for number in sorted(unmatched)[:SHOWN])
        warnings.warn(
            f"{len(unmatched)} sets of key-points fit no berry and are left out, ids {some}"
            f"{' …' if len(unmatched) > SHOWN else ''}",
            stacklevel=2,
        )
        extra["unmatched_keypoints"] = sorted(unmatched)
    return replace(instances, images=tuple(images), extra=extra)


def _names(dataset: Dataset) -> list[str]:
    """Names of the photographs, or as much of their paths as tells them apart."""
    short = [image.path.name for image in dataset]
    return short if len(set(short)) == len(short) else [image.path.as_posix() for image in dataset]


def _by_name(dataset: Dataset) -> dict[str, AnnotatedImage]:
    found = dict(zip(_names(dataset), dataset, strict=True))
    if len(found) < len(dataset):
        raise FileFormatError(f"{dataset.name}: two images are of the same photograph")
    return found


def _has_points(annotation: Annotation) -> bool:
    return annotation.keypoints is not None and bool(np.isfinite(annotation.keypoints).any())


def _with_keypoints(annotation: Annotation, source: Annotation | None) -> Annotation:
    if source is None:
        return annotation
    extra = dict(annotation.extra)
    if isinstance(given := source.extra.get("attributes"), dict):
        own = extra.get("attributes")
        extra["attributes"] = given | (own if isinstance(own, dict) else {})
    return replace(annotation, keypoints=source.keypoints, visibility=source.visibility, extra=extra)


def _assign(image: AnnotatedImage, other: AnnotatedImage) -> Iterator[tuple[int, Annotation]]:
    """Position of a berry and the annotation that has its key-points."""
    # Loads slowly, hence here.
    from scipy.optimize import linear_sum_assignment

    sources = [annotation for annotation in other.annotations if _has_points(annotation)]
    if not sources or not image.annotations:
        return
    points = [_telling_points(annotation) for annotation in sources]
    overlap = np.array([[outline.overlap(*told) for told in points] for outline in _outlines(image)])
    for berry, source in zip(*linear_sum_assignment(overlap, maximize=True), strict=True):
        if overlap[berry, source] >= LEAST_OVERLAP:
            yield int(berry), sources[source]


def _telling_points(annotation: Annotation) -> tuple[NDArray[np.float64], float]:
    """Points to compare, and how far outside of an outline they may lie."""
    assert annotation.keypoints is not None
    known = np.isfinite(annotation.keypoints).all(axis=1)
    on_fruit = known & (np.arange(len(KEYPOINTS)) != PICKING_POINT)
    if on_fruit.any():
        return np.asarray(annotation.keypoints[on_fruit]), REACH
    return np.asarray(annotation.keypoints[known]), PICKING_REACH


@dataclass(frozen=True, eq=False)
class Outline:
    """A berry's mask (H, W) and the pixels (n, 2) along its edge."""

    mask: NDArray[np.bool_]
    edge: NDArray[np.float64]

    def overlap(self, points: NDArray[np.float64], reach: float) -> float:
        """0 … 1: how much of the points lies on the berry; one ``reach`` × √area away counts nothing."""
        if not len(self.edge):
            return 0.0
        height, width = self.mask.shape
        columns = np.clip(np.rint(points[:, 0]), 0, width - 1).astype(int)
        rows = np.clip(np.rint(points[:, 1]), 0, height - 1).astype(int)
        distances = np.linalg.norm(points[:, None] - self.edge[None], axis=2).min(axis=1)
        outside = np.where(self.mask[rows, columns], 0.0, distances / np.sqrt(self.mask.sum()))
        return float(np.clip(1.0 - outside / reach, 0.0, 1.0).mean())


def _outlines(image: AnnotatedImage) -> Iterator[Outline]:
    """Outline of each berry; one without a mask is its box."""
    for annotation, mask in zip(image.annotations, image.masks(image.annotations), strict=True):
        inside = mask
        if inside is None or not inside.any():
            inside = np.zeros(image.size, dtype=np.bool_)
            left, top, right, bottom = np.rint(np.clip(annotation.box, 0, max(image.size))).astype(int)
            inside[top : max(bottom, top + 1), left : max(right, left + 1)] = True
        found, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        edges = [contour.reshape(-1, 2) for contour in found]
        yield Outline(inside, np.concatenate(edges).astype(np.float64) if edges else np.zeros((0, 2)))
