"""The formats that are read, by name, and which of them lies at a path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from punnet.data.class_names import ClassMap
from punnet.data.coco import read_coco
from punnet.data.cvat import read_cvat
from punnet.data.dataset import Dataset
from punnet.data.labelme import is_labelme, read_labelme
from punnet.data.picking_points import is_picking_points, read_picking_points
from punnet.data.psd import read_psd
from punnet.data.reading import read_json, read_text
from punnet.data.strawdi import read_strawdi
from punnet.data.via import is_via, read_via
from punnet.data.yolo import find_labels, read_yolo
from punnet.errors import ConfigurationError, FileFormatError

__all__ = ["FORMATS", "Format", "guess_format", "read_dataset"]

EXPORTS = ("instances_*.json", "person_keypoints_*.json")
COCO_FILES = ("annotations.json", "coco.json", "_annotations.coco.json", "detections.json")


@dataclass(frozen=True)
class Format:
    """One format.

    Parameters
    ----------
    name
        What to call it on the command line.
    description
        One line: what has to be at the path.
    read
        Path and class map to data set.
    recognises
        Whether a path that exists holds this format; looks at names and at the start of things only.
    """

    name: str
    description: str
    read: Callable[[Path, ClassMap | None], Dataset]
    recognises: Callable[[Path], bool]


def read_dataset(
    path: str | Path,
    format: str | None = None,  # noqa: A002
    *,
    class_map: ClassMap | None = None,
) -> Dataset:
    """Read labelled images of any format in :data:`FORMATS`.

    Parameters
    ----------
    path
        A file or a folder.
    format
        A name in :data:`FORMATS`; guessed from what is at the path if None.
    class_map
        What class names mean that are not known to Punnet.

    Raises
    ------
    FileFormatError
        If nothing is at the path, its format can't be guessed, or it is damaged.
    ConfigurationError
        If there is no such format.
    """
    path = Path(path)
    if not path.exists():
        raise FileFormatError(f"{path}: no such file or folder")
    name = guess_format(path) if format is None else format
    if name not in FORMATS:
        raise ConfigurationError(f"no data format '{name}'; there are {', '.join(FORMATS)}")
    return FORMATS[name].read(path, class_map)


def guess_format(path: str | Path) -> str:
    """Name of the first format that recognises what is at the path.

    Raises
    ------
    FileFormatError
        If none does; the message lists what is possible.
    """
    for name, known in FORMATS.items():
        if known.recognises(Path(path)):
            return name
    listed = "; ".join(f"{name} ({known.description})" for name, known in FORMATS.items())
    raise FileFormatError(f"{path}: no known data format; say which it is, one of: {listed}")


def _coco_file(path: Path) -> Path | None:
    if path.is_file():
        return path if path.suffix == ".json" else None
    places = [path / folder / name for folder in ("", "annotations") for name in COCO_FILES]
    return next((place for place in places if place.is_file()), None)


def _is_coco(path: Path) -> bool:
    file = _coco_file(path)
    if file is None:
        return False
    data = read_json(file)
    return isinstance(data, dict) and isinstance(data.get("images"), list) and "annotations" in data


def _read_coco(path: Path, class_map: ClassMap | None) -> Dataset:
    file = _coco_file(path)
    if file is None:
        raise FileFormatError(f"{path}: no COCO file here; looked for {', '.join(COCO_FILES)}")
    return read_coco(file, class_map=class_map)


def _is_psd(path: Path) -> bool:
    return (path / "coco.json").is_file() and '"hardness"' in read_text(path / "coco.json")


def _is_cvat(path: Path) -> bool:
    places = [path, path / "annotations"]
    return all(any(p for place in places for p in place.glob(kind)) for kind in EXPORTS)


def _via_file(path: Path) -> Path | None:
    """The file itself, or the only one of VIA in a folder."""
    files = [path] if path.is_file() else sorted([*path.glob("*.csv"), *path.glob("*.json")])
    via = [file for file in files if is_via(file)]
    return via[0] if len(via) == 1 else None


def _read_via(path: Path, class_map: ClassMap | None) -> Dataset:
    file = path if path.is_file() else _via_file(path)
    if file is None:
        raise FileFormatError(f"{path}: not exactly one file of VIA here; give the file itself")
    return read_via(file, class_map=class_map)


FORMATS: dict[str, Format] = {
    known.name: known
    for known in (
        Format(
            "strawdi",
            "folder with img/ and label/, perhaps coco_keypoints.json",
            lambda path, class_map: read_strawdi(path, class_map=class_map),
            lambda path: (path / "label").is_dir() and (path / "img").is_dir(),
        ),
        Format("psd", "folder with img/ and coco.json", lambda path, _: read_psd(path), _is_psd),
        Format(
            "cvat",
            "folder with instances_*.json and person_keypoints_*.json",
            lambda path, class_map: read_cvat(path, class_map=class_map),
            _is_cvat,
        ),
        Format("coco", "JSON file, or a folder with annotations.json", _read_coco, _is_coco),
        Format(
            "yolo",
            "data.yaml, or a folder with images/ and labels/",
            lambda path, class_map: read_yolo(path, class_map=class_map),
            find_labels,
        ),
        Format("via", "CSV or JSON of VGG Image Annotator", _read_via, lambda p: _via_file(p) is not None),
        Format(
            "labelme",
            "JSON of LabelMe, or a folder of them",
            lambda path, class_map: read_labelme(path, class_map=class_map),
            is_labelme,
        ),
        Format(
            "picking-points",
            "JSON a photograph with bbox_mode and keypoints, or a folder of them",
            lambda path, class_map: read_picking_points(path, class_map=class_map),
            is_picking_points,
        ),
    )
}
