"""Masks as COCO run lengths: column by column, counts alternating between background and berry.

Written here rather than taken from a COCO package so that the containers need NumPy alone, and because one
filled run at a time is quicker than that package's decoder. Compressed counts are COCO's: differences to the count
before the last one, five bits a character.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError

__all__ = ["decode_mask", "encode_mask", "run_lengths"]

MOST_PIXELS = 2**28
# Characters are 48 … 111: five bits of value, one that says whether more follow.
FIRST_CHARACTER, VALUE_BITS, MORE, SIGN = 48, 5, 32, 16
MOST_CHARACTERS = 7


def encode_mask(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """(H, W) bool to ``{"size": [H, W], "counts": "…"}``, COCO's compressed run lengths."""
    pixels = np.asarray(mask, dtype=np.bool_)
    height, width = pixels.shape
    columns = np.flatnonzero(pixels.any(axis=0))
    if not columns.size:
        return {"size": [height, width], "counts": _compress(np.array([height * width]))}
    # Only the columns from the first berry pixel to the last: a berry is a small part of its image.
    first = int(columns[0])
    flat = np.concatenate(([False], pixels[:, first : int(columns[-1]) + 1].ravel(order="F"), [False]))
    edges = np.flatnonzero(flat[1:] != flat[:-1]) + first * height
    counts = np.diff(edges, prepend=0, append=height * width)
    if counts[-1] == 0:
        counts = counts[:-1]
    return {"size": [height, width], "counts": _compress(counts)}


def decode_mask(segmentation: dict[str, Any]) -> NDArray[np.bool_]:
    """(H, W) bool of run lengths, compressed (text or bytes) or a list of counts.

    Raises
    ------
    FileFormatError
        If a field is missing, damaged, or the counts do not add up to the size.
    """
    (height, width), counts = run_lengths(segmentation)
    mask = np.zeros((height, width), dtype=np.bool_)
    ends = np.cumsum(counts)
    starts, stops = ends[0 : len(ends) - 1 : 2], ends[1::2]
    if not len(stops):
        return mask
    # Only the columns from the first berry pixel to the last: a berry is a small part of its image.
    first, last = int(starts[0]) // height, -(-int(stops[-1]) // height)
    columns = np.zeros((last - first) * height, dtype=np.bool_)
    for start, stop in zip(
        (starts - first * height).tolist(), (stops - first * height).tolist(), strict=True
    ):
        columns[start:stop] = True
    mask[:, first:last] = columns.reshape((height, last - first), order="F")
    return mask


def run_lengths(segmentation: dict[str, Any]) -> tuple[tuple[int, int], NDArray[np.int64]]:
    """Return the (H, W) and the counts, checked, of run lengths in any of COCO's forms.

    Raises
    ------
    FileFormatError
        If a field is missing, damaged, or the counts do not add up to the size.
    """
    try:
        height, width = (int(size) for size in segmentation["size"])
        counts = segmentation["counts"]
        plain = _decompress(counts) if isinstance(counts, str | bytes) else np.asarray(counts, dtype=np.int64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"mask: run lengths need a size [H, W] and counts ({error})") from error
    if height < 1 or width < 1 or height * width > MOST_PIXELS:
        raise FileFormatError(f"mask: size {height}×{width}; 1 to {MOST_PIXELS} pixels are possible")
    total = height * width
    if plain.ndim != 1 or (plain < 0).any() or (plain > total).any() or plain.sum() != total:
        raise FileFormatError(
            f"mask: run lengths do not add up; size {height}×{width} needs {total} pixels in all"
        )
    return (height, width), plain


def _compress(counts: NDArray[np.int64]) -> str:
    values = counts.astype(np.int64)
    values[3:] -= counts[1:-2]
    groups = values[:, None] >> (VALUE_BITS * np.arange(MOST_CHARACTERS + 1))
    bits = groups[:, :-1] & (MORE - 1)
    more = np.where(bits & SIGN, groups[:, 1:] != -1, groups[:, 1:] != 0)
    needed = np.hstack((np.ones((len(values), 1), dtype=np.bool_), np.logical_and.accumulate(more, axis=1)))
    characters = (bits + MORE * more + FIRST_CHARACTER).astype(np.uint8)
    return str(characters[needed[:, :-1]].tobytes(), "ascii")


def _decompress(text: str | bytes) -> NDArray[np.int64]:
    encoded = text.encode("ascii") if isinstance(text, str) else text
    characters = np.frombuffer(encoded, dtype=np.uint8).astype(np.int64) - FIRST_CHARACTER
    if not characters.size:
        return np.zeros(0, dtype=np.int64)
    if (characters < 0).any() or (characters >= 2 * MORE).any() or characters[-1] & MORE:
        raise ValueError("compressed counts are cut off or hold foreign characters")
    last = np.flatnonzero((characters & MORE) == 0)
    first = np.concatenate(([0], last[:-1] + 1))
    lengths = last - first + 1
    if lengths.max() > MOST_CHARACTERS:
        raise ValueError("a compressed count is too large")
    shifts = VALUE_BITS * (np.arange(characters.size) - np.repeat(first, lengths))
    values = np.add.reduceat((characters & (MORE - 1)) << shifts, first)
    values -= np.where(characters[last] & SIGN, np.int64(1) << (VALUE_BITS * lengths), 0)
    # From the fourth on, differences to the count before the last: two interleaved sums.
    values[1::2] = np.cumsum(values[1::2])
    values[2::2] = np.cumsum(values[2::2])
    return np.asarray(values, dtype=np.int64)
