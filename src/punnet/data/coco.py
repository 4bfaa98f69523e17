"""COCO files: Punnet's own dialect (docs/data.md) read and written without loss, and other people's COCO read."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.data.class_names import ClassMap, classify
from punnet.data.coco_entries import (
    annotation_to_entry,
    entry_to_annotation,
    entry_to_camera,
    image_to_entry,
    keypoint_order,
    relative,
)
from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.data.reading import beside, find_image_folder, integer, read_json, require_object
from punnet.errors import FileFormatError, OutputError, ShapeError
from punnet.outputs import require_suffix, write_text
from punnet.scene import CLASSES, KEYPOINTS

__all__ = ["CocoFile", "dataset_to_coco", "open_coco", "read_coco", "write_coco"]

FILE_FIELDS = ("images", "annotations", "categories", "info", "licenses")
IMAGE_FIELDS = ("id", "file_name", "width", "height", "depth_path", "camera", "group")
SKELETON = [[1, 2], [2, 3], [4, 5]]
ReadEntry = Callable[[dict[str, Any], int, tuple[int, int], str], Annotation | None]
"""Entry, its id, (H, W) of its image, file and annotation for messages → annotation, None to leave it out."""


@dataclass(frozen=True, eq=False)
class CocoFile:
    """A COCO file, its entries sorted by image and otherwise as they are.

    Parameters
    ----------
    path
        The file, for messages.
    data
        The whole object.
    images
        Entries of images, by id, in the order of the file.
    annotations
        Entries of annotations, by id of their image; each with its own id.
    """

    path: Path
    data: dict[str, Any]
    images: dict[int, dict[str, Any]]
    annotations: dict[int, list[tuple[int, dict[str, Any]]]]

    def image_folder(self, given: str | Path | None) -> Path:
        """Where its photographs are: ``given``, or the first likely place that has some of them."""
        if given is not None:
            return Path(given)
        names = [image.get("file_name") for image in self.images.values()]
        return find_image_folder(
            self.path.parent, [n.replace("\\", "/") for n in names if isinstance(n, str) and "\0" not in n]
        )

    def dataset(self, image_folder: Path, read_entry: ReadEntry) -> Dataset:
        """The file as a data set, each annotation read by ``read_entry``.

        Raises
        ------
        FileFormatError
            If an entry is damaged; the message names file, annotation and fault.
        """
        try:
            return Dataset(
                images=tuple(self._image(identity, image_folder, read_entry) for identity in self.images),
                name=self.path.parent.name or self.path.stem,
                info=self.data["info"] if isinstance(self.data.get("info"), dict) else {},
                licences=self.data["licenses"] if isinstance(self.data.get("licenses"), list) else [],
                extra={name: value for name, value in self.data.items() if name not in FILE_FIELDS},
            )
        except ShapeError as error:
            raise FileFormatError(f"{self.path}: {error}") from error

    def _image(self, identity: int, folder: Path, read_entry: ReadEntry) -> AnnotatedImage:
        entry, where = self.images[identity], f"{self.path}: image {identity}"
        height, width = (integer(entry.get(name), f"{where}: {name}") for name in ("height", "width"))
        annotations = []
        for number, given in self.annotations.get(identity, ()):
            place = f"{self.path}: annotation {number}"
            extra = given
            if given.get("depth_path") is not None:
                extra = {**given, "depth_path": str(beside(self.path.parent, given["depth_path"], place))}
            annotation = read_entry(extra, number, (height, width), place)
            if annotation is not None:
                annotations.append(annotation)
        depth = entry.get("depth_path")
        depths = [Path(a.extra["depth_path"]) for a in annotations if a.extra.get("depth_path") is not None]
        group = entry.get("group")
        return AnnotatedImage(
            id=identity,
            path=beside(folder, entry.get("file_name"), f"{where}: file_name"),
            width=width,
            height=height,
            annotations=tuple(annotations),
            depth_path=next(iter(depths), None)
            if depth is None
            else beside(self.path.parent, depth, f"{where}: depth_path"),
            camera=entry_to_camera(entry, where),
            group=None if group is None else str(group),
            extra={name: value for name, value in entry.items() if name not in IMAGE_FIELDS},
        )

    def categories(self) -> dict[int, dict[str, Any]]:
        """Entries of categories by id; Punnet's two if the file lists none."""
        given = self.data.get("categories")
        if not isinstance(given, list) or not given:
            return {category["id"]: category for category in _categories()}
        where = f"{self.path}: category"
        return {
            integer(require_object(category, where).get("id"), f"{where} id"): category for category in given
        }


