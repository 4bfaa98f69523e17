"""Repair of what can be repaired in a COCO file without guessing: into a copy, each change told, the rest untouched."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.annotation_checks import check_annotation
from punnet.data.keypoint_checks import COCO_CODES
from punnet.data.raw_coco import RawCoco, category_names
from punnet.data.raw_values import EDGE_TOLERANCE, Surroundings, corners_of, is_whole, numbers_of
from punnet.data.segmentation import encode_segmentation
from punnet.errors import PunnetError
from punnet.scene import KEYPOINTS

__all__ = ["Change", "fix_coco", "rebase"]


@dataclass(frozen=True)
class Change:
    """One repair: the ``code`` of the fault that it mends, which annotation, and in words what was changed."""

    code: str
    annotation_id: Any
    message: str

    def __str__(self) -> str:
        return f"annotation {self.annotation_id!r}: {self.code}: {self.message}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {"code": self.code, "annotation_id": self.annotation_id, "message": self.message}


def fix_coco(raw: RawCoco) -> tuple[dict[str, Any], list[Change]]:
    """Repair a copy of the file's object.

    What is repaired: annotation ids given twice (the later ones get new ids), polygons of fewer than 3 points where
    others remain, polygons and boxes that leave the image (clipped), boxes that do not hold their key-points
    (expanded), v where ``visibility_detail`` says more, ``num_keypoints``, ``area``. Nothing else is touched.

    Returns
    -------
    data
        The repaired object.
    changes
        What was changed, in the order of the file.
    """
    data = copy.deepcopy(raw.data)
    changes: list[Change] = []
    images = {
        image["id"]: image
        for image in data["images"]
        if isinstance(image, dict) and isinstance(image.get("id"), int | str)
    }
    categories, graded = frozenset(category_names(data)), raw.is_graded
    annotations = [annotation for annotation in data["annotations"] if isinstance(annotation, dict)]
    _renumber(annotations, changes)
    for annotation in annotations:
        identity = annotation.get("image_id")
        image = images.get(identity) if isinstance(identity, int | str) else None
        around = Surroundings.of(image, categories, graded=graded)
        found = {code for code, _ in check_annotation(annotation, around)}
        for code, mend in _MENDERS:
            # What has no such fault is not even formatted anew.
            message = mend(annotation, around) if code in found else None
            if message is not None:
                changes.append(Change(code, annotation.get("id"), message))
                found = {code for code, _ in check_annotation(annotation, around)}
    return data, changes


def rebase(data: dict[str, Any], old: Path, images: Path, new: Path) -> dict[str, Any]:
    """Names of photographs and depth images seen from the folder ``new``, to which the file goes.

    Parameters
    ----------
    data
        A COCO object; changed in place.
    old, images
        Folder of the file, and of its photographs.
    new
        Folder that the file is written to.
    """
    sources = {"file_name": images, "depth_path": old}
    for entry in (*data["images"], *data["annotations"]):
        if not isinstance(entry, dict):
            continue
        for name, folder in sources.items():
            value = entry.get(name)
            if isinstance(value, str) and value and folder.absolute() != new.absolute():
                entry[name] = Path(os.path.relpath(folder / value, new)).as_posix()
    return data


def _renumber(annotations: list[dict[str, Any]], changes: list[Change]) -> None:
    numbers = [a["id"] for a in annotations if is_whole(a.get("id"))]
    free, seen = max(numbers, default=0) + 1, set()
    for annotation in annotations:
        identity = annotation.get("id")
        if not is_whole(identity):
            continue
        if identity in seen:
            annotation["id"] = free
            changes.append(Change("duplicate-annotation-id", free, f"its id was {identity!r}, given before"))
            free += 1
        seen.add(annotation["id"])


def _drop_short_polygons(annotation: dict[str, Any], around: Surroundings) -> str | None:
    polygons = annotation["segmentation"]
    kept = [polygon for polygon in polygons if len(polygon) >= 6]
    if not kept:
        return None
    annotation["segmentation"] = kept
    return f"dropped {len(polygons) - len(kept)} of {len(polygons)} polygons, which had fewer than 3 points"


def _clip_polygons(annotation: dict[str, Any], around: Surroundings) -> str | None:
    assert around.width is not None
    assert around.height is not None
    clipped = []
    for polygon in annotation["segmentation"]:
        corners = corners_of(polygon)
        if corners is None or not np.isfinite(corners).all():
            return None
        inside = ((corners >= 0) & (corners <= (around.width, around.height))).all()
        corners = corners if inside else _clip(corners, around.width, around.height)
        if len(corners) >= 3:
            clipped.append(polygon if inside else [round(float(value), 3) for value in corners.ravel()])
    if not clipped:
        return None
    annotation["segmentation"] = clipped
    return "clipped polygons to the image"


def _clip(corners: NDArray[np.float64], width: float, height: float) -> NDArray[np.float64]:
    """Sutherland and Hodgman's clipping of a polygon at the four edges of an image."""
    for axis, sign, limit in ((0, -1.0, 0.0), (0, 1.0, width), (1, -1.0, 0.0), (1, 1.0, height)):
        # How far beyond the edge each corner is.
        beyond = sign * (corners[:, axis] - limit)
        kept: list[NDArray[np.float64]] = []
        for i in range(len(corners)):
            before, here = corners[i - 1], corners[i]
            if (beyond[i - 1] > 0) != (beyond[i] > 0):
                crossing = before + (here - before) * beyond[i - 1] / (beyond[i - 1] - beyond[i])
                crossing[axis] = limit
                kept.append(crossing)
            if beyond[i] <= 0:
                kept.append(here)
        corners = np.array(kept).reshape(-1, 2)
    return corners


