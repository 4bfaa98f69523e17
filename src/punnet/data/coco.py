"""COCO annotation files into :class:`~punnet.scene.Strawberries`, and detections back into COCO.

Two dialects are read: masks as polygons or run lengths in the annotation, and masks as an image of instance
labels beside the photographs with ``label_index`` in the annotation (StrawDI). Key-points, if any, are the
five of :data:`~punnet.scene.KEYPOINTS`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS, PLUCKABLE, UNPLUCKABLE, Strawberries, Visibility
from punnet.scene.masks import decode_mask, encode_mask

__all__ = ["CocoDataset", "CocoItem", "detections_to_coco", "read_psd", "read_strawdi"]

Pluckable = Literal["category", "ripeness"]
# PSD: 0 unripe, 1 up to half, 2 up to nine tenths, 3 fully ripe, 4 rotten. StrawDI: categories 1 ripe, 2
# unripe.
PLUCKABLE_RIPENESS = (2, 3)
RIPENESS_SHARE = {0: 0.0, 1: 0.5, 2: 0.9, 3: 1.0, 4: float("nan")}
RIPE_CATEGORY = 1


@dataclass(frozen=True, eq=False)
class CocoItem:
    """One annotated image.

    Parameters
    ----------
    image_id
        Its id in the file.
    image_path
        The photograph; it is not opened here.
    berries
        The annotations: masks, boxes that contain the key-points, classes, key-points, ripeness.
    """

    image_id: int
    image_path: Path
    berries: Strawberries


@dataclass(frozen=True, eq=False)
class CocoDataset:
    """A COCO file whose images are decoded one at a time, in the order of the file.

    Parameters
    ----------
    annotation_path
        The JSON file.
    image_folder
        Folder of the photographs.
    label_folder
        Folder of the instance-label PNGs, None if masks are in the JSON.
    pluckable
        What tells the class: ``category`` (1 is ripe) or ``ripeness`` (2 and 3 are pluckable).
    images, annotations
        The file's entries; annotations by image id.
    """

    annotation_path: Path
    image_folder: Path
    label_folder: Path | None
    pluckable: Pluckable
    images: list[dict[str, Any]]
    annotations: dict[int, list[dict[str, Any]]]

    def __len__(self) -> int:
        return len(self.images)

    def __iter__(self) -> Iterator[CocoItem]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int) -> CocoItem:
        """Decode image ``index``.

        Raises
        ------
        FileFormatError
            If an annotation lacks a field or has a damaged mask.
        """
        image = self.images[index]
        try:
            berries = self._berries(image)
        except (KeyError, TypeError, IndexError, ValueError) as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(
                f"{self.annotation_path}: annotations of image {image.get('id')} are damaged ({error!r})"
            ) from error
        return CocoItem(int(image["id"]), self.image_folder / str(image["file_name"]), berries)

    def _berries(self, image: dict[str, Any]) -> Strawberries:
        size = (int(image["height"]), int(image["width"]))
        annotations = self.annotations.get(int(image["id"]), [])
        if not annotations:
            return Strawberries.empty(size)
        labels = None if self.label_folder is None else self._labels(image, size)
        masks = np.stack([_mask(annotation, size, labels) for annotation in annotations])
        keypoints, visibility = _keypoints(annotations)
        with_keypoints = any("keypoints" in annotation for annotation in annotations)
        boxes = np.stack(
            [_box(annotation, points) for annotation, points in zip(annotations, keypoints, strict=True)]
        )
        return Strawberries(
            image_size=size,
            boxes=boxes,
            classes=np.array([self._class(annotation) for annotation in annotations]),
            masks=masks,
            keypoints=keypoints if with_keypoints else None,
            visibility=visibility if with_keypoints else None,
            ripeness=np.array([_ripeness(annotation) for annotation in annotations]),
            ids=np.array([int(annotation["id"]) for annotation in annotations]),
        )

    def _labels(self, image: dict[str, Any], size: tuple[int, int]) -> NDArray[np.uint8]:
        assert self.label_folder is not None
        path = self.label_folder / f"{Path(image['file_name']).stem}.png"
        labels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
        if labels is None or labels.shape != size:
            found = "missing or no image" if labels is None else f"of shape {labels.shape}"
            raise FileFormatError(f"{path}: {found}; one channel of instance labels, {size}, is needed")
        return np.asarray(labels, dtype=np.uint8)

    def _class(self, annotation: dict[str, Any]) -> int:
        if self.pluckable == "category":
            ripe = int(annotation["category_id"]) == RIPE_CATEGORY
        else:
            ripe = int(annotation["ripeness"]) in PLUCKABLE_RIPENESS
        return PLUCKABLE if ripe else UNPLUCKABLE


def read_strawdi(folder: str | Path) -> CocoDataset:
    """Open StrawDI with key-points: ``coco_keypoints.json``, ``img/``, ``label/``; pluckable is category 1.

    Raises
    ------
    FileFormatError
        If the file is missing or not COCO.
    """
    folder = Path(folder)
    return _open(folder / "coco_keypoints.json", folder / "img", folder / "label", "category")


def read_psd(folder: str | Path) -> CocoDataset:
    """Open PSD: ``coco.json`` with polygons, ``img/``; pluckable is ripeness 2 or 3 of 0…4.

    Raises
    ------
    FileFormatError
        If the file is missing or not COCO.
    """
    folder = Path(folder)
    return _open(folder / "coco.json", folder / "img", None, "ripeness")


def _open(path: Path, image_folder: Path, label_folder: Path | None, pluckable: Pluckable) -> CocoDataset:
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file; a COCO annotation file is needed")
    try:
        data = json.loads(path.read_text())
    except (ValueError, OSError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if not isinstance(data, dict) or not all(
        isinstance(data.get(k), list) for k in ("images", "annotations")
    ):
        raise FileFormatError(f"{path}: not COCO; an object with lists 'images' and 'annotations' is needed")
    grouped: dict[int, list[dict[str, Any]]] = {}
    try:
        known = {int(image["id"]) for image in data["images"]}
        for annotation in data["annotations"]:
            grouped.setdefault(int(annotation["image_id"]), []).append(annotation)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: an image or annotation lacks its id ({error!r})") from error
    if strays := sorted(grouped.keys() - known):
        raise FileFormatError(f"{path}: annotations of images that are not listed, ids {strays[:5]}")
    return CocoDataset(path, image_folder, label_folder, pluckable, data["images"], grouped)


def _mask(
    annotation: dict[str, Any], size: tuple[int, int], labels: NDArray[np.uint8] | None
) -> NDArray[np.bool_]:
    if labels is not None:
        return np.asarray(labels == int(annotation["label_index"]))
    segmentation = annotation["segmentation"]
    if isinstance(segmentation, dict):
        return decode_mask(segmentation)
    # COCO's own rasteriser, so that scores agree with COCO tools to the last pixel; it loads slowly.
    from faster_coco_eval.core import mask as rasteriser

    height, width = size
    polygons = [[float(value) for value in polygon] for polygon in segmentation]
    return np.asarray(rasteriser.decode(rasteriser.segmToRle(polygons, width, height)) > 0).reshape(size)


def _keypoints(annotations: list[dict[str, Any]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    points = np.full((len(annotations), len(KEYPOINTS), 2), np.nan)
    codes = np.zeros((len(annotations), len(KEYPOINTS)), dtype=np.int64)
    for i, annotation in enumerate(annotations):
        if "keypoints" not in annotation:
            continue
        table = np.asarray(annotation["keypoints"], dtype=np.float64).reshape(len(KEYPOINTS), 3)
        known = table[:, 2] > 0
        points[i, known] = table[known, :2]
        codes[i] = annotation.get("visibility_detail", table[:, 2].astype(np.int64))
    return points, codes


def _box(annotation: dict[str, Any], points: NDArray[np.float64]) -> NDArray[np.float64]:
    left, top, width, height = (float(value) for value in annotation["bbox"])
    corners = np.array([[left, top], [left + width, top + height]])
    known = points[np.isfinite(points).all(axis=1)]
    corners = np.vstack((corners, known))
    return np.concatenate((corners.min(axis=0), corners.max(axis=0)))


def _ripeness(annotation: dict[str, Any]) -> float:
    return RIPENESS_SHARE.get(annotation.get("ripeness", -1), float("nan"))


def detections_to_coco(items: Iterable[tuple[int, str, Strawberries]]) -> dict[str, Any]:
    """One COCO object of what was found in a series of images.

    Masks are uncompressed run lengths; boxes are xywh; visibility 3 (hidden by something else) is written as
    1 and kept in ``visibility_detail``.

    Parameters
    ----------
    items
        (image id, file name, berries).
    """
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for image_id, file_name, berries in items:
        height, width = berries.image_size
        images.append({"id": image_id, "file_name": file_name, "width": width, "height": height})
        for i in range(len(berries)):
            annotations.append({"id": len(annotations) + 1, "image_id": image_id, **_annotation(berries, i)})
    categories = [
        {"id": 1, "name": "pluckable", "keypoints": list(KEYPOINTS), "skeleton": [[1, 2], [2, 3], [4, 5]]},
        {"id": 2, "name": "unpluckable", "keypoints": list(KEYPOINTS), "skeleton": [[1, 2], [2, 3], [4, 5]]},
    ]
    return {"images": images, "annotations": annotations, "categories": categories}


def _annotation(berries: Strawberries, i: int) -> dict[str, Any]:
    left, top, right, bottom = berries.boxes[i].tolist()
    entry: dict[str, Any] = {
        "category_id": int(berries.classes[i]) + 1,
        "bbox": [left, top, right - left, bottom - top],
        "area": (right - left) * (bottom - top),
        "iscrowd": 0,
        "score": float(berries.scores[i]),
    }
    masks = berries.masks
    if masks is not None:
        entry["segmentation"] = encode_mask(masks[i])
        entry["area"] = int(masks[i].sum())
    if np.isfinite(berries.ripeness[i]):
        entry["ripeness"] = float(berries.ripeness[i])
    if np.isfinite(berries.weights[i]):
        entry["weight_g"] = float(berries.weights[i])
    if berries.keypoints is not None and berries.visibility is not None:
        entry |= _keypoint_fields(berries.keypoints[i], berries.visibility[i])
    return entry


def _keypoint_fields(points: NDArray[np.float64], codes: NDArray[np.int64]) -> dict[str, Any]:
    flags = np.where(codes == Visibility.HIDDEN_BY_OTHER, int(Visibility.HIDDEN_BY_ITSELF), codes)
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    flags = np.where(known, flags, int(Visibility.ABSENT))
    table = np.column_stack((np.where(known[:, None], points, 0.0), flags))
    return {
        "keypoints": [int(v) if k % 3 == 2 else float(v) for k, v in enumerate(table.ravel())],
        "num_keypoints": int((flags > 0).sum()),
        "visibility_detail": codes.tolist(),
    }