def open_coco(path: str | Path) -> CocoFile:
    """Open a COCO file and sort its entries; what is inside them is not looked at.

    Raises
    ------
    FileFormatError
        If the file is missing or not COCO, or entries lack ids, share them or belong to no image.
    """
    path = Path(path)
    data = read_json(path)
    if not isinstance(data, dict) or not all(
        isinstance(data.get(k), list) for k in ("images", "annotations")
    ):
        raise FileFormatError(f"{path}: not COCO; an object with lists 'images' and 'annotations' is needed")
    images: dict[int, dict[str, Any]] = {}
    for position, entry in enumerate(data["images"]):
        where = f"{path}: entry {position} of 'images'"
        identity = integer(require_object(entry, where).get("id"), f"{where}: id")
        if identity in images:
            raise FileFormatError(f"{path}: image id {identity} is given twice")
        images[identity] = entry
    annotations: dict[int, list[tuple[int, dict[str, Any]]]] = {}
    for position, entry in enumerate(data["annotations"]):
        where = f"{path}: entry {position} of 'annotations'"
        number = integer(require_object(entry, where).get("id"), f"{where}: id")
        image = integer(entry.get("image_id"), f"{path}: annotation {number}: image_id")
        if image not in images:
            raise FileFormatError(f"{path}: annotation {number} is of image {image}, which is not listed")
        annotations.setdefault(image, []).append((number, entry))
    return CocoFile(path, data, images, annotations)


def read_coco(
    path: str | Path, image_folder: str | Path | None = None, *, class_map: ClassMap | None = None
) -> Dataset:
    """Read a COCO file: polygons or run lengths, boxes, five key-points, and what Punnet adds to them.

    Key-points that ``categories`` lists in another order are put in ours.

    Parameters
    ----------
    path
        The JSON file.
    image_folder
        What ``file_name`` is relative to. If None, the file's folder, or a folder ``images`` or ``img`` in or beside
        it if the photographs are there.
    class_map
        What category names mean that are not known here.

    Raises
    ------
    FileFormatError
        If the file is missing or not COCO, an entry is damaged, or a class is not known.
    """
    file = open_coco(path)
    categories = file.categories()
    names = {number: str(category.get("name")) for number, category in categories.items()}
    orders = {
        number: keypoint_order(category.get("keypoints"), f"{file.path}: category {number}")
        for number, category in categories.items()
    }

    def read_entry(
        entry: dict[str, Any], identity: int, size: tuple[int, int], where: str
    ) -> Annotation | None:
        category = integer(entry.get("category_id"), f"{where}: category_id")
        if category not in names:
            raise FileFormatError(f"{where}: category_id {category} is not in 'categories'")
        class_index = classify(names[category], class_map, where)
        if class_index is None:
            return None
        if names[category] not in CLASSES:
            entry = {"category_name": names[category], **entry}
        return entry_to_annotation(entry, identity, class_index, size, where, orders[category])

    return file.dataset(file.image_folder(image_folder), read_entry)


def write_coco(dataset: Dataset, path: str | Path, *, force: bool = False) -> Path:
    """Write a COCO file in Punnet's dialect, whole or not at all; photographs stay where they are.

    Paths become relative to the file's folder, masks in PNGs become run lengths.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is not set.
    OutputError
        If its name does not end in ``.json``, by which it is known when it is read.
    FileFormatError
        If a mask is in a file that is missing or damaged.
    """
    require_suffix(path, ".json")
    try:
        text = json.dumps(dataset_to_coco(dataset, Path(path).parent), allow_nan=False)
    except (TypeError, ValueError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise OutputError(f"{path}: an extra field can't be said in JSON ({error})") from error
    return write_text(path, text + "\n", force=force)


def dataset_to_coco(dataset: Dataset, folder: Path) -> dict[str, Any]:
    """Give the object that :func:`write_coco` writes, paths relative to ``folder``."""
    entries = []
    for image in dataset:
        for annotation in image.annotations:
            entry = annotation_to_entry(annotation, image)
            if isinstance(entry.get("depth_path"), str):
                entry["depth_path"] = relative(Path(entry["depth_path"]), folder)
            entries.append(entry)
    return {
        **dataset.extra,
        "info": dataset.info,
        "licenses": dataset.licences,
        "images": [image_to_entry(image, folder) for image in dataset],
        "annotations": entries,
        "categories": _categories(),
    }


def _categories() -> list[dict[str, Any]]:
    return [
        {"id": k + 1, "name": name, "keypoints": list(KEYPOINTS), "skeleton": SKELETON}
        for k, name in enumerate(CLASSES)
    ]
