"""What the viewer shows: the photographs at a path, with their annotations and faults if there are any."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.class_names import ClassMap
from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.data.faults import Fault
from punnet.data.formats import guess_format
from punnet.data.image_checks import Progress
from punnet.data.lenient import read_readable
from punnet.data.raw_coco import open_raw_coco
from punnet.data.reading import image_size, list_images
from punnet.data.validation import validate_coco
from punnet.errors import FileFormatError
from punnet.scene import CLASSES

__all__ = ["Gallery", "GalleryItem", "open_gallery", "open_images"]


@dataclass(frozen=True, eq=False)
class GalleryItem:
    """One photograph.

    Parameters
    ----------
    path
        The file.
    image
        Its annotations; None for a bare photograph.
    faults
        What is wrong with it and them.
    """

    path: Path
    image: AnnotatedImage | None = None
    faults: tuple[Fault, ...] = ()

    def annotated(self) -> AnnotatedImage:
        """The photograph as an annotated one, without annotations if it is bare.

        Raises
        ------
        FileFormatError
            If a bare photograph can't be read.
        """
        if self.image is not None:
            return self.image
        height, width = image_size(self.path)
        return AnnotatedImage(1, self.path, width, height)

    def summary(self) -> dict[str, Any]:
        """What the page needs to list and to filter it."""
        annotations = () if self.image is None else self.image.annotations
        counts = [sum(a.class_index == k and not a.crowd for a in annotations) for k in range(len(CLASSES))]
        return {
            "name": self.path.name,
            "classes": dict(zip(CLASSES, counts, strict=True)),
            "crowd": sum(annotation.crowd for annotation in annotations),
            "faults": sorted({fault.code for fault in self.faults}),
        }

    def details(self) -> dict[str, Any]:
        """What the page shows beside the enlarged picture."""
        image = self.image
        return {
            **self.summary(),
            "path": str(self.path),
            "size": None if image is None else [image.width, image.height],
            "group": None if image is None else image.group,
            "berries": [] if image is None else [_row(annotation) for annotation in image.annotations],
            "problems": [fault.to_json() for fault in self.faults],
        }


@dataclass(frozen=True, eq=False)
class Gallery:
    """All photographs at a path.

    Parameters
    ----------
    name
        What to call them.
    items
        The photographs.
    faults
        What is wrong with the file, or with entries that belong to no photograph.
    left_out
        How many entries could not be read at all.
    """

    name: str
    items: tuple[GalleryItem, ...]
    faults: tuple[Fault, ...] = ()
    left_out: int = 0

    def to_json(self) -> dict[str, Any]:
        """The list that the page works with."""
        return {
            "name": self.name,
            "left_out": self.left_out,
            "problems": [fault.to_json() for fault in self.faults],
            "items": [item.summary() for item in self.items],
        }


def open_gallery(
    path: str | Path,
    format: str | None = None,  # noqa: A002
    *,
    class_map: ClassMap | None = None,
    progress: Progress | None = None,
) -> Gallery:
    """Open a data set of any format, a folder of ``punnet detect``, or a folder of bare photographs.

    A COCO file is validated, photographs included; what can't be read of it is left out.

    Parameters
    ----------
    path, format, class_map
        As :func:`~punnet.data.read_dataset` takes them.
    progress
        Told of photographs checked, and of how many.

    Raises
    ------
    FileFormatError
        If there is nothing to show.
    """
    path = Path(path)
    if (photographs := _bare_photographs(path, format)) is not None:
        return Gallery(path.resolve().name, tuple(map(GalleryItem, photographs)))
    dataset, left_out = read_readable(path, format, class_map=class_map)
    faults = _faults(path, class_map, progress)
    by_image: dict[Any, list[Fault]] = defaultdict(list)
    for fault in faults:
        by_image[_hashable(fault.image_id)].append(fault)
    items = tuple(GalleryItem(image.path, image, tuple(by_image.pop(image.id, ()))) for image in dataset)
    rest = tuple(fault for some in by_image.values() for fault in some)
    return Gallery(dataset.name, items, rest, len({(f.annotation_id is None, f.position) for f in left_out}))


def open_images(
    path: str | Path,
    format: str | None = None,  # noqa: A002
    *,
    class_map: ClassMap | None = None,
) -> tuple[Dataset, list[str]]:
    """Open what :func:`open_gallery` opens as one data set, and say what was left out of it.

    Raises
    ------
    FileFormatError
        If there is nothing to show.
    """
    path = Path(path)
    photographs = _bare_photographs(path, format)
    if photographs is None:
        dataset, faults = read_readable(path, format, class_map=class_map)
        return dataset, [str(fault) for fault in faults]
    images: list[AnnotatedImage] = []
    left_out: list[str] = []
    for photograph in photographs:
        try:
            height, width = image_size(photograph)
        except FileFormatError as error:
            left_out.append(str(error))
        else:
            images.append(AnnotatedImage(len(images) + 1, photograph, width, height))
    if not images:
        raise FileFormatError(f"{path}: none of the {len(photographs)} photographs can be read")
    return Dataset(tuple(images), name=path.resolve().name), left_out


def _bare_photographs(path: Path, format: str | None) -> list[Path] | None:  # noqa: A002
    """Photographs of a folder that has no labels; None if it has some, or is no folder."""
    if format is not None or not path.is_dir():
        return None
    try:
        guess_format(path)
    except FileFormatError:
        # A damaged file beside photographs is told of, not passed over.
        if not any(path.glob("*.json")) and (photographs := list_images(path)):
            return photographs
    return None


def _faults(path: Path, class_map: ClassMap | None, progress: Progress | None) -> tuple[Fault, ...]:
    try:
        raw = open_raw_coco(path)
    except FileFormatError:  # of another format; its reader has found nothing to say
        return ()
    return validate_coco(raw, class_map=class_map, progress=progress).faults


def _hashable(identity: Any) -> Any:
    return identity if isinstance(identity, int | str) else None


def _row(annotation: Annotation) -> dict[str, Any]:
    """One berry in the table; what is not known is null."""

    def known(value: float, digits: int) -> float | None:
        return round(value, digits) if np.isfinite(value) else None

    score = annotation.extra.get("score")
    return {
        "id": annotation.id,
        "class": "crowd" if annotation.crowd else CLASSES[annotation.class_index],
        "stage": annotation.stage,
        "ripeness": known(annotation.ripeness, 2),
        "occlusion": known(annotation.occlusion, 2),
        "grams": known(annotation.weight, 1),
        "score": known(float(score), 2) if isinstance(score, int | float) else None,
        "key-points": None
        if annotation.visibility is None
        else "".join("–○●×"[code] for code in annotation.visibility),
    }
