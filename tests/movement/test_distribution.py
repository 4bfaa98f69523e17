import json

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement import GaussianBasis, TrajectoryDistribution, ViaPoint

PHASES = np.linspace(0.0, 1.0, 50)


def make_distribution(seed: int = 0, dimensions: int = 3) -> TrajectoryDistribution:
    rng = np.random.default_rng(seed)
    factor = 0.3 * rng.normal(size=(dimensions * 8, dimensions * 8))
    mean = rng.normal(size=(dimensions, 8))
    return TrajectoryDistribution(GaussianBasis(), mean, factor @ factor.T, duration=2.5)


def test_samples_have_the_mean_and_the_covariance() -> None:
    distribution = make_distribution()
    samples = distribution.sample(np.random.default_rng(1), 20_000, PHASES[::10])
    std = distribution.std(PHASES[::10])
    assert samples.shape == (20_000, 5, 3)
    assert (np.abs(samples.mean(axis=0) - distribution.mean(PHASES[::10])) < 5 * std / np.sqrt(20_000)).all()
    np.testing.assert_allclose(samples.std(axis=0), std, rtol=0.05)
    measured = np.stack([np.cov(samples[:, t], rowvar=False) for t in range(5)])
    tolerance = 0.06 * np.abs(measured).max()
    np.testing.assert_allclose(distribution.covariance(PHASES[::10]), measured, atol=tolerance)


def test_same_seed_same_samples() -> None:
    distribution = make_distribution()
    first, second = (distribution.sample(np.random.default_rng(9), 3, PHASES) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_std_is_the_diagonal_of_the_covariance() -> None:
    distribution = make_distribution()
    diagonal = np.diagonal(distribution.covariance(PHASES), axis1=1, axis2=2)
    np.testing.assert_allclose(distribution.std(PHASES) ** 2, diagonal, rtol=1e-10)


def test_equation_5_7_degree_by_degree() -> None:
    """With Φ (T, B) the mean is Φθ and the variance diag(ΦΣΦᵀ), written out for each joint on its own."""
    distribution, phi = make_distribution(), GaussianBasis().phi(PHASES)
    for d in range(3):
        block = distribution.weight_covariance[8 * d : 8 * d + 8, 8 * d : 8 * d + 8]
        np.testing.assert_allclose(distribution.mean(PHASES)[:, d], phi @ distribution.weight_mean[d])
        np.testing.assert_allclose(distribution.std(PHASES)[:, d] ** 2, np.diag(phi @ block @ phi.T))


def test_log_density_agrees_with_scipy() -> None:
    distribution = make_distribution()
    value = distribution.mean([0.4])[0] + 0.2
    covariance = distribution.covariance([0.4])[0] + 0.01 * np.eye(3)
    expected = multivariate_normal(distribution.mean([0.4])[0], covariance).logpdf(value)
    assert distribution.log_density(0.4, value, std=0.1) == pytest.approx(expected)


def test_json_round_trip_keeps_every_bit() -> None:
    distribution = make_distribution().condition([ViaPoint(0.5, np.array([0.1]), (2,), 0.01)])
    back = TrajectoryDistribution.from_json(json.loads(json.dumps(distribution.to_json())))
    np.testing.assert_array_equal(back.weight_mean, distribution.weight_mean)
    np.testing.assert_array_equal(back.weight_covariance, distribution.weight_covariance)
    assert (back.names, back.duration, back.space) == (("q1", "q2", "q3"), 2.5, "joint")
    assert back.via_points[0].phase == 0.5


def test_json_refusals() -> None:
    data = make_distribution().to_json()
    with pytest.raises(FileFormatError, match="schema"):
        TrajectoryDistribution.from_json({**data, "schema": "punnet-trajectory-distribution/9"})
    with pytest.raises(FileFormatError, match="weight_mean"):
        TrajectoryDistribution.from_json({key: data[key] for key in data if key != "weight_mean"})
    with pytest.raises(FileFormatError, match="weight_covariance"):
        TrajectoryDistribution.from_json({**data, "weight_covariance": [[1.0]]})
    with pytest.raises(FileFormatError, match="schema"):
        TrajectoryDistribution.from_json([])  # type: ignore[arg-type]


def test_constructor_refusals() -> None:
    basis, mean = GaussianBasis(), np.zeros((1, 8))
    with pytest.raises(ShapeError, match="weight_mean"):
        TrajectoryDistribution(basis, np.zeros((1, 7)), np.eye(7))
    with pytest.raises(ConfigurationError, match="negative eigenvalue"):
        TrajectoryDistribution(basis, mean, np.diag([1.0] * 7 + [-0.1]))
    lopsided = np.eye(8)
    lopsided[0, 1] = 0.5
    with pytest.raises(ConfigurationError, match="not symmetric"):
        TrajectoryDistribution(basis, mean, lopsided)
    with pytest.raises(ConfigurationError, match="duration"):
        TrajectoryDistribution(basis, mean, np.eye(8), duration=0.0)
    with pytest.raises(ConfigurationError, match="space"):
        TrajectoryDistribution(basis, mean, np.eye(8), space="cartesian")  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="names"):
        TrajectoryDistribution(basis, mean, np.eye(8), names=("a", "b"))
    with pytest.raises(ConfigurationError, match="samples"):
        TrajectoryDistribution(basis, mean, np.eye(8)).sample(np.random.default_rng(0), -1, PHASES)
