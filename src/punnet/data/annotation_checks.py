"""What can be wrong with one annotation of a COCO file, looked at as it stands in the JSON.

Each check takes the raw annotation and what is known about its image and yields (code, message). Nothing here raises
over what it reads: a file that no reader accepts is the one that needs checking most.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import STAGES
from punnet.data.keypoint_checks import check_keypoints
from punnet.data.raw_values import (
    EDGE_TOLERANCE,
    Finding,
    Surroundings,
    corners_of,
    is_number,
    is_whole,
    lacks_number,
    numbers_of,
)
from punnet.errors import FileFormatError
from punnet.scene.masks import run_lengths

__all__ = ["AREA_TOLERANCE", "check_annotation"]

AREA_TOLERANCE = 0.05
"""Share by which ``area`` may differ from the mask's; a dozen pixels are always allowed."""

FEW_PIXELS = 12.0
FARTHEST = 1e5
LARGEST_CANVAS = 50_000_000
HEAVIEST = 1000.0
SHARES = ("ripeness", "occlusion", "score")


def check_annotation(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    """Yield (code, message) of each fault of one annotation."""
    yield from _class(annotation, around)
    if bad := sorted(name for name, value in annotation.items() if lacks_number(value)):
        yield "not-finite", f"NaN or infinity in {', '.join(bad)}; give numbers, or leave the field out"
    yield from _ranges(annotation, around)
    yield from _box(annotation, around)
    yield from _segmentation(annotation, around)
    yield from check_keypoints(annotation, around)


def _class(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    category = annotation.get("category_id")
    if not is_whole(category):
        yield "annotation-field", f"category_id is {category!r}; the number of a category is needed"
    elif category not in around.categories:
        known = ", ".join(map(str, sorted(around.categories, key=str))) or "none"
        yield (
            "unknown-class",
            f"category_id {category} is not in the file's categories ({known}); add it, or correct it",
        )


def _ranges(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    for name in SHARES:
        if around.graded and name == "ripeness":
            continue
        value = annotation.get(name)
        if value is not None and not lacks_number(value) and not (is_number(value) and 0 <= value <= 1):
            yield "out-of-range", f"{name} is {value!r:.40}; it must be a number from 0 to 1"
    weight = annotation.get("weight_g")
    if weight is not None and not lacks_number(weight) and not (is_number(weight) and 0 < weight < HEAVIEST):
        yield "out-of-range", f"weight_g is {weight!r:.40}; grams of one berry are needed, 0 to {HEAVIEST:g}"
    crowd = annotation.get("iscrowd")
    if crowd not in (None, 0, 1):
        yield "annotation-field", f"iscrowd is {crowd!r:.40}; it must be 0 or 1"
    stage = annotation.get("stage")
    if stage is not None and stage not in STAGES:
        yield "out-of-range", f"stage is {stage!r:.40}; known: {', '.join(STAGES)}"


def _box(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    if "bbox" not in annotation:
        yield "bad-box", "bbox is missing; [x, y, width, height] is needed"
        return
    box = numbers_of(annotation["bbox"], 4)
    if box is None:
        if lacks_number(annotation["bbox"]):
            return
        yield "bad-box", f"bbox is {annotation['bbox']!r:.60}; four numbers [x, y, width, height] are needed"
        return
    left, top, width, height = box
    if width <= 0 or height <= 0:
        yield (
            "empty-box",
            f"the box is {width:g} wide and {height:g} high; draw it again, or remove the annotation",
        )
        return
    if around.width is None or around.height is None:
        return
    beyond = max(-left, -top, left + width - around.width, top + height - around.height)
    if beyond > EDGE_TOLERANCE:
        yield (
            "box-outside-image",
            f"the box reaches {beyond:.1f} px out of the {around.width:g}×{around.height:g} image; clip it",
        )


def _segmentation(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    segmentation = annotation.get("segmentation")
    if segmentation is None or segmentation == []:
        return
    if isinstance(segmentation, dict):
        yield from _run_lengths(annotation, segmentation, around)
    elif isinstance(segmentation, list):
        yield from _polygons(annotation, segmentation, around)
    else:
        yield (
            "bad-polygon",
            f"segmentation is {segmentation!r:.40}; polygons [[x, y, …]] or run lengths are needed",
        )


def _run_lengths(annotation: dict[str, Any], rle: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    size = numbers_of(rle.get("size"), 2)
    if size is None:
        yield "bad-rle", "the run lengths have no size [height, width]; export the mask again"
        return
    if (
        around.height is not None
        and around.width is not None
        and (size[0], size[1]) != (around.height, around.width)
    ):
        yield (
            "rle-size",
            f"the mask is {size[1]:g}×{size[0]:g} (width×height), the image {around.width:g}×{around.height:g}; "
            "export the mask again at the image's size",
        )
        return
    try:
        _, counts = run_lengths(rle)
    except FileFormatError as error:
        yield "bad-rle", f"{error}; export the mask again"
        return
    pixels = int(counts[1::2].sum())
    if pixels == 0:
        yield "empty-mask", "the mask has no pixel; draw it again, or leave segmentation out"
    else:
        yield from _area(annotation, [float(pixels)])


def _polygons(annotation: dict[str, Any], polygons: list[Any], around: Surroundings) -> Iterator[Finding]:
    points: list[NDArray[np.float64]] = []
    for number, polygon in enumerate(polygons, start=1):
        which = "the polygon" if len(polygons) == 1 else f"polygon {number} of {len(polygons)}"
        corners = corners_of(polygon)
        if corners is None:
            yield "bad-polygon", f"{which} is {polygon!r:.40}; a flat list of numbers x, y, x, y, … is needed"
            return
        if len(corners) < 3:
            count = f"{len(corners)} point{'' if len(corners) == 1 else 's'}"
            yield "short-polygon", f"{which} has {count}; at least 3 are needed: remove it or draw it again"
            continue
        points.append(corners)
        if around.width is None or around.height is None or not np.isfinite(corners).all():
            continue
        limits = np.array([around.width, around.height])
        beyond = float(max((-corners).max(), (corners - limits).max()))
        if beyond > EDGE_TOLERANCE:
            yield "polygon-outside-image", f"{which} reaches {beyond:.1f} px out of the image; clip it"
    if points and all((np.abs(corners) < FARTHEST).all() for corners in points):
        areas = [abs(float(cv2.contourArea(corners.astype(np.float32)))) for corners in points]
        if sum(areas) <= 0:
            yield "empty-mask", "the polygons enclose no area; draw them again, or leave segmentation out"
        elif len(points) == len(polygons):
            pixels = _rasterised(points)
            yield from _area(annotation, [sum(areas)] if pixels is None else [sum(areas), pixels])


def _rasterised(points: list[NDArray[np.float64]]) -> float | None:
    """Pixels of a union of polygons, boundaries included; None if that would take too much memory."""
    corners = np.vstack(points)
    low = np.floor(corners.min(axis=0)) - 1
    extent = np.ceil(corners.max(axis=0) - low + 2).astype(int)
    if extent.prod() > LARGEST_CANVAS:
        return None
    canvas = np.zeros((extent[1], extent[0]), dtype=np.uint8)
    for polygon in points:
        cv2.fillPoly(canvas, [np.rint(polygon - low).astype(np.int32)], 1)
    return float(np.count_nonzero(canvas))


def _area(annotation: dict[str, Any], measured: list[float]) -> Iterator[Finding]:
    """Compare ``area``; tools count a polygon's by its corners or by its pixels, so either will do, or between."""
    area = annotation.get("area")
    if not is_number(area):
        if "area" not in annotation:
            yield "area-mismatch", f"area is missing; the mask's is {measured[0]:.0f}"
        return
    slack = max(FEW_PIXELS, AREA_TOLERANCE * max(measured))
    if not min(measured) - slack <= annotation["area"] <= max(measured) + slack:
        yield "area-mismatch", f"area is {area:g}, the mask's is {measured[0]:.0f}; correct it"
