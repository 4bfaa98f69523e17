"""How good estimated weights are: PCW (thesis section 4.1) and the usual errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError

__all__ = ["PCW_TOLERANCES", "WeightErrors", "percent_correct_weight", "weight_errors"]

PCW_TOLERANCES = (0.05, 0.10, 0.15, 0.20, 0.25, 0.30)
"""Relative errors at which the thesis counts a weight as correct."""


def percent_correct_weight(
    true: ArrayLike, estimated: ArrayLike, tolerances: Sequence[float] = PCW_TOLERANCES
) -> dict[float, float]:
    """Percentage of berries whose relative error |estimated − true| / true is below each tolerance (Eq. 4.1).

    A berry without an estimate (NaN) counts as wrong: refusing to answer must not raise the score.

    Raises
    ------
    ShapeError
        If the two differ in length, are empty, or a true weight is not positive.
    ConfigurationError
        If a tolerance is not positive.
    """
    truth, guess = _checked(true, estimated)
    if any(not tolerance > 0 for tolerance in tolerances):
        raise ConfigurationError(f"PCW: tolerances must be positive, got {list(tolerances)}")
    error = np.abs(guess - truth) / truth
    return {float(tolerance): 100.0 * float(np.mean(error < tolerance)) for tolerance in tolerances}


@dataclass(frozen=True)
class WeightErrors:
    """Errors over the berries that have an estimate.

    Parameters
    ----------
    count, missing
        Berries with and without an estimate.
    mean_percentage
        Mean absolute error in per cent of the true weight (MAPE).
    root_mean_square
        Grams.
    bias
        Mean of estimated − true, grams.
    """

    count: int
    missing: int
    mean_percentage: float
    root_mean_square: float
    bias: float


def weight_errors(true: ArrayLike, estimated: ArrayLike) -> WeightErrors:
    """Mean absolute percentage error, root mean square error and bias; NaN if no berry has an estimate.

    Raises
    ------
    ShapeError
        If the two differ in length, are empty, or a true weight is not positive.
    """
    truth, guess = _checked(true, estimated)
    known = ~np.isnan(guess)
    count, missing = int(known.sum()), int((~known).sum())
    if count == 0:
        return WeightErrors(0, missing, float("nan"), float("nan"), float("nan"))
    error = guess[known] - truth[known]
    return WeightErrors(
        count=count,
        missing=missing,
        mean_percentage=100.0 * float(np.mean(np.abs(error) / truth[known])),
        root_mean_square=float(np.sqrt(np.mean(error**2))),
        bias=float(np.mean(error)),
    )


def _checked(true: ArrayLike, estimated: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    truth, guess = np.asarray(true, dtype=np.float64), np.asarray(estimated, dtype=np.float64)
    if truth.ndim != 1 or truth.shape != guess.shape or truth.size == 0:
        raise ShapeError(f"weights: need two equal lists, not empty, got {truth.shape} and {guess.shape}")
    if not (np.isfinite(truth) & (truth > 0)).all():
        raise ShapeError("weights: true weights must be positive and finite")
    return truth, guess
