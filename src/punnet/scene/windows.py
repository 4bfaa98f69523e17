"""The part of an image that matters to one berry."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["berry_box", "mask_box", "mask_window"]


def mask_box(mask: NDArray[Any]) -> tuple[int, int, int, int]:
    """Xyxy edges of a mask (H, W), bool or uint8: left, top, right, bottom; four zeros of an empty one."""
    left, top, width, height = cv2.boundingRect(np.ascontiguousarray(mask).view(np.uint8))
    return left, top, left + width, top + height


def mask_window(mask: NDArray[Any], margin: int = 0) -> tuple[slice, slice]:
    """Rows and columns of a mask (H, W) and ``margin`` pixels around it, within the image; nothing of an empty one."""
    left, top, right, bottom = mask_box(mask)
    if left == right:
        return slice(0, 0), slice(0, 0)
    return (
        slice(max(0, top - margin), min(mask.shape[0], bottom + margin)),
        slice(max(0, left - margin), min(mask.shape[1], right + margin)),
    )


def berry_box(mask: NDArray[Any], keypoints: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Xyxy box (4,) that holds a mask (H, W) and those key-points (5, 2) that are known; None of an empty mask."""
    left, top, right, bottom = mask_box(mask)
    if left == right:
        return None
    known = keypoints[np.isfinite(keypoints).all(axis=1)]
    low = np.minimum((left, top), known.min(axis=0, initial=np.inf))
    high = np.maximum((right, bottom), known.max(axis=0, initial=-np.inf))
    return np.concatenate((low, high))
