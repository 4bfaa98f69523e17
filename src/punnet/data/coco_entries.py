"""One entry of a COCO file to one :class:`~punnet.data.dataset.Annotation`, and back (docs/data.md has the fields)."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.class_names import same_name
from punnet.data.dataset import AnnotatedImage, Annotation
from punnet.data.reading import integer, number, numbers
from punnet.data.segmentation import Segmentation, check_segmentation, encode_segmentation, outline_box
from punnet.errors import FileFormatError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import KEYPOINTS, Visibility

__all__ = [
    "Order",
    "annotation_to_entry",
    "entry_to_annotation",
    "entry_to_camera",
    "image_to_entry",
    "keypoint_order",
    "read_keypoints",
    "relative",
]

# Fields that become fields of an annotation, or follow from those.
FIELDS = frozenset(
    {"id", "image_id", "category_id", "bbox", "area", "iscrowd", "segmentation", "keypoints", "num_keypoints"}
    | {"visibility_detail", "ripeness", "stage", "occlusion", "weight_g", "keypoint_depths_m"}
)
Order = Sequence[int]
"""Where in the file each of the five key-points stands."""


def entry_to_annotation(
    entry: dict[str, Any],
    identity: int,
    class_index: int,
    size: tuple[int, int],
    where: str,
    order: Order | None = None,
) -> Annotation:
    """Read an entry whose class is known.

    Parameters
    ----------
    entry
        The JSON object; ``bbox`` is xywh.
    identity
        The annotation's id.
    class_index
        0 pluckable, 1 unpluckable.
    size
        (H, W) of its image.
    where
        File and annotation, for messages.
    order
        See :data:`Order`; the usual one if None.

    Raises
    ------
    FileFormatError
        If a field is missing, of the wrong kind or out of its range.
    """
    segmentation = _segmentation(entry, size, where)
    points, codes = read_keypoints(entry, where, order)
    depths = entry.get("keypoint_depths_m")
    stage = entry.get("stage")
    try:
        return Annotation(
            id=identity,
            class_index=class_index,
            box=_box(entry, segmentation, points, size, where),
            segmentation=segmentation,
            keypoints=points,
            visibility=codes,
            crowd=bool(integer(entry.get("iscrowd") or 0, f"{where}: iscrowd")),
            ripeness=_optional(entry, "ripeness", where),
            stage=None if stage is None else str(stage),
            occlusion=_optional(entry, "occlusion", where),
            weight=_optional(entry, "weight_g", where),
            keypoint_depths=None if depths is None else _depths(depths, where, order),
            extra={name: value for name, value in entry.items() if name not in FIELDS},
        )
    except ShapeError as error:
        raise FileFormatError(f"{where}: {error}") from error


def _segmentation(entry: dict[str, Any], size: tuple[int, int], where: str) -> Segmentation:
    given = entry.get("segmentation")
    if given is None or given == [] or given == [[]]:
        return None
    try:
        return check_segmentation(given, size)
    except ShapeError as error:
        raise FileFormatError(f"{where}: {error}") from error


def _box(
    entry: dict[str, Any],
    segmentation: Segmentation,
    points: NDArray[np.float64] | None,
    size: tuple[int, int],
    where: str,
) -> NDArray[np.float64]:
    if entry.get("bbox") is not None:
        left, top, width, height = numbers(entry["bbox"], 4, f"{where}: bbox")
        return np.array([left, top, left + width, top + height])
    box = outline_box(segmentation, size)
    if box is None and points is not None and np.isfinite(points).any():
        box = np.concatenate((np.nanmin(points, axis=0), np.nanmax(points, axis=0)))
    if box is None:
        raise FileFormatError(f"{where}: has no bbox, segmentation or key-points; one of them is needed")
    return box


def read_keypoints(
    entry: dict[str, Any], where: str, order: Order | None = None
) -> tuple[NDArray[np.float64] | None, NDArray[np.int64] | None]:
    """(5, 2) points and (5,) visibility codes of an entry; None twice if nobody annotated its key-points.

    Not annotated are those of an entry without ``keypoints``, and, as COCO has it, those whose flags are all 0; with
    ``visibility_detail`` the latter were looked for and are absent.

    Raises
    ------
    FileFormatError
        If there are not five, a flag is not 0, 1 or 2, or ``visibility_detail`` contradicts them.
    """
    given = entry.get("keypoints")
    if given is None or given == []:
        return None, None
    table = np.array(numbers(given, 3 * len(KEYPOINTS), f"{where}: keypoints")).reshape(-1, 3)
    flags = table[:, 2].astype(np.int64)
    if not all(flag in (0.0, 1.0, 2.0) for flag in table[:, 2].tolist()):
        raise FileFormatError(f"{where}: keypoints: visibility must be 0, 1 or 2, got {table[:, 2].tolist()}")
    if not flags.any() and entry.get("visibility_detail") is None:
        return None, None
    codes = flags
    if entry.get("visibility_detail") is not None:
        detail = numbers(entry["visibility_detail"], len(KEYPOINTS), f"{where}: visibility_detail")
        codes = np.array([integer(code, f"{where}: visibility_detail") for code in detail], dtype=np.int64)
        if ((codes == Visibility.ABSENT) != (flags == Visibility.ABSENT)).any():
            raise FileFormatError(
                f"{where}: visibility_detail {codes.tolist()} contradicts the keypoints' {flags.tolist()}"
            )
    points = np.where((flags > 0)[:, None], table[:, :2], np.nan)
    return (points, codes) if order is None else (points[list(order)], codes[list(order)])


def keypoint_order(names: Any, where: str) -> Order | None:
    """Where each of the five key-points stands among ``names``; None for the usual order, numbers, and no names.

    Raises
    ------
    FileFormatError
        If they are other key-points.
    """
    if not isinstance(names, list) or not names:
        return None
    compared = [same_name(str(name)) for name in names]
    if compared == list(KEYPOINTS) or compared == [str(k + 1) for k in range(len(KEYPOINTS))]:
        return None
    if sorted(compared) != sorted(KEYPOINTS):
        raise FileFormatError(f"{where} has the key-points {names}; they must be {', '.join(KEYPOINTS)}")
    return [compared.index(name) for name in KEYPOINTS]


def _depths(given: Any, where: str, order: Order | None) -> NDArray[np.float64]:
    where = f"{where}: keypoint_depths_m"
    if not isinstance(given, list) or len(given) != len(KEYPOINTS):
        raise FileFormatError(f"{where}: {len(KEYPOINTS)} numbers or nulls are needed")
    depths = np.array([math.nan if depth is None else number(depth, where) for depth in given])
    return depths if order is None else depths[list(order)]


def _optional(entry: dict[str, Any], name: str, where: str) -> float:
    return math.nan if entry.get(name) is None else number(entry[name], f"{where}: {name}")


def annotation_to_entry(annotation: Annotation, image: AnnotatedImage) -> dict[str, Any]:
    """Give the JSON object of an annotation; masks as polygons or compressed run lengths, box as xywh.

    Raises
    ------
    FileFormatError
        If its mask is in a file that is missing or damaged.
    """
    left, top, right, bottom = annotation.box.tolist()
    entry: dict[str, Any] = {
        **annotation.extra,
        "id": annotation.id,
        "image_id": image.id,
        "category_id": annotation.class_index + 1,
        "bbox": [left, top, right - left, bottom - top],
        "area": (right - left) * (bottom - top),
        "iscrowd": int(annotation.crowd),
    }
    segmentation, area = encode_segmentation(annotation.segmentation, image.size)
    if segmentation is not None:
        entry |= {"segmentation": segmentation, "area": area}
    if annotation.keypoints is not None and annotation.visibility is not None:
        entry |= _keypoint_fields(annotation.keypoints, annotation.visibility)
    for name, value in (
        ("ripeness", annotation.ripeness),
        ("occlusion", annotation.occlusion),
        ("weight_g", annotation.weight),
    ):
        if math.isfinite(value):
            entry[name] = float(value)
    if annotation.stage is not None:
        entry["stage"] = annotation.stage
    if annotation.keypoint_depths is not None:
        entry["keypoint_depths_m"] = [
            depth if math.isfinite(depth) else None for depth in annotation.keypoint_depths.tolist()
        ]
    return entry


def _keypoint_fields(points: NDArray[np.float64], codes: NDArray[np.int64]) -> dict[str, Any]:
    flags = np.where(codes == Visibility.HIDDEN_BY_OTHER, int(Visibility.HIDDEN_BY_ITSELF), codes)
    known = (codes != Visibility.ABSENT)[:, None]
    flat: list[float] = []
    for (u, v), flag in zip(np.where(known, points, 0.0).tolist(), flags.tolist(), strict=True):
        flat += [u, v, flag]
    return {
        "keypoints": flat,
        "num_keypoints": int((flags > 0).sum()),
        "visibility_detail": codes.tolist(),
    }


def entry_to_camera(entry: dict[str, Any], where: str) -> CameraIntrinsics | None:
    """Intrinsics of an image's entry, None if it has none.

    Raises
    ------
    FileFormatError
        If they are incomplete or impossible.
    """
    given = entry.get("camera")
    if given is None:
        return None
    if not isinstance(given, dict):
        raise FileFormatError(f"{where}: camera must be an object with width height fx fy cx cy")
    try:
        return CameraIntrinsics.from_json(given, where=f"{where}: camera")
    except (ShapeError, OverflowError) as error:
        raise FileFormatError(f"{where}: {error}") from error


def image_to_entry(image: AnnotatedImage, folder: Path) -> dict[str, Any]:
    """Give the JSON object of an image, its paths relative to ``folder``."""
    entry: dict[str, Any] = {
        **image.extra,
        "id": image.id,
        "file_name": relative(image.path, folder),
        "width": image.width,
        "height": image.height,
    }
    if image.depth_path is not None:
        entry["depth_path"] = relative(image.depth_path, folder)
    if image.camera is not None:
        entry["camera"] = image.camera.to_json()
    if image.group is not None:
        entry["group"] = image.group
    return entry


def relative(path: Path, folder: Path) -> str:
    """``path`` as seen from ``folder``, with forward slashes; right for linked folders too."""
    return Path(os.path.relpath(path.parent.resolve() / path.name, folder.resolve())).as_posix()
