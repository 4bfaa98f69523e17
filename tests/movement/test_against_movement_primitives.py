"""Via-points with noise: the closed form, ours, and what the package movement-primitives 0.9.1 makes of them."""

import numpy as np
import pytest

from punnet.movement import GaussianBasis, TrajectoryDistribution, ViaPoint

DIMENSIONS, WEIGHTS = 3, 6
WIDTH = -1.0 / (8.0 * WEIGHTS**2 * np.log(0.7))  # the basis of that package
PHASES = np.array([0.1, 0.45, 0.9])


@pytest.fixture
def case() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mean, covariance, values (3, D) and variances (3, D)."""
    rng = np.random.default_rng(11)
    factor = rng.normal(size=(DIMENSIONS * WEIGHTS,) * 2)
    values = rng.normal(size=(len(PHASES), DIMENSIONS))
    return (
        rng.normal(size=DIMENSIONS * WEIGHTS),
        factor @ factor.T,
        values,
        rng.uniform(0.2, 1.0, values.shape),
    )


def closed_form(
    mean: np.ndarray, covariance: np.ndarray, values: np.ndarray, variances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bayes' rule in information form, written out basis function by basis function."""
    precision, information = np.linalg.inv(covariance), np.linalg.solve(covariance, mean)
    for phase, row, spread in zip(PHASES, values, variances, strict=True):
        bumps = np.exp(-((phase - np.arange(WEIGHTS) / (WEIGHTS - 1)) ** 2) / (2 * WIDTH))
        for degree in range(DIMENSIONS):
            a = np.zeros((DIMENSIONS, WEIGHTS))
            a[degree] = bumps / bumps.sum()
            precision += np.outer(a, a) / spread[degree]
            information += a.ravel() * row[degree] / spread[degree]
    return np.linalg.solve(precision, information), np.linalg.inv(precision)


def test_ours_is_the_closed_form(case) -> None:
    mean, covariance, values, variances = case
    prior = TrajectoryDistribution(GaussianBasis(WEIGHTS, WIDTH), mean.reshape(DIMENSIONS, -1), covariance)
    ours = prior.condition(
        [ViaPoint(z, y, std=np.sqrt(v)) for z, y, v in zip(PHASES, values, variances, strict=True)]
    )
    expected_mean, expected_covariance = closed_form(*case)
    np.testing.assert_allclose(ours.weight_mean.ravel(), expected_mean, atol=1e-9)
    np.testing.assert_allclose(ours.weight_covariance, expected_covariance, atol=1e-9)


def test_theirs_is_not(case) -> None:
    promp = pytest.importorskip(
        "movement_primitives.promp", reason="MOVEMENT-PRIMITIVES ABSENT: the comparison did not run"
    )
    mean, covariance, values, variances = case
    prior = promp.ProMP(DIMENSIONS, WEIGHTS).from_weight_distribution(mean, covariance)
    theirs = promp.via_points(prior, PHASES, values, variances)
    expected_mean, _ = closed_form(*case)
    phi = GaussianBasis(WEIGHTS, WIDTH).phi(PHASES)
    off = (theirs.weight_mean - expected_mean).reshape(DIMENSIONS, -1) @ phi.T
    assert np.abs(off).max() > 0.05
    # One via-point with its whole covariance is right there: the fault is how several are handed on.
    one = prior.condition_position(values[0], np.diag(variances[0]), t=PHASES[0])
    ours = TrajectoryDistribution(GaussianBasis(WEIGHTS, WIDTH), mean.reshape(DIMENSIONS, -1), covariance)
    ours = ours.condition([ViaPoint(PHASES[0], values[0], std=np.sqrt(variances[0]))])
    np.testing.assert_allclose(one.weight_mean, ours.weight_mean.ravel(), atol=1e-9)
