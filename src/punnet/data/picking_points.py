"""Per-image JSON in the shape of Detectron2's dictionaries, as the strawberry picking-point data set publishes it.

Each file, or each element of a list, describes one photograph: ``file_name``, ``height``, ``width``, ``image_id`` and
``annotations`` with ``bbox`` and ``bbox_mode`` (XYXY where it is not said), ``category_id``, ``keypoints`` and perhaps
``segmentation``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from punnet.data.assembling import FoundBerry, FoundImage, assemble
from punnet.data.class_names import ClassMap, classify, same_name
from punnet.data.dataset import Dataset
from punnet.data.reading import (
    IMAGE_SUFFIXES,
    beside,
    find_image_folder,
    image_size,
    integer,
    number,
    numbers,
    read_json,
    require_object,
)
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS, Visibility

__all__ = ["is_picking_points", "read_picking_points"]

# Detectron2's BoxMode, by name and number.
BOX_MODES = {"XYXY_ABS": 0, "XYWH_ABS": 1, "XYXY_REL": 2, "XYWH_REL": 3}
# The first that holds text names the class.
NAME_FIELDS = ("category", "category_name", "class", "label", "ripeness")
BERRY_FIELDS = ("bbox", "bbox_mode", "category_id", "category", "keypoints", "segmentation", "iscrowd")
IMAGE_FIELDS = ("file_name", "height", "width", "annotations")


def read_picking_points(
    path: str | Path, image_folder: str | Path | None = None, *, class_map: ClassMap | None = None
) -> Dataset:
    """Read a folder of such JSON files, or one file with one photograph or a list of them.

    The class is a name in ``category``, ``class``, ``label`` or ``ripeness``, or else ``category_id``, of which the
    files do not say what it means: the class map has to, as ``{"0": "pluckable", "1": "unpluckable"}``. Key-points are
    15 numbers or five triples; of pairs without visibility, negative or zero ones are absent. Where sizes are not said
    the photographs are opened.

    Raises
    ------
    FileFormatError
        If a file is missing, damaged, or a class not known.
    """
    path = Path(path)
    files = sorted(path.rglob("*.json")) if path.is_dir() else [path]
    if not files:
        raise FileFormatError(f"{path}: no JSON files in this folder")
    records = [record for file in files for record in _records(file)]
    if image_folder is None:
        names = [name for record, file, _ in records for name in _likely_names(record, file)]
        image_folder = find_image_folder(path if path.is_dir() else path.parent, names)
    folder = Path(image_folder)
    return assemble(
        (_photograph(record, file, where, folder, class_map) for record, file, where in records), path.stem
    )


def is_picking_points(path: Path) -> bool:
    """Whether a file, or the first JSON in a folder, describes photographs this way."""
    file = min(path.rglob("*.json"), default=None) if path.is_dir() else path
    if file is None or file.suffix.lower() != ".json":
        return False
    data = read_json(file)
    first = data[0] if isinstance(data, list) and data else data
    return isinstance(first, dict) and isinstance(first.get("annotations"), list) and "images" not in first


def _records(file: Path) -> Iterator[tuple[dict[str, Any], Path, str]]:
    data = read_json(file)
    for position, record in enumerate(data if isinstance(data, list) else [data]):
        where = f"{file}: entry {position}" if isinstance(data, list) else str(file)
        if not isinstance(require_object(record, where).get("annotations"), list):
            raise FileFormatError(f"{where}: a list 'annotations' is needed")
        yield record, file, where


def _photograph(
    record: dict[str, Any], file: Path, where: str, folder: Path, class_map: ClassMap | None
) -> FoundImage:
    photograph = _photograph_path(record, file, where, folder)
    if record.get("height") is None or record.get("width") is None:
        height, width = image_size(photograph)
    else:
        height, width = (integer(record[name], f"{where}: {name}") for name in ("height", "width"))
    berries = []
    for position, entry in enumerate(record["annotations"]):
        place = f"{where}: annotation {position}"
        berry = _berry(require_object(entry, place), (height, width), place, class_map)
        if berry is not None:
            berries.append(berry)
    extra = {name: value for name, value in record.items() if name not in IMAGE_FIELDS}
    return FoundImage(photograph, width, height, berries, where, extra)


def _likely_names(record: dict[str, Any], file: Path) -> list[str]:
    """What the photograph may be called: as the file says, without its folders, or like the file itself."""
    name = record.get("file_name")
    if not isinstance(name, str) or not name or "\0" in name:
        return [f"{file.stem}{suffix}" for suffix in (".png", ".jpg", *IMAGE_SUFFIXES)]
    posix = name.replace("\\", "/")
    return [posix, posix.rpartition("/")[2] or posix]


def _photograph_path(record: dict[str, Any], file: Path, where: str, folder: Path) -> Path:
    if record.get("file_name") is None:
        # The file is named like its photograph.
        candidates = [folder / f"{file.stem}{suffix}" for suffix in IMAGE_SUFFIXES]
        return next((path for path in candidates if path.is_file()), folder / f"{file.stem}.png")
    path = beside(folder, record["file_name"], f"{where}: file_name")
    # Paths of the annotators' own machine: the name is what is left of them.
    return path if path.is_file() or not (folder / path.name).is_file() else folder / path.name


def _berry(
    entry: dict[str, Any], size: tuple[int, int], where: str, class_map: ClassMap | None
) -> FoundBerry | None:
    name = next((entry[field] for field in NAME_FIELDS if isinstance(entry.get(field), str)), None)
    if name is not None:
        class_index = classify(name, class_map, where)
    else:
        index = str(integer(entry.get("category_id"), f"{where}: category_id"))
        class_index = classify(index, class_map, where)
    if class_index is None:
        return None
    fields = {field: value for field, value in entry.items() if field not in BERRY_FIELDS}
    if name is not None:
        fields["category_name"] = name
    if isinstance(entry.get("ripeness"), str):  # ours is a number
        del fields["ripeness"]
    fields |= {"bbox": _box(entry, size, where), "iscrowd": entry.get("iscrowd", 0)}
    if entry.get("segmentation"):
        fields["segmentation"] = entry["segmentation"]
    if entry.get("keypoints"):
        fields |= _keypoints(entry["keypoints"], where)
    return FoundBerry(class_index, fields, where)


def _box(entry: dict[str, Any], size: tuple[int, int], where: str) -> list[float] | None:
    if entry.get("bbox") is None and entry.get("segmentation"):
        return None
    a, b, c, d = numbers(entry.get("bbox"), 4, f"{where}: bbox")
    mode = _box_mode(entry.get("bbox_mode", 0), where)
    if mode in (BOX_MODES["XYXY_REL"], BOX_MODES["XYWH_REL"]):
        height, width = size
        a, b, c, d = a * width, b * height, c * width, d * height
    if mode in (BOX_MODES["XYWH_ABS"], BOX_MODES["XYWH_REL"]):
        return [a, b, c, d]
    if c < a or d < b:
        raise FileFormatError(
            f"{where}: bbox {entry['bbox']} is no x0, y0, x1, y1; if it is x, y, width, height, bbox_mode must be 1"
        )
    return [a, b, c - a, d - b]


def _box_mode(given: Any, where: str) -> int:
    """Number of a mode: 0, ``"XYXY_ABS"``, ``"BoxMode.XYXY_ABS"`` or ``"<BoxMode.XYXY_ABS: 0>"``."""
    if isinstance(given, str):
        named = re.search("|".join(BOX_MODES), given.upper())
        if named:
            return BOX_MODES[named[0]]
    mode = integer(given, f"{where}: bbox_mode") if not isinstance(given, dict | list) else -1
    if mode not in BOX_MODES.values():
        raise FileFormatError(f"{where}: bbox_mode {given!r:.40} is none of {', '.join(BOX_MODES)}")
    return mode


def _keypoints(given: Any, where: str) -> dict[str, Any]:
    where = f"{where}: keypoints"
    if isinstance(given, dict):
        given = [_named(given, name, where) for name in KEYPOINTS]
    if not isinstance(given, list):
        raise FileFormatError(f"{where}: a list is needed, got {given!r:.40}")
    flat = [v for point in given for v in (point if isinstance(point, list) else [point])]
    if len(flat) not in (2 * len(KEYPOINTS), 3 * len(KEYPOINTS)):
        raise FileFormatError(
            f"{where}: {len(KEYPOINTS)} points of x, y and visibility are needed, got {len(flat)} numbers"
        )
    step = len(flat) // len(KEYPOINTS)
    table: list[float] = []
    codes = []
    for k in range(len(KEYPOINTS)):
        point = [number(value, where) for value in flat[step * k : step * (k + 1)]]
        marked = point[0] > 0 or point[1] > 0
        code = integer(point[2], where) if step == len("xyv") else int(Visibility.VISIBLE if marked else 0)
        if code not in tuple(Visibility):
            raise FileFormatError(f"{where}: visibility must be 0 … 3, got {code}")
        codes.append(code)
        table += [*point[:2], 1 if code == Visibility.HIDDEN_BY_OTHER else code]
    # As in COCO, none at all means that nobody marked them.
    return {"keypoints": table, "visibility_detail": codes} if any(codes) else {}


def _named(given: dict[str, Any], name: str, where: str) -> list[Any]:
    found = {same_name(key): value for key, value in given.items()}.get(name)
    if found is None:
        return [0, 0, 0]
    if not isinstance(found, list) or len(found) not in (2, 3):
        raise FileFormatError(f"{where}: '{name}' must be [x, y] or [x, y, visibility], got {found!r:.40}")
    return found if len(found) == len("xyv") else [*found, int(Visibility.VISIBLE)]
