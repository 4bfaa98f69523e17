"""YOLO label files, one a photograph: boxes, outlines (segmentation) or key-points (pose); a ``data.yaml`` or none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.data.assembling import FoundBerry, FoundImage, assemble
from punnet.data.class_names import ClassMap, classify, same_name
from punnet.data.coco_entries import Order, keypoint_order
from punnet.data.dataset import Dataset
from punnet.data.reading import (
    IMAGE_SUFFIXES,
    beside,
    image_size,
    integer,
    list_images,
    number,
    numbers,
    read_text,
    require_object,
)
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS, Visibility

__all__ = ["find_labels", "read_yolo"]

PARTS = ("train", "val", "test")
YAML_NAMES = ("data.yaml", "dataset.yaml", "data.yml")
# A thousand class names take a third of it; what is longer is something else, and may take minutes to parse.
LONGEST_YAML = 2**16
BOX = 5
PLAIN_POSE = BOX + 3 * len(KEYPOINTS)
Shape = tuple[int, int]


@dataclass(frozen=True)
class Settings:
    """What ``data.yaml`` says: names by class number, numbers a key-point (0: no pose) and their order, photographs."""

    names: dict[int, str]
    places: list[tuple[str, Path]]
    per_keypoint: int = 0
    order: Order | None = None


def read_yolo(path: str | Path, *, class_map: ClassMap | None = None) -> Dataset:
    """Read YOLO boxes, segmentation or pose.

    A line holds class, box and nothing else; class and outline; or class, box and five key-points. Five key-points
    with visibility (20 numbers) are told from an outline by their count, others by ``kpt_shape`` in ``data.yaml``.
    Boxes without masks are partial labels, and valid. The part (train, val, test) is kept as ``split`` of the image.

    Parameters
    ----------
    path
        ``data.yaml``, or a folder with it, or a folder with ``images/`` and ``labels/``.
    class_map
        What classes mean, by name or number (``{"0": "pluckable"}``); a number goes before the names of ``data.yaml``,
        so that a file that names its classes wrongly can still be read.

    Raises
    ------
    FileFormatError
        If a file is missing or damaged, or a class not known.
    """
    path = Path(path)
    settings = _settings(path)
    found = (
        _photograph(image, label, part, settings, class_map)
        for part, place in settings.places
        for image, label in _pairs(place)
    )
    dataset = assemble(found, path.parent.name if path.is_file() else path.name)
    if not len(dataset):
        raise FileFormatError(f"{path}: no photographs in {', '.join(str(p) for _, p in settings.places)}")
    return dataset


def find_labels(path: Path) -> bool:
    """Whether YOLO's files are at a path: its YAML, or a folder ``labels`` with text files beside ``images``."""
    if path.is_file():
        return path.suffix in (".yaml", ".yml")
    if any((path / name).is_file() for name in YAML_NAMES):
        return True
    return (path / "images").is_dir() and any((path / "labels").rglob("*.txt"))


def _settings(path: Path) -> Settings:
    file = path if path.is_file() else next((path / n for n in YAML_NAMES if (path / n).is_file()), None)
    if file is None:
        if not (path / "images").is_dir() or not (path / "labels").is_dir():
            raise FileFormatError(
                f"{path}: not YOLO; data.yaml is needed, or the folders 'images' and 'labels'"
            )
        return Settings({}, _folders(path / "images"))
    data = _read_yaml(file)
    places = [(part, place) for part in PARTS for place in _places(data, part, file)]
    # The same folder is often given as two parts.
    unique = {place: part for part, place in reversed(places)}
    if not unique:
        raise FileFormatError(f"{file}: none of {', '.join(PARTS)} says where the photographs are")
    ordered = sorted(unique.items(), key=lambda item: PARTS.index(item[1]))
    return Settings(
        _class_names(data, file),
        [(part, place) for place, part in ordered],
        _per_keypoint(data, file),
        _order(data, file),
    )


def _folders(images: Path) -> list[tuple[str, Path]]:
    """``images`` itself, or the folders in it."""
    inside = [(folder.name, folder) for folder in sorted(images.iterdir()) if folder.is_dir()]
    return inside if inside and not list_images(images) else [("", images)]


def _read_yaml(file: Path) -> dict[str, Any]:
    import yaml  # type: ignore[import-untyped]

    text = read_text(file)
    if len(text) > LONGEST_YAML:
        raise FileFormatError(
            f"{file}: too long for YOLO's description of a data set ({len(text)} characters)"
        )
    try:
        data = yaml.safe_load(text)
    # Deep nesting, impossible dates and numbers come through as they are.
    except (yaml.YAMLError, ValueError, TypeError, RecursionError, AttributeError, KeyError) as error:
        raise FileFormatError(f"{file}: not readable as YAML ({error})") from error
    return require_object(data, str(file))


def _places(data: dict[str, Any], part: str, file: Path) -> Iterator[Path]:
    """Folders or lists of photographs of a part; Roboflow writes ``../train/images`` for ``train/images``."""
    given = data.get(part)
    root = beside(file.parent, data["path"], f"{file}: path") if data.get("path") else file.parent
    for name in given if isinstance(given, list) else [given] if given else []:
        where = f"{file}: {part}"
        tried = [beside(base, name, where) for base in (root, file.parent)]
        tried.append(beside(file.parent, str(name).removeprefix("../"), where))
        place = next((place for place in tried if _exists(place)), None)
        if place is None:
            raise FileFormatError(f"{where}: no photographs at {tried[0]}")
        yield place


