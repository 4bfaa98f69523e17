import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import GaussianBasis, ProMP, Ridge, shrunk_covariance

PHASES = np.linspace(0.0, 1.0, 150)


def draw_demonstrations(seed: int, count: int, dimensions: int = 7) -> tuple[np.ndarray, list[np.ndarray]]:
    """Random weights and the trajectories they span, of 60 to 180 instants."""
    rng = np.random.default_rng(seed)
    weights = rng.normal(size=(count, dimensions, 8))
    lengths = rng.integers(60, 180, size=count)
    basis = GaussianBasis()
    return weights, [basis.phi(np.linspace(0, 1, n)) @ w.T for n, w in zip(lengths, weights, strict=True)]


def test_weights_of_demonstrations_of_different_lengths_are_recovered() -> None:
    weights, demonstrations = draw_demonstrations(0, 12)
    for expected, demonstration in zip(weights, demonstrations, strict=True):
        np.testing.assert_allclose(ProMP().weights(demonstration), expected, atol=1e-4)
    distribution = ProMP(estimator=Ridge(shrinkage=0.0)).fit(
        demonstrations, durations=np.linspace(2.0, 4.0, 12).tolist()
    )
    np.testing.assert_allclose(distribution.weight_mean, weights.mean(axis=0), atol=1e-4)
    expected = np.cov(weights.reshape(12, -1), rowvar=False)
    np.testing.assert_allclose(distribution.weight_covariance, expected, atol=1e-4)
    assert distribution.duration == pytest.approx(3.0)
    assert (distribution.observation_std < 1e-4).all()


@given(st.integers(0, 1000), st.integers(1, 12))
@settings(deadline=None, max_examples=25)
def test_covariance_is_definite_however_few_demonstrations(seed: int, count: int) -> None:
    _, demonstrations = draw_demonstrations(seed, count)
    distribution = ProMP().fit(demonstrations)
    eigenvalues = np.linalg.eigvalsh(distribution.weight_covariance)
    assert eigenvalues[0] > -1e-12 * eigenvalues[-1]
    assert (np.diag(distribution.weight_covariance) >= Ridge().minimum_std ** 2 * (1 - 1e-9)).all()


def test_distribution_describes_unseen_demonstrations() -> None:
    """Of fresh trajectories from the same source, 95% lie within two standard deviations."""
    rng = np.random.default_rng(4)
    factor = rng.normal(size=(16, 5))
    weights = rng.normal(size=(2, 8)) + (rng.normal(size=(600, 5)) @ factor.T).reshape(600, 2, 8)
    curves = GaussianBasis().phi(PHASES) @ weights.transpose(0, 2, 1)
    distribution = ProMP().fit(list(curves[:200]))
    outside = np.abs(curves[200:] - distribution.mean(PHASES)) > 1.96 * distribution.std(PHASES)
    assert 0.03 < outside.mean() < 0.07


def test_residual_is_reported_as_observation_noise() -> None:
    rng = np.random.default_rng(2)
    _, demonstrations = draw_demonstrations(2, 40, dimensions=2)
    noisy = [d + rng.normal(0.0, [0.01, 0.05], d.shape) for d in demonstrations]
    np.testing.assert_allclose(ProMP().fit(noisy).observation_std, [0.01, 0.05], rtol=0.1)


def test_shrinkage_vanishes_with_data_and_keeps_variances() -> None:
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(10, 10))
    for count, tolerance in ((20_000, 0.03), (4, np.inf)):
        samples = rng.normal(size=(count, 10)) @ factor.T
        estimate, plain = shrunk_covariance(samples), np.cov(samples, rowvar=False)
        np.testing.assert_allclose(np.diag(estimate), np.diag(plain))
        assert np.abs(estimate - plain).max() < tolerance * np.abs(plain).max()
        assert np.linalg.eigvalsh(estimate)[0] > 0


def test_shrinkage_of_independent_numbers_removes_correlation() -> None:
    samples = np.random.default_rng(5).normal(size=(15, 40))
    estimate = shrunk_covariance(samples)
    off_diagonal = estimate - np.diag(np.diag(estimate))
    assert np.abs(off_diagonal).max() < 0.15


def test_refusals() -> None:
    with pytest.raises(ShapeError, match="no demonstrations"):
        ProMP().fit([])
    with pytest.raises(ShapeError, match="disagree in D"):
        ProMP().fit([np.zeros((10, 2)), np.zeros((10, 3))])
    with pytest.raises(ShapeError, match="demonstration 0 must be finite"):
        ProMP().fit([np.full((10, 2), np.nan)])
    with pytest.raises(ShapeError, match="durations"):
        ProMP().fit([np.zeros((10, 2))], durations=[1.0, 2.0])
    for wrong in ({"penalty": -1.0}, {"shrinkage": 1.5}, {"minimum_std": -1.0}):
        with pytest.raises(ConfigurationError):
            Ridge(**wrong)  # type: ignore[arg-type]
