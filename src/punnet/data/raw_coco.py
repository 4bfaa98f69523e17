"""A COCO file as it stands in the JSON, for those who have to look at files that no reader accepts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.data.reading import find_image_folder, read_text
from punnet.errors import FileFormatError
from punnet.scene import CLASSES

__all__ = ["RawCoco", "category_names", "find_coco_file", "open_raw_coco"]

USUAL_NAMES = ("annotations.json", "coco.json", "coco_keypoints.json", "detections.json")


@dataclass(frozen=True, eq=False)
class RawCoco:
    """A COCO file as it stands, and where its photographs are.

    Parameters
    ----------
    path
        The file.
    data
        The JSON object; NaN and infinities are numbers here.
    image_folder
        What ``file_name`` is relative to.
    """

    path: Path
    data: dict[str, Any]
    image_folder: Path

    @property
    def images(self) -> list[Any]:
        """The file's ``images``, whatever they are."""
        return list(self.data["images"])

    @property
    def is_graded(self) -> bool:
        """Whether ``ripeness`` is a grade 0 … 4 that tells the class, as in PSD."""
        entries = self.annotations
        return bool(entries) and all(isinstance(entry, dict) and "hardness" in entry for entry in entries)

    @property
    def annotations(self) -> list[Any]:
        """The file's ``annotations``, whatever they are."""
        return list(self.data["annotations"])


def find_coco_file(path: str | Path) -> Path:
    """The COCO file meant by a file or a folder.

    Raises
    ------
    FileFormatError
        If a folder holds none, or several of which none has a usual name.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    for name in USUAL_NAMES:
        if (path / name).is_file():
            return path / name
    others = sorted(path.glob("*.json"))
    if len(others) == 1:
        return others[0]
    found = f"{len(others)} JSON files, none of them named" if others else "no"
    raise FileFormatError(f"{path}: holds {found} {' or '.join(USUAL_NAMES)}; name the COCO file")


def open_raw_coco(path: str | Path, image_folder: str | Path | None = None) -> RawCoco:
    """Open a COCO file, or the one in a folder, without judging what is in it.

    Raises
    ------
    FileFormatError
        If it is missing, no JSON, or lacks the lists ``images`` and ``annotations``.
    """
    path = find_coco_file(path)
    try:
        data = json.loads(read_text(path))
    except FileFormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    lists = ("images", "annotations")
    if not isinstance(data, dict) or not all(isinstance(data.get(name), list) for name in lists):
        raise FileFormatError(f"{path}: not COCO; an object with lists 'images' and 'annotations' is needed")
    if image_folder is not None:
        return RawCoco(path, data, Path(image_folder))
    names = (image.get("file_name") for image in data["images"] if isinstance(image, dict))
    return RawCoco(
        path, data, find_image_folder(path.parent, (name for name in names if isinstance(name, str)))
    )


def category_names(data: Mapping[str, Any]) -> dict[Any, str]:
    """Name of each category id; Punnet's own where the file lists none."""
    listed = data.get("categories")
    if not listed:
        return dict(enumerate(CLASSES, start=1))
    entries = listed if isinstance(listed, list) else []
    return {
        entry["id"]: str(entry.get("name", ""))
        for entry in entries
        if isinstance(entry, dict) and isinstance(entry.get("id"), int | str)
    }
