"""The interface of every weight estimator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.scene import Frame, Strawberries

__all__ = ["WeightEstimates", "WeightEstimator"]


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
