"""Intervals that hold what they promise: split-conformal quantiles of residuals on plants that were not learnt from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.weight.learned import IntervalSettings

__all__ = ["Regressor", "conformal_quantiles", "group_folds", "predict_out_of_fold"]


class Regressor(Protocol):
    """What scikit-learn's regressors offer."""

    def fit(self, X: Any, y: Any) -> Any:
        """Learn."""
        ...

    def predict(self, X: Any) -> Any:
        """Tell."""
        ...


def conformal_quantiles(
    residuals: NDArray[np.float64], spreads: NDArray[np.float64], coverage: float
) -> IntervalSettings:
    """An interval that holds a new berry's weight with probability ≥ ``coverage``: quantiles of log(true / told) / spread.

    The two tails are cut alike. With n residuals the k-th smallest is taken, k = ⌈(n + 1)(1 + coverage)/2⌉ and its
    mirror image (Vovk et al.; Lei et al. 2018), which makes the promise hold for every n, not only for large ones.

    Parameters
    ----------
    residuals
        (N,) of berries that the model did not learn from.
    spreads
        (N,) positive: how large a residual the model expects of each.
    coverage
        In (0, 1).

    Raises
    ------
    ConfigurationError
        If there are too few residuals for the coverage.
    """
    scores = np.sort(np.asarray(residuals) / np.asarray(spreads))
    count = len(scores)
    upper = int(np.ceil((count + 1) * (1.0 + coverage) / 2.0))
    if upper > count:
        raise ConfigurationError(
            f"interval: {count} berries are too few for {100 * coverage:.0f}% coverage; give more images"
        )
    low, high = float(scores[count - upper]), float(scores[upper - 1])
    return IntervalSettings(coverage, min(low, 0.0), max(high, 0.0))


def group_folds(groups: Sequence[str], folds: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """Indices of what is left out in each fold; a group is never parted, folds have about as many groups.

    Raises
    ------
    ConfigurationError
        If there are fewer groups than folds.
    """
    names = sorted(set(groups))
    if len(names) < folds:
        raise ConfigurationError(f"{len(names)} plants can't be parted into {folds} folds; give more images")
    order = np.random.default_rng(seed).permutation(len(names))
    fold_of = {names[place]: rank % folds for rank, place in enumerate(order)}
    membership = np.array([fold_of[group] for group in groups])
    for fold in range(folds):
        yield np.flatnonzero(membership == fold)


def predict_out_of_fold(
    make: Callable[[], Regressor],
    features: NDArray[np.float32],
    target: NDArray[np.float64],
    groups: Sequence[str],
    *,
    folds: int,
    seed: int,
) -> NDArray[np.float64]:
    """(N,) prediction of each sample by a model that learnt from none of its plant's."""
    predicted = np.full(len(target), np.nan)
    for left_out in group_folds(groups, folds, seed):
        kept = np.setdiff1d(np.arange(len(target)), left_out)
        model = make()
        model.fit(features[kept], target[kept])
        predicted[left_out] = model.predict(features[left_out])
    return predicted
