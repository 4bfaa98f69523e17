"""What berries and key-points are taken for, and which berries are missed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import STAGES
from punnet.perception.comparing import BerryRecord, ImageRecord
from punnet.scene import CLASSES, Visibility

__all__ = [
    "Confusion",
    "FoundShare",
    "confuse_classes",
    "confuse_stages",
    "confuse_visibility",
    "found_by_occlusion",
    "found_by_size",
    "ripeness_error",
]

MISSED, NO_BERRY = "missed", "no berry"
SHOWN_AS = ("absent", "hidden by itself", "visible", "hidden by other")
SIZE_EDGES = (0.0, 16.0, 32.0, 64.0, 128.0, math.inf)
OCCLUSION_EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Confusion:
    """Counts of what is what (rows) by what it was taken for (columns)."""

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    counts: NDArray[np.int64]

    @property
    def accuracy(self) -> float:
        """Share on the diagonal; NaN without any count, or where rows and columns are not the same things."""
        total = int(self.counts.sum())
        return float(np.trace(self.counts)) / total if total and self.rows == self.columns else math.nan

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        accuracy = self.accuracy
        return {
            "rows": list(self.rows),
            "columns": list(self.columns),
            "counts": self.counts.tolist(),
            **({} if math.isnan(accuracy) else {"accuracy": round(accuracy, 6)}),
        }


def confuse_classes(images: Sequence[ImageRecord]) -> Confusion:
    """Annotated class by found class; the last column is missed berries, the last row detections that are none."""
    counts = np.zeros((len(CLASSES) + 1, len(CLASSES) + 1), dtype=np.int64)
    for image in images:
        for berry in image.berries:
            counts[berry.berry_class, _column(berry)] += 1
        for false in image.false_classes:
            counts[-1, false] += 1
    return Confusion((*CLASSES, NO_BERRY), (*CLASSES, MISSED), counts)


def confuse_stages(berries: Iterable[BerryRecord]) -> Confusion | None:
    """Colour stage by found class; None where no stage is annotated."""
    staged = [(berry.stage, berry) for berry in berries if berry.stage is not None]
    if not staged:
        return None
    known = {stage for stage, _ in staged}
    stages = tuple(stage for stage in STAGES if stage in known)
    counts = np.zeros((len(stages), len(CLASSES) + 1), dtype=np.int64)
    for stage, berry in staged:
        counts[stages.index(stage), _column(berry)] += 1
    return Confusion(stages, (*CLASSES, MISSED), counts)


def confuse_visibility(berries: Iterable[BerryRecord]) -> Confusion | None:
    """Annotated by found visibility of all key-points of the berries that were found.

    Berries without any annotated key-point are left out; None if that leaves none.
    """
    counts = np.zeros((len(Visibility), len(Visibility)), dtype=np.int64)
    for berry in berries:
        if berry.found_visibility is not None and (berry.visibility != Visibility.ABSENT).any():
            np.add.at(counts, (berry.visibility, berry.found_visibility), 1)
    return Confusion(SHOWN_AS, SHOWN_AS, counts) if counts.any() else None


def ripeness_error(berries: Iterable[BerryRecord]) -> tuple[float, int]:
    """Mean absolute error of ripeness (0…1), and over how many found berries of known ripeness; NaN for none."""
    errors = np.array([berry.ripeness - berry.found_ripeness for berry in berries])
    known = np.abs(errors[np.isfinite(errors)])
    return (float(known.mean()) if known.size else math.nan), int(known.size)


@dataclass(frozen=True, slots=True)
class FoundShare:
    """Of the berries from ``least`` up to ``most``: how many, how many found, how many found and rightly named."""

    least: float
    most: float
    berries: int
    found: int
    rightly_named: int

    def to_json(self) -> dict[str, Any]:
        """Plain JSON; an open end is null, and so are shares of nothing."""
        return {
            "from": self.least,
            "to": self.most if math.isfinite(self.most) else None,
            "berries": self.berries,
            "found": round(self.found / self.berries, 6) if self.berries else None,
            "rightly_named": round(self.rightly_named / self.berries, 6) if self.berries else None,
        }


def found_by_size(berries: Sequence[BerryRecord]) -> list[FoundShare]:
    """Recall by √(mask area) in pixels."""
    return _shares(berries, [berry.size for berry in berries], SIZE_EDGES)


def found_by_occlusion(berries: Sequence[BerryRecord]) -> list[FoundShare]:
    """Recall by the share of the fruit that something else hides; empty where no occlusion is annotated."""
    return _shares(berries, [berry.occlusion for berry in berries], OCCLUSION_EDGES)


def _shares(
    berries: Sequence[BerryRecord], values: Sequence[float], edges: Sequence[float]
) -> list[FoundShare]:
    known = [(berry, value) for berry, value in zip(berries, values, strict=True) if math.isfinite(value)]
    if not known:
        return []
    # The last bin is closed: a berry may be hidden whole.
    bins = np.clip(np.searchsorted(edges, [value for _, value in known], side="right") - 1, 0, len(edges) - 2)
    shares = []
    for index in range(len(edges) - 1):
        chosen = [berry for (berry, _), place in zip(known, bins, strict=True) if place == index]
        found = sum(berry.found_class is not None for berry in chosen)
        right = sum(berry.found_class == berry.berry_class for berry in chosen)
        shares.append(FoundShare(edges[index], edges[index + 1], len(chosen), found, right))
    return shares


def _column(berry: BerryRecord) -> int:
    return len(CLASSES) if berry.found_class is None else berry.found_class
