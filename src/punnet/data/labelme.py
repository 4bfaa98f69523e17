"""LabelMe: one JSON a photograph; key-points are points that share a ``group_id`` with their berry's outline."""

from __future__ import annotations

import base64
import binascii
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.data.assembling import FoundBerry, FoundImage, assemble
from punnet.data.class_names import ClassMap, classify, same_name
from punnet.data.dataset import Dataset
from punnet.data.reading import beside, image_size, integer, number, read_json, require_object
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS, Visibility
from punnet.scene.masks import MOST_PIXELS, encode_mask

__all__ = ["is_labelme", "read_labelme"]

CORNERS_OF_A_CIRCLE = 32
# Flags of a point, as people name them.
HIDDEN_FLAGS = {
    "hidden_by_other": Visibility.HIDDEN_BY_OTHER,
    "hidden_by_itself": Visibility.HIDDEN_BY_ITSELF,
    "occluded": Visibility.HIDDEN_BY_ITSELF,
    "hidden": Visibility.HIDDEN_BY_ITSELF,
}
Shape = tuple[dict[str, Any], str]
"""The JSON object, and its place for messages."""


def read_labelme(path: str | Path, *, class_map: ClassMap | None = None) -> Dataset:
    """Read a LabelMe file, or all of a folder.

    Outlines (polygon, circle, mask) with the same ``group_id`` and label are parts of one berry; a rectangle is a box
    without a mask. Points labelled with the names of the five key-points belong to the outline of their ``group_id``;
    they are visible unless a flag ``occluded``, ``hidden``, ``hidden_by_itself`` or ``hidden_by_other`` is set.

    Parameters
    ----------
    path
        A JSON file or a folder of them.
    class_map
        What labels mean that are not known here.

    Raises
    ------
    FileFormatError
        If a file is missing, damaged, a label is not known or a key-point belongs to no outline.
    """
    path = Path(path)
    files = sorted(path.glob("*.json")) if path.is_dir() else [path]
    if not files:
        raise FileFormatError(f"{path}: no JSON files of LabelMe in this folder")
    return assemble((_read_file(file, class_map) for file in files), path.stem)


def is_labelme(path: Path) -> bool:
    """Whether a file, or the first JSON of a folder, is LabelMe's."""
    file = min(path.glob("*.json"), default=None) if path.is_dir() else path
    if file is None or file.suffix.lower() != ".json":
        return False
    data = read_json(file)
    return isinstance(data, dict) and isinstance(data.get("shapes"), list) and "imagePath" in data


def _read_file(file: Path, class_map: ClassMap | None) -> FoundImage:
    data = require_object(read_json(file), str(file))
    if not isinstance(data.get("shapes"), list):
        raise FileFormatError(f"{file}: not LabelMe's; a list 'shapes' is needed")
    photograph = beside(file.parent, data.get("imagePath"), f"{file}: imagePath")
    if data.get("imageHeight") is None or data.get("imageWidth") is None:
        height, width = image_size(photograph)
    else:
        height = integer(data["imageHeight"], f"{file}: imageHeight")
        width = integer(data["imageWidth"], f"{file}: imageWidth")
    if height < 1 or width < 1 or height * width > MOST_PIXELS:
        raise FileFormatError(f"{file}: size {width}×{height} is not possible")
    outlines: dict[Any, list[Shape]] = {}
    points: dict[Any, list[Shape]] = {}
    for position, entry in enumerate(data["shapes"]):
        where = f"{file}: shape {position}"
        shape = require_object(entry, where)
        group = shape.get("group_id")
        if not isinstance(group, int | str | None):
            raise FileFormatError(f"{where}: group_id must be a number, got {group!r:.40}")
        if shape.get("shape_type") == "point":
            points.setdefault(group, []).append((shape, where))
        else:
            key = position if group is None else (group, str(shape.get("label")))
            outlines.setdefault(key, []).append((shape, where))
    berries = _berries(outlines, points, (height, width), class_map)
    extra = {name: data[name] for name in ("flags",) if data.get(name)}
    return FoundImage(photograph, width, height, berries, str(file), extra)


def _berries(
    outlines: dict[Any, list[Shape]],
    points: dict[Any, list[Shape]],
    size: tuple[int, int],
    class_map: ClassMap | None,
) -> list[FoundBerry]:
    berries = []
    ignored = set()
    for key, shapes in outlines.items():
        first, where = shapes[0]
        group = key[0] if isinstance(key, tuple) else None
        class_index = classify(str(first.get("label")), class_map, where)
        if class_index is None:
            ignored.add(group)
            continue
        belonging = points.pop(group, []) if group is not None else []
        fields = {"category_name": first["label"], **_outline(shapes, size)}
        if belonging:
            fields |= _keypoints(belonging)
        for name in ("flags", "description"):
            if first.get(name):
                fields[name] = first[name]
        berries.append(FoundBerry(class_index, fields, where))
    for group, shapes in points.items():
        shape, where = shapes[0]
        if group is not None and group in ignored:
            continue
        # A point may mark anything else; only those named like ours must belong to a berry.
        if same_name(str(shape.get("label"))) in KEYPOINTS:
            raise FileFormatError(
                f"{where}: key-point '{shape.get('label')}' belongs to no outline; give both the same group_id"
            )
    return berries


