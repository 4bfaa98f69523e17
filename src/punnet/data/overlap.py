"""Masks from one data set and key-points from another of the same photographs, put together by where they lie."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS

__all__ = ["merge_by_overlap"]

PICKING_POINT = KEYPOINTS.index("picking_point")
# A key-point that lies this far outside of the outline, in √area of the berry, says nothing for it any more.
REACH = 0.5
LEAST_OVERLAP = 0.5
SHOWN = 5


def merge_by_overlap(instances: Dataset, keypoints: Dataset) -> Dataset:
    """Give the berries of ``instances`` the key-points of ``keypoints``.

    Photographs are matched by name. In each, a set of key-points goes to the berry whose outline holds most of it (the
    picking point, which lies above the fruit, does not count unless it is all there is); points a little outside
    count in part. One set to one berry, the best assignment of all. A set that fits no berry is left out with a
    warning, and its id is told in ``extra["unmatched_keypoints"]``.

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
    return replace(annotation, keypoints=source.keypoints, visibility=source.visibility)


def _assign(image: AnnotatedImage, other: AnnotatedImage) -> Iterator[tuple[int, Annotation]]:
    """Position of a berry and the annotation that has its key-points."""
    sources = [annotation for annotation in other.annotations if _has_points(annotation)]
    if not sources or not image.annotations:
        return
    points = [_telling_points(annotation) for annotation in sources]
    overlap = np.array([[_overlap(distances, p) for p in points] for distances in _distances(image)])
    for berry, source in zip(*linear_sum_assignment(overlap, maximize=True), strict=True):
        if overlap[berry, source] >= LEAST_OVERLAP:
            yield int(berry), sources[source]


def _telling_points(annotation: Annotation) -> NDArray[np.float64]:
    assert annotation.keypoints is not None
    known = np.isfinite(annotation.keypoints).all(axis=1)
    on_fruit = known & (np.arange(len(KEYPOINTS)) != PICKING_POINT)
    return np.asarray(annotation.keypoints[on_fruit if on_fruit.any() else known])


def _distances(image: AnnotatedImage) -> Iterator[NDArray[np.float32]]:
    """(H, W) distance from each berry, in √area of it; a berry without a mask is its box."""
    for annotation, mask in zip(image.annotations, image.masks(image.annotations), strict=True):
        inside = mask
        if inside is None or not inside.any():
            inside = np.zeros(image.size, dtype=np.bool_)
            left, top, right, bottom = np.rint(annotation.box).astype(int)
            inside[max(top, 0) : max(bottom, 1), max(left, 0) : max(right, 1)] = True
        if not inside.any():
            yield np.full(image.size, np.inf, dtype=np.float32)
            continue
        outside = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        yield np.asarray(outside / np.sqrt(inside.sum()), dtype=np.float32)


def _overlap(distances: NDArray[np.float32], points: NDArray[np.float64]) -> float:
    """0 … 1: how much of the points lies on the berry; one at the reach's end counts nothing."""
    height, width = distances.shape
    columns = np.clip(np.rint(points[:, 0]), 0, width - 1).astype(int)
    rows = np.clip(np.rint(points[:, 1]), 0, height - 1).astype(int)
    return float(np.clip(1.0 - distances[rows, columns] / REACH, 0.0, 1.0).mean())
