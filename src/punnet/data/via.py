"""VGG Image Annotator: its CSV, its JSON and its project files, with ripeness as a region's attribute."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.assembling import FoundBerry, FoundImage, assemble
from punnet.data.class_names import ClassMap, classify, same_name
from punnet.data.dataset import STAGES, Dataset
from punnet.data.psd import PLUCKABLE_RIPENESS, psd_fields
from punnet.data.reading import (
    beside,
    find_image_folder,
    image_size,
    integer,
    number,
    read_json,
    read_text,
    require_object,
)
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

__all__ = ["is_via", "read_via"]

CSV_FIELDS = ("filename", "region_shape_attributes", "region_attributes")
# Attributes that may hold one of PSD's codes 0 … 4, and those that may name a class, the first that is given.
CODE_ATTRIBUTES = ("degree_of_ripeness", "ripeness")
HARDNESS_ATTRIBUTE = "hardness_of_picking"
NAME_ATTRIBUTES = ("class", "label", "ripeness", "degree_of_ripeness", "stage", "type", "name", "category")
CODES = ("0", "1", "2", "3", "4")
CORNERS_OF_A_CURVE = 32


@dataclass(frozen=True)
class Region:
    """A shape and what was said of it, of the photograph ``file_name``; ``where`` is for messages."""

    file_name: str
    shape: dict[str, Any]
    attributes: dict[str, Any]
    where: str


def read_via(
    path: str | Path, image_folder: str | Path | None = None, *, class_map: ClassMap | None = None
) -> Dataset:
    """Read a VIA file; polygons, circles and ellipses are outlines, rectangles boxes without a mask.

    The class is in an attribute of the region: ``Degree of Ripeness`` or ``ripeness`` with PSD's codes (2 and 3 are
    pluckable), or else a name in class, label, ripeness, stage, type, name or category. VIA does not keep image sizes,
    so the photographs are opened.

    Parameters
    ----------
    path
        CSV or JSON; the latter as an export or a project.
    image_folder
        Folder of the photographs; looked for beside the file if None.
    class_map
        What names, or codes, mean that are not known here.

    Raises
    ------
    FileFormatError
        If the file or a photograph is missing, damaged, or a class not known.
    """
    path = Path(path)
    listed = _csv_regions(path) if path.suffix.lower() == ".csv" else _json_regions(path)
    photographs: dict[str, list[Region]] = {}
    for file_name, region in listed:
        regions = photographs.setdefault(file_name, [])
        if region is not None:
            regions.append(region)
    folder = Path(image_folder) if image_folder is not None else find_image_folder(path.parent, photographs)
    return assemble(
        (_photograph(path, folder, name, regions, class_map) for name, regions in photographs.items()),
        path.stem,
    )


def is_via(path: Path) -> bool:
    """Whether a file is VIA's, by its first line (CSV) or its fields (JSON)."""
    if path.suffix.lower() == ".csv":
        header = read_text(path).partition("\n")[0]
        return all(name in header for name in CSV_FIELDS)
    if path.suffix.lower() != ".json":
        return False
    data = read_json(path)
    if not isinstance(data, dict):
        return False
    first = next(iter(data.values()), None)
    return "_via_img_metadata" in data or (isinstance(first, dict) and "regions" in first)


def _photograph(
    file: Path, folder: Path, name: str, regions: list[Region], class_map: ClassMap | None
) -> FoundImage:
    photograph = beside(folder, name, str(file))
    height, width = image_size(photograph)
    berries = []
    for region in regions:
        found = _class_of(region, class_map)
        if found is None:
            continue
        class_index, fields = found
        fields |= {**_outline(region.shape, region.where), "via_attributes": region.attributes}
        berries.append(FoundBerry(class_index, fields, region.where))
    return FoundImage(photograph, width, height, berries, f"{file}: {name}")


def _class_of(region: Region, class_map: ClassMap | None) -> tuple[int, dict[str, Any]] | None:
    """Class and what else ripeness tells; None to leave the region out."""
    said = {same_name(name): _value(value) for name, value in region.attributes.items()}
    code = next((said[key] for key in CODE_ATTRIBUTES if said.get(key, "").isdecimal()), None)
    if code is not None:
        hardness = said.get(HARDNESS_ATTRIBUTE) or None
        known = None if hardness is None else integer(hardness, f"{region.where}: Hardness of Picking")
        fields = psd_fields(integer(code, f"{region.where}: ripeness"), known, region.where)
        if code not in {same_name(given) for given in class_map or {}}:
            return (PLUCKABLE if int(code) in PLUCKABLE_RIPENESS else UNPLUCKABLE), fields
        name = code
    else:
        found = next((said[key] for key in NAME_ATTRIBUTES if said.get(key)), None)
        if found is None:
            raise FileFormatError(
                f"{region.where}: nothing tells its class; one of the attributes Degree of Ripeness, "
                f"{', '.join(NAME_ATTRIBUTES)} is needed"
            )
        name = found
        fields = {"stage": same_name(name)} if same_name(name) in STAGES else {}
    class_index = classify(name, class_map, region.where)
    return None if class_index is None else (class_index, fields)


