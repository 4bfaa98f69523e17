"""Masks as COCO run lengths: column by column, counts alternating between background and berry.

Written here rather than taken from a COCO package so that the containers need NumPy alone; the uncompressed form
is plain JSON and every COCO tool reads it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError

__all__ = ["decode_mask", "encode_mask"]


def encode_mask(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """(H, W) bool to ``{"size": [H, W], "counts": [...]}``."""
    flat = np.asarray(mask, dtype=np.bool_).ravel(order="F")
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff(np.concatenate(([0], edges, [flat.size])))
    if flat.size and flat[0]:
        counts = np.concatenate(([0], counts))
    return {"size": [int(mask.shape[0]), int(mask.shape[1])], "counts": counts.tolist()}


def decode_mask(segmentation: dict[str, Any]) -> NDArray[np.bool_]:
    """Inverse of :func:`encode_mask`.

    Raises
    ------
    FileFormatError
        If the counts do not add up to the size.
    """
    height, width = (int(size) for size in segmentation["size"])
    counts = np.asarray(segmentation["counts"], dtype=np.int64)
    if (counts < 0).any() or counts.sum() != height * width:
        raise FileFormatError(
            f"mask: run lengths add up to {counts.sum()}, size {height}×{width} needs {height * width}"
        )
    values = np.arange(len(counts)) % 2 == 1
    return np.repeat(values, counts).reshape((height, width), order="F")
