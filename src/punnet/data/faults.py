"""Faults of annotation files: their codes, how bad each is, and the report that lists them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

__all__ = ["FAULTS", "CountedFaults", "Fault", "FaultReport", "Severity"]


class Severity(StrEnum):
    """``error``: the label can't be used or is wrong. ``warning``: it can be used, but is not what it should be."""

    ERROR = "error"
    WARNING = "warning"


FAULTS: dict[str, Severity] = {
    # of the file
    "category-field": Severity.ERROR,
    "foreign-class": Severity.WARNING,
    # of images
    "image-field": Severity.ERROR,
    "duplicate-image-id": Severity.ERROR,
    "duplicate-file-name": Severity.WARNING,
    "missing-image": Severity.ERROR,
    "unreadable-image": Severity.ERROR,
    "size-mismatch": Severity.ERROR,
    "missing-depth": Severity.ERROR,
    # of annotations
    "annotation-field": Severity.ERROR,
    "duplicate-annotation-id": Severity.ERROR,
    "unlisted-image": Severity.ERROR,
    "unknown-class": Severity.ERROR,
    "not-finite": Severity.ERROR,
    "out-of-range": Severity.ERROR,
    "bad-box": Severity.ERROR,
    "empty-box": Severity.ERROR,
    "box-outside-image": Severity.ERROR,
    "bad-polygon": Severity.ERROR,
    "short-polygon": Severity.ERROR,
    "polygon-outside-image": Severity.WARNING,
    "bad-rle": Severity.ERROR,
    "rle-size": Severity.ERROR,
    "empty-mask": Severity.ERROR,
    "area-mismatch": Severity.WARNING,
    "keypoint-count": Severity.ERROR,
    "keypoint-code": Severity.ERROR,
    "keypoint-outside-box": Severity.ERROR,
    "keypoint-outside-image": Severity.WARNING,
    "keypoint-total": Severity.WARNING,
    "visibility-contradiction": Severity.ERROR,
}
"""Every code there is, with its severity. Codes are stable: scripts may rely on them."""


@dataclass(frozen=True)
class Fault:
    """One thing wrong with one image or annotation.

    Parameters
    ----------
    code
        A key of :data:`FAULTS`.
    message
        What is wrong, and what to do.
    file
        The annotation file.
    image_id, file_name
        The image, None if it is not known.
    annotation_id
        The annotation, None if it is the image that has the fault. Ids are given as they stand in the file.
    position
        Where its entry stands in the file's list, from 0; None for a fault of the whole file.
    """

    code: str
    message: str
    file: Path
    image_id: Any = None
    file_name: str | None = None
    annotation_id: Any = None
    position: int | None = None

    def __post_init__(self) -> None:
        if self.code not in FAULTS:
            raise KeyError(f"{self.code!r} is not a fault; known: {', '.join(FAULTS)}")

    @property
    def severity(self) -> Severity:
        """How bad it is."""
        return FAULTS[self.code]

    @property
    def where(self) -> str:
        """Image and annotation in words."""
        image = None if self.image_id is None else f"image {self.image_id!r}"
        annotation = None if self.annotation_id is None else f"annotation {self.annotation_id!r}"
        return ", ".join(part for part in (self.file_name or image, annotation) if part) or "the file"

    def __str__(self) -> str:
        return f"{self.file}: {self.where}: {self.code}: {self.message}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "code": self.code,
            "severity": str(self.severity),
            "file": str(self.file),
            "image_id": _plain(self.image_id),
            "file_name": self.file_name,
            "annotation_id": _plain(self.annotation_id),
            "message": self.message,
        }


class _AnyFault(Protocol):
    @property
    def code(self) -> str: ...

    @property
    def severity(self) -> Severity: ...

    def to_json(self) -> dict[str, Any]: ...


class CountedFaults:
    """What reports of all kinds tell of their ``faults``."""

    faults: Sequence[_AnyFault]

    @property
    def errors(self) -> int:
        """How many faults are errors."""
        return sum(fault.severity is Severity.ERROR for fault in self.faults)

    @property
    def warnings(self) -> int:
        """How many faults are warnings."""
        return len(self.faults) - self.errors

    @property
    def by_code(self) -> dict[str, int]:
        """Count of each code that occurs, most frequent first."""
        return dict(Counter(fault.code for fault in self.faults).most_common())

    def counted(self) -> dict[str, Any]:
        """The counts and the faults, plain values."""
        return {
            "errors": self.errors,
            "warnings": self.warnings,
            "by_code": self.by_code,
            "faults": [fault.to_json() for fault in self.faults],
        }


@dataclass(frozen=True)
class FaultReport(CountedFaults):
    """What a validator found in a file.

    Parameters
    ----------
    path
        The annotation file.
    images, annotations
        How many it lists.
    faults
        What is wrong, in the order of the file.
    """

    path: Path
    images: int
    annotations: int
    faults: tuple[Fault, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "file": str(self.path),
            "images": self.images,
            "annotations": self.annotations,
            **self.counted(),
        }


def _plain(value: Any) -> Any:
    """An id as it stands, or in words where JSON could not hold it."""
    is_plain = value is None or isinstance(value, str | bool | int)
    return value if is_plain or (isinstance(value, float) and value == value) else repr(value)
