"""The interface of every weight estimator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.scene import Frame, Strawberries

__all__ = ["WEIGHT_LIMITS", "WeightEstimates", "WeightEstimator", "gather_estimates"]

WEIGHT_LIMITS = (0.2, 120.0)
"""Grams between which a result is believed to be a berry's."""


@dataclass(frozen=True, eq=False)
class WeightEstimates:
    """Grams for N berries.

    Parameters
    ----------
    grams
        (N,) float, NaN where no estimate could be made.
    intervals
        (N, 2) float, lower and upper bound of the ``coverage`` interval, NaN where no estimate could be made.
    reasons
        N entries: None where there is an estimate, else why there is none.
    coverage
        Nominal share of berries whose true weight lies in its interval.
    """

    grams: NDArray[np.float64]
    intervals: NDArray[np.float64]
    reasons: tuple[str | None, ...]
    coverage: float = 0.9

    def __post_init__(self) -> None:
        n = len(self.reasons)
        if self.grams.shape != (n,) or self.intervals.shape != (n, 2):
            raise ShapeError(
                f"weights: need ({n},) and ({n}, 2), got {self.grams.shape} and {self.intervals.shape}"
            )
        missing = np.isnan(self.grams)
        if any((reason is None) == bool(gone) for reason, gone in zip(self.reasons, missing, strict=True)):
            raise ShapeError("weights: a NaN needs a reason, and grams must have none")


@runtime_checkable
class WeightEstimator(Protocol):
    """Weighs berries by eye."""

    name: str

    def estimate(self, frame: Frame, berries: Strawberries) -> WeightEstimates:
        """Grams with an interval for each of ``berries``; NaN with a reason where the frame can't tell."""
        ...


def gather_estimates(answers: Sequence[tuple[float, float, float] | str], coverage: float) -> WeightEstimates:
    """Put together what was found of N berries.

    Parameters
    ----------
    answers
        For each berry grams, lower and upper bound, or the reason why there are none. Grams outside
        :data:`WEIGHT_LIMITS` become a reason too: a wild number is worse than none.
    coverage
        Of the intervals.
    """
    grams, intervals = np.full(len(answers), np.nan), np.full((len(answers), 2), np.nan)
    reasons: list[str | None] = []
    for i, answer in enumerate(answers):
        if isinstance(answer, str):
            reasons.append(answer)
            continue
        reasons.append(_disbelieved(answer[0]))
        if reasons[-1] is None:
            grams[i], intervals[i] = answer[0], answer[1:]
    return WeightEstimates(grams, intervals, tuple(reasons), coverage)


def _disbelieved(grams: float) -> str | None:
    low, high = WEIGHT_LIMITS
    if math.isfinite(grams) and low <= grams <= high:
        return None
    return f"{grams:.3g} g is no berry's weight; check mask, depth and camera"