def _clip_box(annotation: dict[str, Any], around: Surroundings) -> str | None:
    assert around.width is not None
    assert around.height is not None
    box = numbers_of(annotation["bbox"], 4)
    if box is None:
        return None
    limits = np.array([around.width, around.height])
    low, high = np.clip(box[:2], 0, limits), np.clip(box[:2] + box[2:], 0, limits)
    if (high <= low).any():
        return None
    annotation["bbox"] = _as_bbox(low, high)
    return f"clipped the box to the image: {box.tolist()} → {annotation['bbox']}"


def _expand_box(annotation: dict[str, Any], around: Surroundings) -> str | None:
    box = numbers_of(annotation["bbox"], 4)
    table = np.array(annotation["keypoints"], dtype=np.float64).reshape(-1, 3)
    points = table[table[:, 2] > 0, :2]
    if box is None or (box[2:] <= 0).any():
        return None
    limits = np.array([around.width or np.inf, around.height or np.inf])
    if (points < -EDGE_TOLERANCE).any() or (points > limits + EDGE_TOLERANCE).any():
        return None  # the key-point is what is wrong
    low = np.minimum(box[:2], points.min(axis=0))
    high = np.maximum(box[:2] + box[2:], points.max(axis=0))
    annotation["bbox"] = _as_bbox(low, high)
    return f"expanded the box to hold the key-points: {box.tolist()} → {annotation['bbox']}"


def _as_bbox(low: NDArray[np.float64], high: NDArray[np.float64]) -> list[float]:
    return [round(float(value), 6) for value in (*low, *(high - low))]


def _derive_codes(annotation: dict[str, Any], around: Surroundings) -> str | None:
    detail, keypoints = annotation["visibility_detail"], annotation.get("keypoints")
    table = numbers_of(keypoints, 3 * len(KEYPOINTS))
    if table is None or not isinstance(detail, list) or len(detail) != len(KEYPOINTS):
        return None
    if not all(is_whole(code) and code in COCO_CODES for code in detail):
        return None
    given = table.reshape(-1, 3)[:, 2]
    if any((code > 0) != (v > 0) for code, v in zip(detail, given, strict=True)):
        return None  # whether the point exists at all is not for us to say
    annotation["keypoints"] = [
        COCO_CODES[detail[k // 3]] if k % 3 == 2 else value for k, value in enumerate(keypoints or [])
    ]
    return f"v taken from visibility_detail {detail}"


def _count_keypoints(annotation: dict[str, Any], around: Surroundings) -> str | None:
    before = annotation["num_keypoints"]
    annotation["num_keypoints"] = sum(v > 0 for v in annotation["keypoints"][2::3])
    return f"num_keypoints {before!r} → {annotation['num_keypoints']}"


def _measure_area(annotation: dict[str, Any], around: Surroundings) -> str | None:
    if around.width is None or around.height is None:
        return None
    size = (int(around.height), int(around.width))
    try:
        _, area = encode_segmentation(annotation["segmentation"], size)
    except PunnetError:
        return None
    before, annotation["area"] = annotation.get("area"), area
    return f"area {before!r} → {area!r}"


# In this order: what comes later measures what came before.
_MENDERS: tuple[tuple[str, Callable[[dict[str, Any], Surroundings], str | None]], ...] = (
    ("visibility-contradiction", _derive_codes),
    ("keypoint-total", _count_keypoints),
    ("short-polygon", _drop_short_polygons),
    ("polygon-outside-image", _clip_polygons),
    ("box-outside-image", _clip_box),
    ("keypoint-outside-box", _expand_box),
    ("area-mismatch", _measure_area),
)
