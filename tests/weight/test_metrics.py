"""PCW and errors: by hand, by the thesis' definition, and what counts as wrong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.weight import PCW_TOLERANCES, percent_correct_weight, weight_errors


def test_by_hand() -> None:
    true = [10.0, 20.0, 30.0, 40.0]
    estimated = [10.4, 23.0, 36.5, 20.0]  # 4%, 15%, 21.7%, 50% off
    scores = percent_correct_weight(true, estimated, (0.05, 0.2, 0.3))
    assert scores == {0.05: 25.0, 0.2: 50.0, 0.3: 75.0}


def test_the_tolerances_of_the_thesis_are_the_default() -> None:
    assert tuple(percent_correct_weight([1.0], [1.0])) == PCW_TOLERANCES == (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)


def test_an_error_of_exactly_the_tolerance_is_wrong() -> None:
    assert percent_correct_weight([16.0], [20.0], (0.25,)) == {0.25: 0.0}


def test_no_estimate_is_wrong() -> None:
    assert percent_correct_weight([10.0, 10.0], [10.0, np.nan], (0.3,)) == {0.3: 50.0}


def test_errors_by_hand() -> None:
    errors = weight_errors([10.0, 20.0, 5.0], [12.0, 19.0, np.nan])
    assert (errors.count, errors.missing) == (2, 1)
    assert errors.mean_percentage == pytest.approx(12.5)
    assert errors.root_mean_square == pytest.approx(np.sqrt(2.5))
    assert errors.bias == pytest.approx(0.5)


def test_errors_without_any_estimate_are_nan() -> None:
    errors = weight_errors([10.0], [np.nan])
    assert (errors.count, errors.missing) == (0, 1)
    assert np.isnan(errors.mean_percentage)


weights = st.lists(st.tuples(st.floats(0.1, 50.0), st.floats(0.1, 50.0)), min_size=1, max_size=20)


@given(weights, st.floats(0.1, 10.0))
@settings(max_examples=50, deadline=None)
def test_pcw_rises_with_tolerance_and_knows_no_unit(pairs: list[tuple[float, float]], factor: float) -> None:
    true, estimated = np.array(pairs).T
    scores = list(percent_correct_weight(true, estimated, (0.07, 0.13, 0.29)).values())
    assert scores == sorted(scores)
    relative = np.abs(estimated - true) / true
    if not np.isclose(relative[:, None], (0.07, 0.13, 0.29), rtol=1e-9).any():
        assert scores == list(
            percent_correct_weight(true * factor, estimated * factor, (0.07, 0.13, 0.29)).values()
        )


def test_bad_input_is_refused() -> None:
    for true, estimated in (([1.0], [1.0, 2.0]), ([], []), ([0.0], [1.0]), ([np.nan], [1.0])):
        with pytest.raises(ShapeError):
            percent_correct_weight(true, estimated)
        with pytest.raises(ShapeError):
            weight_errors(true, estimated)
    with pytest.raises(ConfigurationError):
        percent_correct_weight([1.0], [1.0], (0.0,))
