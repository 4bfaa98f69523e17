"""Conformal intervals: they hold what they promise, whatever the number of residuals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.train.weight.calibration import conformal_quantiles, group_folds, predict_out_of_fold


def test_new_berries_lie_inside_as_often_as_promised() -> None:
    generator = np.random.default_rng(5)
    inside = []
    for _ in range(400):
        spread = generator.uniform(0.5, 2.0, 61)
        residuals = spread * (generator.gamma(2.0, 0.05, 61) - 0.1)  # lopsided
        interval = conformal_quantiles(residuals[:60], spread[:60], 0.9)
        inside.append(interval.low <= residuals[60] / spread[60] <= interval.high)
    assert 0.87 < np.mean(inside) < 0.96


@given(count=st.integers(1, 60), coverage=st.floats(0.05, 0.95))
@settings(max_examples=60, deadline=None)
def test_each_tail_leaves_out_at_most_its_share(count: int, coverage: float) -> None:
    residuals = np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(1)
    if np.ceil((count + 1) * (1.0 + coverage) / 2.0) > count:
        with pytest.raises(ConfigurationError, match="too few"):
            conformal_quantiles(residuals, np.ones(count), coverage)
        return
    interval = conformal_quantiles(residuals, np.ones(count), coverage)
    assert interval.low <= 0.0 <= interval.high
    for beyond in (residuals > interval.high, residuals < interval.low):
        assert beyond.sum() <= (1.0 - coverage) / 2.0 * (count + 1)


def test_folds_part_no_plant_and_leave_out_each_once() -> None:
    groups = [f"plant {number % 23}" for number in range(90)]
    folds = list(group_folds(groups, 4, seed=1))
    assert sorted(np.concatenate(folds).tolist()) == list(range(90))
    of_fold = [{groups[index] for index in fold} for fold in folds]
    assert sum(map(len, of_fold)) == 23
    with pytest.raises(ConfigurationError, match="3 plants"):
        next(group_folds(["a", "b", "c"], 4, seed=0))


def test_out_of_fold_predictions_never_saw_their_plant() -> None:
    class Memory:
        def fit(self, features: np.ndarray, target: np.ndarray) -> None:
            self.seen = set(features[:, 0].tolist())

        def predict(self, features: np.ndarray) -> np.ndarray:
            return np.array([float(value in self.seen) for value in features[:, 0].tolist()])

    plants = np.repeat(np.arange(10), 3)
    told = predict_out_of_fold(
        Memory,
        plants[:, None].astype(np.float32),
        np.zeros(30),
        [f"plant {number}" for number in plants],
        folds=3,
        seed=0,
    )
    assert (told == 0.0).all()
