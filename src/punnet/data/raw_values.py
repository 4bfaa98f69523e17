"""Values as they stand in a JSON file: what checks and repairs of annotations need to look at them without raising."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "EDGE_TOLERANCE",
    "LARGEST",
    "Finding",
    "Surroundings",
    "corners_of",
    "is_number",
    "is_whole",
    "lacks_number",
    "numbers_of",
]

LARGEST = 1e15
"""Beyond it nothing in a picture can be: such numbers are taken for infinite."""

EDGE_TOLERANCE = 1.0
"""Pixels by which a box, polygon or key-point may pass an edge: tools count pixels by corner or by centre."""

Finding = tuple[str, str]
"""Code of a fault and its message."""


@dataclass(frozen=True)
class Surroundings:
    """What an annotation is checked against.

    Parameters
    ----------
    width, height
        Of the image in pixels, None if the file does not say.
    categories
        Ids that the file lists.
    graded
        True if ``ripeness`` is a grade 0 … 4, as PSD has it, and not a share.
    """

    width: float | None
    height: float | None
    categories: frozenset[Any]
    graded: bool

    @classmethod
    def of(cls, image: dict[str, Any] | None, categories: frozenset[Any], *, graded: bool) -> Surroundings:
        """Read the size from an image's entry; None if the image is not listed."""
        width, height = (None if image is None else image.get(name) for name in ("width", "height"))
        return cls(
            float(width) if width is not None and is_number(width) else None,
            float(height) if height is not None and is_number(height) else None,
            categories,
            graded,
        )


def is_number(value: Any) -> bool:
    """Tell whether a JSON value is a finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= LARGEST


def is_whole(value: Any) -> bool:
    """Tell whether a JSON value is a whole number of 64 bits."""
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63


def numbers_of(value: Any, length: int) -> NDArray[np.float64] | None:
    """Give a list of ``length`` finite numbers as an array, None if it is anything else."""
    if not isinstance(value, list) or len(value) != length or not all(map(is_number, value)):
        return None
    return np.array(value, dtype=np.float64)


def corners_of(polygon: Any) -> NDArray[np.float64] | None:
    """Corners (N, 2) of a flat list x, y, x, y, …, NaN where one is infinite; None if it is anything else."""
    if not isinstance(polygon, list) or len(polygon) % 2:
        return None
    if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in polygon):
        return None
    return np.array([value if is_number(value) else np.nan for value in polygon]).reshape(-1, 2)


def lacks_number(value: Any) -> bool:
    """Tell whether NaN or infinity is anywhere in a JSON value."""
    if isinstance(value, int | float):
        return not is_number(value) and not isinstance(value, bool)
    if isinstance(value, dict):
        return any(map(lacks_number, value.values()))
    return isinstance(value, list) and any(map(lacks_number, value))
