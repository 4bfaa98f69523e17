"""A validator of COCO files that looks at the JSON as it stands, so that it can speak of files no reader accepts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from punnet.data.annotation_checks import check_annotation
from punnet.data.class_names import ClassMap, classify, same_name
from punnet.data.faults import Fault, FaultReport
from punnet.data.image_checks import Progress, check_image_entries, check_photographs, name_of
from punnet.data.raw_coco import RawCoco, category_names, open_raw_coco
from punnet.data.raw_values import Surroundings, is_whole
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS

__all__ = ["validate_coco", "validate_entries"]

NUMBERED = [str(k + 1) for k in range(len(KEYPOINTS))]


def validate_coco(
    path: str | Path | RawCoco,
    image_folder: str | Path | None = None,
    *,
    class_map: ClassMap | None = None,
    progress: Progress | None = None,
) -> FaultReport:
    """Find what is wrong with a COCO file, its photographs included; each is decoded once.

    Parameters
    ----------
    path
        The JSON, the folder that holds it, or one already opened.
    image_folder
        Where the photographs are; looked for near the file if not given.
    class_map
        What the file's class names mean.
    progress
        Called with photographs done and photographs in all.

    Raises
    ------
    FileFormatError
        If the file is missing, no JSON or not COCO at all.
    """
    raw = path if isinstance(path, RawCoco) else open_raw_coco(path, image_folder)
    photographs = check_photographs(raw, progress or (lambda done, total: None))
    entries = validate_entries(raw, class_map)
    return replace(entries, faults=(*entries.faults, *photographs))


def validate_entries(raw: RawCoco, class_map: ClassMap | None = None) -> FaultReport:
    """Find what is wrong with the entries alone; no photograph is opened."""
    faults = (*_categories(raw, class_map), *check_image_entries(raw), *_annotations(raw))
    return FaultReport(raw.path, len(raw.images), len(raw.annotations), faults)


def _categories(raw: RawCoco, class_map: ClassMap | None) -> Iterator[Fault]:
    yield from _category_entries(raw)
    if raw.is_graded:  # one class for all
        return
    for number, name in category_names(raw.data).items():
        try:
            classify(name, class_map, str(raw.path))
        except FileFormatError:
            count = sum(isinstance(a, dict) and a.get("category_id") == number for a in raw.annotations)
            if count:
                message = (
                    f"class '{name}' ({count} annotations) is neither pluckable nor unpluckable; say what it means "
                    f"when you read it, for instance --class-map '{name}=pluckable'"
                )
                yield Fault("foreign-class", message, raw.path)


def _category_entries(raw: RawCoco) -> Iterator[Fault]:
    listed = raw.data.get("categories") or []
    for entry in listed if isinstance(listed, list) else [listed]:
        if not isinstance(entry, dict) or not is_whole(entry.get("id")):
            message = f"category {entry!r:.60} has no id; each needs a whole number as id, and a name"
            yield Fault("category-field", message, raw.path)
            continue
        points = entry.get("keypoints")
        names = [same_name(str(name)) for name in points] if isinstance(points, list) else []
        if names and names != NUMBERED and sorted(names) != sorted(KEYPOINTS):
            message = (
                f"category {entry['id']} has the key-points {points!r:.80}; needed are {', '.join(KEYPOINTS)}"
            )
            yield Fault("category-field", message, raw.path)


def _annotations(raw: RawCoco) -> Iterator[Fault]:
    images = {
        image["id"]: image
        for image in raw.images
        if isinstance(image, dict) and isinstance(image.get("id"), int | str)
    }
    categories, graded = frozenset(category_names(raw.data)), raw.is_graded
    seen: set[Any] = set()
    for position, annotation in enumerate(raw.annotations):
        if not isinstance(annotation, dict):
            message, name = (
                f"entry {position + 1} of annotations is no object; remove it",
                f"number {position + 1}",
            )
            yield Fault("annotation-field", message, raw.path, annotation_id=name, position=position)
            continue
        identity, image_id = annotation.get("id"), annotation.get("image_id")
        image = images.get(image_id) if isinstance(image_id, int | str) else None
        where: dict[str, Any] = {
            "file": raw.path,
            "image_id": image_id,
            "file_name": None if image is None else name_of(image),
            "annotation_id": identity if identity is not None else f"number {position + 1}",
            "position": position,
        }
        if not is_whole(identity):
            yield Fault("annotation-field", f"id is {identity!r:.40}; a whole number is needed", **where)
        elif identity in seen:
            yield Fault(
                "duplicate-annotation-id", "another annotation has this id; give each its own", **where
            )
        else:
            seen.add(identity)
        if image is None:
            message = (
                f"image_id {image_id!r:.40} is not among the images; add the image, or remove the annotation"
            )
            yield Fault("unlisted-image", message, **where)
        around = Surroundings.of(image, categories, graded=graded)
        for code, message in check_annotation(annotation, around):
            yield Fault(code, message, **where)
