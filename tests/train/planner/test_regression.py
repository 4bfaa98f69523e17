"""Robust ridge regression."""

import numpy as np
import pytest

from punnet.train.planner.regression import PENALTIES, fit_robustly, fold_numbers, leave_folds_out


@pytest.fixture
def plane(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features (60, 2), what they stand for (60, 3), and the matrix between."""
    features = rng.normal(size=(60, 2))
    matrix = rng.normal(size=(2, 3))
    return features, features @ matrix + 0.3, matrix


def test_is_least_squares_where_nothing_is_off(plane, rng) -> None:
    features, values, _ = plane
    noisy = values + 0.01 * rng.normal(size=values.shape)
    fitted = fit_robustly(features, noisy, np.zeros(3), freedom=1e9)
    design = np.column_stack((np.ones(60), features))
    wanted = design @ np.linalg.lstsq(design, noisy, rcond=None)[0]
    np.testing.assert_allclose(fitted(features), wanted, atol=1e-10)


def test_swapped_labels_hardly_count(plane) -> None:
    features, values, _ = plane
    swapped = values.copy()
    swapped[[0, 1, 2, 3, 4, 5]] = values[[5, 4, 3, 2, 1, 0]] + 3.0
    robust = fit_robustly(features, swapped, np.zeros(3), freedom=2.5)
    plain = fit_robustly(features, swapped, np.zeros(3), freedom=1e9)
    error = [np.abs(fit(features) - values).max() for fit in (robust, plain)]
    assert error[0] < 0.02
    assert error[1] > 0.2


def test_the_largest_penalty_leaves_a_constant(plane) -> None:
    features, values, _ = plane
    fitted = fit_robustly(features, values, np.full(3, 1e9), freedom=1e9)
    np.testing.assert_allclose(fitted(features), np.tile(values.mean(axis=0), (60, 1)), atol=1e-6)


def test_penalties_are_chosen_for_each_output(plane, rng) -> None:
    features, values, _ = plane
    values = np.column_stack(
        (values[:, 0], rng.normal(size=60))
    )  # the second has nothing to do with the features
    folds = fold_numbers([str(row % 6) for row in range(60)], 8)
    unseen = leave_folds_out(features, values, folds, freedom=2.5)
    assert unseen.penalties[0] == PENALTIES[0]
    assert unseen.penalties[1] > 0.1
    assert np.abs(unseen.residuals[:, 0]).max() < 1e-3
    assert (unseen.leverage > 1.0 / 60).all()


def test_only_what_counts_chooses_the_penalty(plane, rng) -> None:
    """Two outputs whose sum is the plane's; apart they are noise, as joints that can make up for each other are."""
    features, values, _ = plane
    noise = 3.0 * rng.normal(size=60)
    outputs = np.column_stack((values[:, 0] + noise, -noise))
    folds = fold_numbers([str(row % 6) for row in range(60)], 8)
    together = np.ones((60, 1, 2))
    unseen = leave_folds_out(features, outputs, folds, 2.5, together)
    assert unseen.penalties[0] == unseen.penalties[1] == PENALTIES[0]
    assert np.abs(unseen.residuals.sum(axis=1)).max() < 1e-2
    apart = leave_folds_out(features, outputs, folds, 2.5)
    assert np.abs(apart.residuals.sum(axis=1)).mean() > 10 * np.abs(unseen.residuals.sum(axis=1)).mean()


def test_what_is_learnt_far_from_is_less_sure(plane) -> None:
    features, values, _ = plane
    fitted = fit_robustly(features, values, np.full(3, 1e-3), freedom=2.5)
    near, far = fitted.leverage(np.array([features.mean(axis=0), features.mean(axis=0) + 10.0]))
    assert near == pytest.approx(1.0 / fitted.rows, rel=0.2)
    assert far > 20 * near


def test_groups_stay_whole() -> None:
    folds = fold_numbers(["a", "b", "a", "c", "b", "d"], 3)
    np.testing.assert_array_equal(folds, [0, 1, 0, 2, 1, 0])
