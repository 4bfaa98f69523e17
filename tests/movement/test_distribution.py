import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement import GaussianBasis, JointLimits, TrajectoryDistribution, ViaPoint

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


def test_log_likelihood_agrees_with_the_whole_covariance() -> None:
    """Against the dense Gaussian over all samples of all degrees of freedom."""
    distribution = replace(make_distribution(3, dimensions=2), observation_std=np.array([0.1, 0.3]))
    rng = np.random.default_rng(0)
    for T, phase in ((30, None), (5, None), (12, np.sort(rng.uniform(size=12)))):
        trajectory = rng.normal(size=(T, 2))
        phi = distribution.basis.phi(np.linspace(0, 1, T) if phase is None else phase)
        A = np.kron(np.eye(2), phi)
        noise = np.repeat([0.01, 0.09], T)
        covariance = A @ distribution.weight_covariance @ A.T + np.diag(noise)
        expected = multivariate_normal(A @ distribution.weight_mean.ravel(), covariance).logpdf(
            trajectory.T.ravel()
        )
        assert distribution.log_likelihood(trajectory, phase) == pytest.approx(expected)
    with pytest.raises(ShapeError, match="trajectory must be finite"):
        distribution.log_likelihood(np.full((4, 2), np.nan))
    with pytest.raises(ShapeError, match="4 samples but phases"):
        distribution.log_likelihood(np.zeros((4, 2)), [0.0, 1.0])


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 24))
@settings(deadline=None, max_examples=25)
def test_sample_means_come_to_the_mean(seed: int, dimensions: int, rank: int) -> None:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(dimensions * 8, rank))
    distribution = TrajectoryDistribution(
        GaussianBasis(), rng.normal(size=(dimensions, 8)), factor @ factor.T
    )
    z = np.linspace(0.0, 1.0, 5)
    error = distribution.sample(rng, 4000, z).mean(axis=0) - distribution.mean(z)
    assert (np.abs(error) <= 6 * distribution.std(z) / np.sqrt(4000) + 1e-9).all()


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_of_mean_spread_and_samples(order: int) -> None:
    distribution, z, h = make_distribution(), np.array([0.3, 0.7]), 1e-4
    around = [distribution.mean(z + k * h) for k in (-1, 0, 1)]
    expected = (
        (around[2] - around[0]) / (2 * h) if order == 1 else (around[2] - 2 * around[1] + around[0]) / h**2
    )
    np.testing.assert_allclose(distribution.mean(z, order), expected, rtol=1e-4, atol=1e-3)
    samples = distribution.sample(np.random.default_rng(0), 20_000, z, order)
    np.testing.assert_allclose(samples.std(axis=0), distribution.std(z, order), rtol=0.05)
    diagonal = np.diagonal(distribution.covariance(z, order), axis1=1, axis2=2)
    np.testing.assert_allclose(distribution.std(z, order) ** 2, diagonal, rtol=1e-9)


LIMITS = JointLimits(
    lower=np.full(3, -9.0), upper=np.full(3, 9.0), velocity=np.full(3, 2.0), acceleration=np.full(3, 10.0),
    jerk=np.full(3, 5000.0), joint_names=("a", "b", "c"),
)  # fmt: skip


@given(st.integers(0, 1000), st.floats(0.5, 20.0))
@settings(deadline=None, max_examples=20)
def test_time_scaling_keeps_the_path(seed: int, duration: float) -> None:
    distribution = make_distribution(seed)
    slow = distribution.retimed(duration)
    np.testing.assert_array_equal(slow.mean(PHASES), distribution.mean(PHASES))
    assert slow.duration == duration
    quick = distribution.to_joint_trajectory(LIMITS)
    stretched = quick.stretched(duration)
    share = np.linspace(0.0, 1.0, 60)
    np.testing.assert_allclose(
        stretched.sample(share * stretched.duration), quick.sample(share * quick.duration), atol=1e-9
    )
    velocity = stretched.sample(share * stretched.duration, derivative=1)
    np.testing.assert_allclose(
        velocity, quick.sample(share * quick.duration, derivative=1) / duration, atol=1e-7
    )


def test_joint_trajectory_of_the_mean_takes_its_time_and_its_ends() -> None:
    distribution = make_distribution()
    quick = distribution.to_joint_trajectory(LIMITS, speed=0.5)
    calm = distribution.to_joint_trajectory(LIMITS, at_least=quick.duration + 2.0)
    assert calm.duration == pytest.approx(quick.duration + 2.0, abs=0.02)
    for trajectory in (quick, calm):
        np.testing.assert_allclose(trajectory.start, distribution.mean([0.0])[0], atol=1e-12)
        np.testing.assert_allclose(trajectory.end, distribution.mean([1.0])[0], atol=1e-12)
        assert trajectory.joint_names == ("a", "b", "c")
    for derivative, bound in ((1, LIMITS.velocity), (2, LIMITS.acceleration), (3, LIMITS.jerk)):
        instants = np.linspace(0.0, calm.duration, 3000)
        assert (np.abs(calm.sample(instants, derivative=derivative)) <= bound * (1 + 1e-9)).all()
    task = TrajectoryDistribution(GaussianBasis(), np.zeros((6, 8)), np.eye(48), space="task")
    with pytest.raises(ConfigurationError, match="joints_along"):
        task.to_joint_trajectory(LIMITS)
    with pytest.raises(ConfigurationError, match="at_least"):
        distribution.to_joint_trajectory(LIMITS, at_least=-1.0)
    with pytest.raises(ShapeError, match="factor"):
        quick.stretched(0.0)
