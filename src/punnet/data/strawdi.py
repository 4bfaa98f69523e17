"""StrawDI: photographs in ``img/``, one PNG of instance labels each in ``label/``, perhaps ``coco_keypoints.json``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.data.class_names import ClassMap, classify
from punnet.data.coco import open_coco
from punnet.data.coco_entries import entry_to_annotation
from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.data.reading import integer, list_images
from punnet.data.segmentation import LabelPixels, outline_box, read_labels
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

__all__ = ["read_strawdi"]

KEYPOINT_FILE = "coco_keypoints.json"
RIPE_CATEGORY = 1
# What three classes of ripeness can say of six stages and of a share: the middle of each.
STAGE = {"ripe": "ripe", "partially_ripe": "turning", "unripe": "green"}
RIPENESS = {"ripe": 1.0, "partially_ripe": 0.5, "unripe": 0.0}


def read_strawdi(folder: str | Path, *, class_map: ClassMap | None = None) -> Dataset:
    """Read a folder of StrawDI; masks stay in the PNGs until asked for.

    With ``coco_keypoints.json``, category 1 (ripe) is pluckable and ``ripeness3`` gives stage and ripeness. Without
    it nothing tells ripe from unripe: say what a ``strawberry`` is in ``class_map``.

    Raises
    ------
    FileFormatError
        If a file is missing or damaged, or the class is not to be known.
    """
    folder = Path(folder)
    if not (folder / "label").is_dir():
        raise FileFormatError(
            f"{folder}: no folder 'label' with PNGs of instance labels; this is not StrawDI"
        )
    if not (folder / KEYPOINT_FILE).is_file():
        return _read_labels_alone(folder, class_map)
    file = open_coco(folder / KEYPOINT_FILE)
    stems = {
        number: Path(str(entry.get("file_name")).replace("\0", "")).stem
        for entries_of, entry in file.images.items()
        for number, _ in file.annotations.get(entries_of, ())
    }

    def read_entry(entry: dict[str, Any], identity: int, size: tuple[int, int], where: str) -> Annotation:
        ripe = integer(entry.get("category_id"), f"{where}: category_id") == RIPE_CATEGORY
        value = integer(entry.get("label_index"), f"{where}: label_index")
        known = str(entry.get("ripeness3"))
        stage = {} if known not in STAGE else {"stage": STAGE[known], "ripeness": RIPENESS[known]}
        annotation = entry_to_annotation(
            {**entry, **stage}, identity, PLUCKABLE if ripe else UNPLUCKABLE, size, where
        )
        pixels = LabelPixels(folder / "label" / f"{stems[identity]}.png", value)
        return replace(annotation, segmentation=pixels)

    return file.dataset(folder / "img", read_entry)


def _read_labels_alone(folder: Path, class_map: ClassMap | None) -> Dataset:
    if not (folder / "img").is_dir():
        raise FileFormatError(f"{folder}: no folder 'img' with photographs; this is not StrawDI")
    class_index = classify("strawberry", class_map, str(folder / "label"))
    images: list[AnnotatedImage] = []
    number = 0
    for path in list_images(folder / "img"):
        label = folder / "label" / f"{path.stem}.png"
        labels = cv2.imread(str(label), cv2.IMREAD_UNCHANGED) if label.is_file() else None
        if labels is None or labels.ndim != 2:
            raise FileFormatError(f"{label}: missing or no image of one channel; instance labels are needed")
        annotations = (
            [] if class_index is None else list(_instances(label, labels.shape, class_index, number))
        )
        number += len(annotations)
        height, width = labels.shape
        images.append(AnnotatedImage(len(images) + 1, path, width, height, tuple(annotations)))
    return Dataset(tuple(images), name=folder.name)


def _instances(label: Path, size: Any, class_index: int, taken: int) -> Iterator[Annotation]:
    values = np.unique(read_labels(label, size))
    for position, value in enumerate(values[values > 0].tolist(), start=1):
        pixels = LabelPixels(label, int(value))
        box = outline_box(pixels, size)
        assert box is not None
        yield Annotation(taken + position, class_index, box, pixels, extra={"label_index": int(value)})