def _value(value: Any) -> str:
    """An attribute as text; of a group of check boxes, the one that is ticked."""
    if isinstance(value, dict):
        ticked = [str(name) for name, state in value.items() if state is True]
        return ticked[0] if len(ticked) == 1 else ""
    return "" if value is None else str(value).strip()


def _outline(shape: dict[str, Any], where: str) -> dict[str, Any]:
    """Box or polygon, as COCO has it, of any of VIA's shapes."""
    kind = shape.get("name")

    def field(name: str) -> float:
        return number(shape.get(name), f"{where}: {name}")

    if kind in ("polygon", "polyline"):
        us, vs = shape.get("all_points_x"), shape.get("all_points_y")
        if not isinstance(us, list) or not isinstance(vs, list) or len(us) != len(vs):
            raise FileFormatError(f"{where}: all_points_x and all_points_y must be lists of one length")
        pairs = zip(us, vs, strict=True)
        return {"segmentation": [[number(value, f"{where}: a corner") for pair in pairs for value in pair]]}
    if kind == "rect":
        return {"bbox": [field(name) for name in ("x", "y", "width", "height")]}
    if kind in ("circle", "ellipse"):
        rx, ry = (field("r"), field("r")) if kind == "circle" else (field("rx"), field("ry"))
        turn = number(shape.get("theta") or 0.0, f"{where}: theta")
        angles = np.linspace(0.0, 2 * math.pi, CORNERS_OF_A_CURVE, endpoint=False)
        along, across = rx * np.cos(angles), ry * np.sin(angles)
        us = field("cx") + along * math.cos(turn) - across * math.sin(turn)
        vs = field("cy") + along * math.sin(turn) + across * math.cos(turn)
        return {"segmentation": [np.column_stack((us, vs)).ravel().tolist()]}
    raise FileFormatError(f"{where}: shape {kind!r:.40} is no outline; polygon, rect, circle, ellipse are")


def _csv_regions(path: Path) -> Iterator[tuple[str, Region | None]]:
    """File name and region, a row each; None for a photograph without any."""
    try:
        # Version 1 begins its first line with a #.
        rows = csv.DictReader(io.StringIO(read_text(path).removeprefix("#"), newline=""))
        missing = set(CSV_FIELDS) - set(rows.fieldnames or ())
        if missing:
            raise FileFormatError(f"{path}: not VIA's CSV; columns {', '.join(sorted(missing))} are missing")
        for row in rows:
            where = f"{path}, line {rows.line_num}"
            name = row["filename"]
            if not name:
                raise FileFormatError(f"{where}: the cell 'filename' is empty")
            shape = _object(row["region_shape_attributes"], where)
            attributes = _object(row["region_attributes"], where)
            yield name, Region(name, shape, attributes, where) if shape else None
    except csv.Error as error:
        raise FileFormatError(f"{path}: not readable as CSV ({error})") from error


def _object(text: str | None, where: str) -> dict[str, Any]:
    try:
        return require_object(json.loads(text or "{}"), where)
    except FileFormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{where}: JSON in a cell is damaged ({error})") from error


def _json_regions(path: Path) -> Iterator[tuple[str, Region | None]]:
    data = require_object(read_json(path), str(path))
    photographs = require_object(data.get("_via_img_metadata", data), f"{path}: _via_img_metadata")
    for key, entry in photographs.items():
        where = f"{path}: {key:.80}"
        photograph = require_object(entry, where)
        name, regions = photograph.get("filename"), photograph.get("regions")
        if not isinstance(name, str) or not isinstance(regions, list | dict):
            raise FileFormatError(f"{where}: not VIA's JSON; 'filename' and 'regions' are needed")
        yield name, None
        for position, given in enumerate(regions.values() if isinstance(regions, dict) else regions):
            place = f"{where}, region {position}"
            region = require_object(given, place)
            yield (
                name,
                Region(
                    name,
                    require_object(region.get("shape_attributes"), f"{place}: shape_attributes"),
                    require_object(region.get("region_attributes", {}), f"{place}: region_attributes"),
                    place,
                ),
            )
