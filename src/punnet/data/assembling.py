"""A data set out of images whose berries have no ids yet, as most annotation tools leave them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from punnet.data.coco_entries import entry_to_annotation
from punnet.data.dataset import AnnotatedImage, Dataset
from punnet.errors import FileFormatError, ShapeError

__all__ = ["FoundBerry", "FoundImage", "assemble"]


@dataclass(frozen=True)
class FoundBerry:
    """What a reader found of one berry.

    Parameters
    ----------
    class_index
        0 pluckable, 1 unpluckable.
    fields
        Fields of Punnet's COCO dialect (docs/data.md): ``segmentation`` or xywh ``bbox``, ``keypoints`` …
    where
        File and place in it, for messages.
    """

    class_index: int
    fields: dict[str, Any]
    where: str


@dataclass(frozen=True)
class FoundImage:
    """What a reader found of one image; ``where`` names its place in the file, for messages."""

    path: Path
    width: int
    height: int
    berries: list[FoundBerry]
    where: str
    extra: dict[str, Any] = field(default_factory=dict)


def assemble(found: Iterable[FoundImage], name: str, info: dict[str, Any] | None = None) -> Dataset:
    """Give images and berries ids from 1 on, in the order in which they come.

    Raises
    ------
    FileFormatError
        If a field is damaged; the message names its place.
    """
    images: list[AnnotatedImage] = []
    berries = 0
    for number, image in enumerate(found, start=1):
        annotations = []
        for berry in image.berries:
            berries += 1
            annotations.append(
                entry_to_annotation(
                    berry.fields, berries, berry.class_index, (image.height, image.width), berry.where
                )
            )
        try:
            images.append(
                AnnotatedImage(
                    number, image.path, image.width, image.height, tuple(annotations), extra=image.extra
                )
            )
        except ShapeError as error:
            raise FileFormatError(f"{image.where}: {error}") from error
    return Dataset(tuple(images), name=name, info=info or {})