def _exists(place: Path) -> bool:
    try:
        return place.exists()
    except OSError:
        return False


def _class_names(data: dict[str, Any], file: Path) -> dict[int, str]:
    names = data.get("names") or {}
    if isinstance(names, list):
        names = dict(enumerate(names))
    if not isinstance(names, dict):
        raise FileFormatError(f"{file}: names must be a list, or numbers with names")
    return {integer(index, f"{file}: names"): str(name) for index, name in names.items()}


def _per_keypoint(data: dict[str, Any], file: Path) -> int:
    given = data.get("kpt_shape")
    if given is None:
        return 0
    if given not in ([len(KEYPOINTS), 2], [len(KEYPOINTS), 3]):
        raise FileFormatError(f"{file}: kpt_shape must be [{len(KEYPOINTS)}, 2 or 3], got {given!r:.40}")
    return int(given[1])


def _order(data: dict[str, Any], file: Path) -> Order | None:
    """Order of the key-points, from their names: one list, or one a class."""
    given = data.get("kpt_names")
    if isinstance(given, dict):
        given = next(iter(given.values()), None)
    return keypoint_order(given, f"{file}: kpt_names")


def _pairs(place: Path) -> Iterator[tuple[Path, Path]]:
    """Photographs of a folder, or of a list in a text file, with where their labels would be."""
    if place.is_dir():
        images = list_images(place)
        if not images and (place / "images").is_dir():
            images = list_images(place / "images")
    else:
        lines = [line.strip() for line in read_text(place).splitlines() if line.strip()]
        images = [beside(place.parent, line, str(place)) for line in lines]
    for image in images:
        parts = list(image.parts)
        for position in range(len(parts) - 2, -1, -1):
            if parts[position] == "images":
                parts[position] = "labels"
                break
        yield image, Path(*parts).with_suffix(".txt")


def _photograph(
    image: Path, label: Path, part: str, settings: Settings, class_map: ClassMap | None
) -> FoundImage:
    if image.suffix.lower() not in IMAGE_SUFFIXES:
        raise FileFormatError(f"{image}: no photograph; {' '.join(IMAGE_SUFFIXES)} are")
    height, width = image_size(image)
    berries = []
    # A photograph without a label file has no berries.
    for position, line in enumerate(read_text(label).splitlines() if label.is_file() else [], start=1):
        if line.strip():
            where = f"{label}, line {position}"
            berry = _berry(line.split(), (height, width), where, settings, class_map)
            if berry is not None:
                berries.append(berry)
    return FoundImage(image, width, height, berries, str(image), {"split": part} if part else {})


def _berry(
    words: list[str], size: Shape, where: str, settings: Settings, class_map: ClassMap | None
) -> FoundBerry | None:
    values = numbers(words, len(words), where)
    index = integer(values[0], f"{where}: class")
    class_index = _class(index, settings.names, class_map, where)
    if class_index is None:
        return None
    per_keypoint = settings.per_keypoint or (3 if len(values) == PLAIN_POSE else 0)
    pose = BOX + per_keypoint * len(KEYPOINTS)
    fields: dict[str, Any] = {}
    if len(values) in (BOX, BOX + 1):
        fields["bbox"] = _box(values[1:BOX], size)
        if len(values) > BOX:
            fields["score"] = number(values[BOX], f"{where}: score")
    elif per_keypoint and len(values) == pose:
        points = _keypoints(values[BOX:], per_keypoint, size, where)
        if settings.order is not None:
            points = [points[place] for place in settings.order]
        fields["bbox"] = _box(values[1:BOX], size)
        fields["keypoints"] = [value for point in points for value in point]
    elif not settings.per_keypoint and len(values) >= 1 + 2 * 3 and len(values) % 2:
        height, width = size
        corners = values[1:]
        fields["segmentation"] = [[value * (height if k % 2 else width) for k, value in enumerate(corners)]]
    else:
        raise FileFormatError(
            f"{where}: {len(values)} numbers are no box (5), outline (7 or more, odd) or pose ({PLAIN_POSE})"
        )
    return FoundBerry(class_index, fields, where)


def _class(index: int, names: dict[int, str], class_map: ClassMap | None, where: str) -> int | None:
    if str(index) in {same_name(name) for name in class_map or {}} or index not in names:
        return classify(str(index), class_map, where)
    return classify(names[index], class_map, where)


def _box(values: list[float], size: Shape) -> list[float]:
    height, width = size
    u, v, across, along = values
    return [(u - across / 2) * width, (v - along / 2) * height, across * width, along * height]


def _keypoints(values: list[float], per_keypoint: int, size: Shape, where: str) -> list[list[float]]:
    """[u, v, visibility] in pixels of each key-point, in the order of the file."""
    height, width = size
    points = []
    for k in range(0, len(values), per_keypoint):
        u, v, *rest = values[k : k + per_keypoint]
        # Without visibility, YOLO writes absent points as zeros.
        flag = integer(rest[0], f"{where}: visibility") if rest else int(Visibility.VISIBLE if u or v else 0)
        points.append([u * width, v * height, flag])
    return points
