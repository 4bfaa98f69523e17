"""What outlines a berry in a file (polygons, run lengths, labels in a PNG), as pixels and as run lengths.

Polygons are filled by COCO's own rasteriser, so that areas and scores agree with COCO tools to the last pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError, ShapeError
from punnet.scene.masks import decode_mask, encode_mask, run_lengths
from punnet.scene.windows import mask_box

__all__ = [
    "LabelPixels",
    "Segmentation",
    "check_segmentation",
    "decode_segmentation",
    "encode_segmentation",
    "outline_box",
    "read_labels",
]

# Far outside of any image; beyond it COCO's rasteriser would need gigabytes for one outline.
FARTHEST = 1e5
FEWEST_CORNERS = 3


@dataclass(frozen=True, eq=False)
class LabelPixels:
    """A mask as one value in a PNG of instance labels (StrawDI), decoded when asked for.

    Parameters
    ----------
    path
        The PNG, one channel, 8 or 16 bits.
    value
        The pixels of this berry have this value.
    """

    path: Path
    value: int


Segmentation = list[list[float]] | dict[str, Any] | LabelPixels | None


def check_segmentation(segmentation: Segmentation, size: tuple[int, int]) -> Segmentation:
    """Return ``segmentation`` with counts as text, checked against the image size (H, W); files are not opened.

    Raises
    ------
    ShapeError
        If polygons have too few corners or impossible ones, or run lengths are of another image size or damaged.
    """
    if segmentation is None or isinstance(segmentation, LabelPixels):
        return segmentation
    if isinstance(segmentation, dict):
        return _check_run_lengths(segmentation, size)
    if not isinstance(segmentation, list) or not segmentation:
        raise ShapeError("segmentation must be a list of polygons, run lengths, or absent")
    checked = [_check_polygon(polygon) for polygon in segmentation]
    same = all(new is old for new, old in zip(checked, segmentation, strict=True))
    return segmentation if same else checked


def _check_run_lengths(segmentation: dict[str, Any], size: tuple[int, int]) -> dict[str, Any]:
    found = segmentation.get("size")
    if not isinstance(found, list | tuple) or tuple(found) != size:
        raise ShapeError(f"segmentation: run lengths are of size {found}, the image is {list(size)} (H, W)")
    try:
        run_lengths(segmentation)
    except FileFormatError as error:
        raise ShapeError(f"segmentation: {error}") from error
    counts = segmentation["counts"]
    return {**segmentation, "counts": counts.decode("ascii")} if isinstance(counts, bytes) else segmentation


def _check_polygon(polygon: Any) -> list[float]:
    values: list[float] = polygon if isinstance(polygon, list) else []
    if len(values) % 2 or len(values) < 2 * FEWEST_CORNERS:
        raise ShapeError(
            f"segmentation: a polygon needs {FEWEST_CORNERS} or more corners, x and y each, got {len(values)} numbers"
        )
    if not all(type(value) is float for value in values):
        try:
            values = [float(value) for value in values]
        except (TypeError, ValueError, OverflowError) as error:
            raise ShapeError(
                f"segmentation: a polygon holds something that is no number ({error})"
            ) from error
    if not math.isfinite(sum(values)) or max(values) > FARTHEST or min(values) < -FARTHEST:
        raise ShapeError("segmentation: a polygon has a corner that is no number or far outside of any image")
    return values


def decode_segmentation(segmentation: Segmentation, size: tuple[int, int]) -> NDArray[np.bool_] | None:
    """(H, W) bool of a checked segmentation, None if there is none.

    Raises
    ------
    FileFormatError
        If a PNG of labels is missing, no image, or of another size.
    """
    if segmentation is None:
        return None
    if isinstance(segmentation, LabelPixels):
        return np.asarray(read_labels(segmentation.path, size) == segmentation.value)
    return decode_mask(_as_run_lengths(segmentation, size))


def encode_segmentation(
    segmentation: Segmentation, size: tuple[int, int]
) -> tuple[list[list[float]] | dict[str, Any] | None, float | None]:
    """Return what a COCO file holds for it, polygons or compressed run lengths, and its area in pixels.

    Raises
    ------
    FileFormatError
        If a PNG of labels is missing, no image, or of another size.
    """
    if segmentation is None:
        return None, None
    if isinstance(segmentation, LabelPixels):
        mask = np.asarray(read_labels(segmentation.path, size) == segmentation.value)
        return encode_mask(mask), int(mask.sum())
    _, counts = run_lengths(_as_run_lengths(segmentation, size))
    area = int(counts[1::2].sum())
    if isinstance(segmentation, list) or isinstance(segmentation["counts"], str):
        return segmentation, area
    return {**segmentation, **encode_mask(decode_mask(segmentation))}, area


def outline_box(segmentation: Segmentation, size: tuple[int, int]) -> NDArray[np.float64] | None:
    """(4,) xyxy box around a segmentation; None without one, or where it has no pixel."""
    if isinstance(segmentation, list):
        corners = np.concatenate([np.asarray(polygon).reshape(-1, 2) for polygon in segmentation])
        return np.concatenate((corners.min(axis=0), corners.max(axis=0)))
    mask = decode_segmentation(segmentation, size)
    if mask is None:
        return None
    left, top, right, bottom = mask_box(mask)
    return None if left == right else np.array((left, top, right, bottom), dtype=np.float64)


def read_labels(path: Path, size: tuple[int, int]) -> NDArray[np.integer[Any]]:
    """Read a PNG of instance labels as (H, W) integers.

    Raises
    ------
    FileFormatError
        If it is missing, no image, of more than one channel or of another size.
    """
    try:
        stamp = path.stat().st_mtime_ns
    except (OSError, ValueError):  # missing, or a name that no file can have
        labels = None
    else:
        labels = _decoded_labels(path, stamp)
    if labels is None or labels.shape != size:
        found = "missing or no image" if labels is None else f"of shape {labels.shape}"
        raise FileFormatError(f"{path}: {found}; one channel of instance labels, {size}, is needed")
    return labels


@lru_cache(maxsize=2)
def _decoded_labels(path: Path, stamp: int) -> NDArray[np.integer[Any]] | None:
    """Decode a PNG once for all berries of its image, which are asked for one by one; ``stamp`` tells versions apart."""
    labels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    return None if labels is None else np.asarray(labels)


def _as_run_lengths(
    segmentation: list[list[float]] | dict[str, Any], size: tuple[int, int]
) -> dict[str, Any]:
    if isinstance(segmentation, dict):
        return segmentation
    # Loads slowly, hence here.
    from faster_coco_eval.core import mask as rasteriser

    height, width = size
    filled: dict[str, Any] = rasteriser.segmToRle(segmentation, width, height)
    return filled