def _keypoints(shapes: list[Shape]) -> dict[str, Any]:
    table, codes = [0.0] * (3 * len(KEYPOINTS)), [0] * len(KEYPOINTS)
    for shape, where in shapes:
        name = same_name(str(shape.get("label")))
        if name not in KEYPOINTS:
            raise FileFormatError(
                f"{where}: point '{shape.get('label')}' is none of the key-points {', '.join(KEYPOINTS)}"
            )
        k = KEYPOINTS.index(name)
        if codes[k]:
            raise FileFormatError(f"{where}: key-point '{name}' is given twice for this berry")
        flags = shape.get("flags") if isinstance(shape.get("flags"), dict) else {}
        hidden = [
            HIDDEN_FLAGS[same_name(flag)]
            for flag, state in (flags or {}).items()
            if state and same_name(flag) in HIDDEN_FLAGS
        ]
        codes[k] = int(hidden[0]) if hidden else int(Visibility.VISIBLE)
        ((u, v),) = _corners(shape, where, 1)
        table[3 * k : 3 * k + 3] = [u, v, min(codes[k], 2) if codes[k] != Visibility.HIDDEN_BY_OTHER else 1]
    return {"keypoints": table, "visibility_detail": codes}


def _outline(shapes: list[Shape], size: tuple[int, int]) -> dict[str, Any]:
    """Box, polygons or run lengths, as COCO has them, of the parts of one berry."""
    kinds = {str(shape.get("shape_type") or "polygon") for shape, _ in shapes}
    if "rectangle" in kinds and len(shapes) == 1:
        return {"bbox": _box(*shapes[0])}
    if "mask" not in kinds and "rectangle" not in kinds:
        return {"segmentation": [_polygon(shape, where) for shape, where in shapes]}
    if kinds != {"mask"}:
        raise FileFormatError(
            f"{shapes[0][1]}: {', '.join(sorted(kinds))} in one group; a berry is polygons and circles, masks, or one "
            "rectangle"
        )
    whole = np.zeros(size, dtype=np.bool_)
    for shape, where in shapes:
        _paste(shape, where, whole)
    return {"segmentation": encode_mask(whole)}


def _box(shape: dict[str, Any], where: str) -> list[float]:
    """x, y, width, height of two opposite corners, or of all four."""
    corners = _corners(shape, where, None)
    if len(corners) not in (2, 4):
        raise FileFormatError(f"{where}: a rectangle has two corners or four, got {len(corners)}")
    us, vs = zip(*corners, strict=True)
    return [min(us), min(vs), max(us) - min(us), max(vs) - min(vs)]


def _paste(shape: dict[str, Any], where: str, whole: np.ndarray[Any, np.dtype[np.bool_]]) -> None:
    (left, top), (right, bottom) = _corners(shape, where, 2)
    try:
        encoded = np.frombuffer(base64.b64decode(shape.get("mask") or "", validate=True), dtype=np.uint8)
    except (binascii.Error, ValueError, TypeError) as error:
        raise FileFormatError(f"{where}: the mask is no base64 text ({error})") from error
    mask = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE) if encoded.size else None
    if mask is None:
        raise FileFormatError(f"{where}: the mask is no PNG")
    u, v = round(left), round(top)
    height, width = mask.shape
    # LabelMe counts the far corner as inside, older versions as outside.
    if u < 0 or v < 0 or abs(round(right) - u - width) > 1 or abs(round(bottom) - v - height) > 1:
        raise FileFormatError(f"{where}: the mask is {width}×{height}, its corners say otherwise")
    part = whole[v : v + height, u : u + width]
    part |= mask[: part.shape[0], : part.shape[1]] > 0


def _polygon(shape: dict[str, Any], where: str) -> list[float]:
    kind = shape.get("shape_type") or "polygon"
    if kind == "polygon":
        return [value for corner in _corners(shape, where, None) for value in corner]
    if kind == "circle":
        (u, v), (edge_u, edge_v) = _corners(shape, where, 2)
        radius = math.hypot(edge_u - u, edge_v - v)
        angles = np.linspace(0.0, 2 * math.pi, CORNERS_OF_A_CIRCLE, endpoint=False)
        corners: list[float] = (
            np.column_stack((u + radius * np.cos(angles), v + radius * np.sin(angles))).ravel().tolist()
        )
        return corners
    raise FileFormatError(
        f"{where}: shape_type {kind!r:.40} is no outline; polygon, rectangle, circle, mask are"
    )


def _corners(shape: dict[str, Any], where: str, count: int | None) -> list[tuple[float, float]]:
    given = shape.get("points")
    if not isinstance(given, list) or (count is not None and len(given) != count):
        raise FileFormatError(f"{where}: {count or 'a list of'} points are needed")
    corners = []
    for point in given:
        if not isinstance(point, list) or len(point) != 2:
            raise FileFormatError(f"{where}: a point must be [x, y], got {point!r:.40}")
        corners.append((number(point[0], f"{where}: x"), number(point[1], f"{where}: y")))
    return corners
