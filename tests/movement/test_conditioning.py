import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement import GaussianBasis, TrajectoryDistribution, ViaPoint, condition_gaussian

BASIS = GaussianBasis()


def random_distribution(seed: int, dimensions: int, rank: int) -> TrajectoryDistribution:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(dimensions * BASIS.count, rank))
    return TrajectoryDistribution(BASIS, rng.normal(size=(dimensions, BASIS.count)), factor @ factor.T)


@st.composite
def cases(draw: st.DrawFn) -> tuple[TrajectoryDistribution, list[ViaPoint]]:
    """Distributions of full and of low rank, with one to four noisy or exact via-points on any subsets."""
    seed, dimensions = draw(st.integers(0, 10_000)), draw(st.integers(1, 4))
    exact = draw(st.booleans())
    rank = dimensions * BASIS.count if exact else draw(st.integers(1, dimensions * BASIS.count))
    rng = np.random.default_rng(seed + 1)
    phases = rng.choice(np.linspace(0.0, 1.0, 6), size=draw(st.integers(1, 4)), replace=False)
    via_points = []
    for phase in phases:
        chosen = rng.permutation(dimensions)[: rng.integers(1, dimensions + 1)]
        std = 0.0 if exact else 10.0 ** rng.uniform(-3, 0)
        via_points.append(ViaPoint(phase, rng.normal(size=len(chosen)), tuple(chosen), std))
    return random_distribution(seed, dimensions, rank), via_points


@given(cases())
@settings(deadline=None, max_examples=60)
def test_conditioning_never_raises_variance_and_stays_semi_definite(
    case: tuple[TrajectoryDistribution, list[ViaPoint]],
) -> None:
    prior, via_points = case
    posterior = prior.condition(via_points)
    scale = np.abs(prior.weight_covariance).max()
    phases = np.linspace(0.0, 1.0, 21)
    assert (posterior.std(phases) ** 2 <= prior.std(phases) ** 2 + 1e-9 * scale).all()
    assert np.linalg.eigvalsh(posterior.weight_covariance)[0] >= -1e-9 * scale
    np.testing.assert_array_equal(posterior.weight_covariance, posterior.weight_covariance.T)
    for point in via_points:
        chosen = list(point.indices(prior.dimensions))
        std = posterior.std([point.phase])[0, chosen]
        if (np.asarray(point.std) == 0).all():
            np.testing.assert_allclose(posterior.mean([point.phase])[0, chosen], point.values, atol=1e-9)
            assert (std <= 1e-6 * np.sqrt(scale)).all()
        else:
            assert (std <= np.asarray(point.std) * (1 + 1e-6) + 1e-6 * np.sqrt(scale)).all()


@given(cases(), st.randoms(use_true_random=False))
@settings(deadline=None, max_examples=30)
def test_all_at_once_equals_one_after_another_in_any_order(
    case: tuple[TrajectoryDistribution, list[ViaPoint]], shuffler: object
) -> None:
    prior, via_points = case
    together = prior.condition(via_points)
    shuffler.shuffle(via_points)  # type: ignore[attr-defined]
    stepwise = prior
    for point in via_points:
        stepwise = stepwise.condition([point])
    phases = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(stepwise.mean(phases), together.mean(phases), atol=1e-5)
    np.testing.assert_allclose(stepwise.std(phases), together.std(phases), atol=1e-3)


def test_equals_the_direct_conditional_of_the_joint_gaussian() -> None:
    """Golden: partition the joint Gaussian of (curve at some instants, noisy values), invert by blocks."""
    prior = random_distribution(3, 2, 16)
    via_points = [
        ViaPoint(0.3, np.array([0.4]), (1,), 0.2),
        ViaPoint(0.9, np.array([-0.5, 0.7]), None, [0.1, 0.05]),
    ]
    phases = np.array([0.0, 0.25, 0.6, 1.0])

    def row(phase: float, degree: int) -> np.ndarray:
        weights = np.exp(-((phase - np.arange(8) / 7.0) ** 2) / 0.04)
        padded = np.zeros((2, 8))
        padded[degree] = weights / weights.sum()
        return padded.ravel()

    X = np.array([row(phase, degree) for phase in phases for degree in range(2)])
    A = np.array([row(0.3, 1), row(0.9, 0), row(0.9, 1)])
    y, R = np.array([0.4, -0.5, 0.7]), np.diag([0.04, 0.01, 0.0025])
    m, S = prior.weight_mean.ravel(), prior.weight_covariance
    inner = np.linalg.inv(A @ S @ A.T + R)
    expected_mean = X @ m + X @ S @ A.T @ inner @ (y - A @ m)
    expected_covariance = X @ S @ X.T - X @ S @ A.T @ inner @ A @ S @ X.T

    posterior = prior.condition(via_points)
    np.testing.assert_allclose(posterior.mean(phases).ravel(), expected_mean, atol=1e-10)
    np.testing.assert_allclose(posterior.std(phases).ravel() ** 2, np.diag(expected_covariance), atol=1e-10)
    for i, block in enumerate(posterior.covariance(phases)):
        np.testing.assert_allclose(
            block, expected_covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2], atol=1e-10
        )


def test_velocity_via_point_brings_the_mean_to_rest() -> None:
    prior = random_distribution(5, 3, 24)
    posterior = prior.condition([ViaPoint(1.0, np.zeros(3), order=1), ViaPoint(1.0, np.ones(3))])
    np.testing.assert_allclose(posterior.mean([1.0], 1)[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(posterior.mean([1.0])[0], 1.0, atol=1e-9)


def test_repeated_exact_via_points_do_no_harm_and_contradicting_ones_are_refused() -> None:
    prior = random_distribution(7, 2, 16)
    point = ViaPoint(0.5, np.array([0.1, 0.2]))
    once, thrice = prior.condition([point]), prior.condition([point, point, point])
    np.testing.assert_allclose(thrice.weight_mean, once.weight_mean, atol=1e-8)
    with pytest.raises(ConfigurationError, match="contradict"):
        prior.condition([point, ViaPoint(0.5, np.array([0.1, 0.3]))])


def test_exact_value_where_nothing_varies_is_refused_and_broadening_allows_it() -> None:
    fixed = TrajectoryDistribution(BASIS, np.zeros((1, 8)), np.zeros((8, 8)))
    with pytest.raises(ConfigurationError, match="never vary"):
        fixed.condition([ViaPoint(0.2, np.array([1.0]))])
    met = fixed.broadened(0.1).condition([ViaPoint(0.2, np.array([1.0]))])
    np.testing.assert_allclose(met.mean([0.2]), [[1.0]], atol=1e-12)
    assert met.broadened(0.1).via_points == ()  # they are held to no longer


def test_no_via_points_change_nothing() -> None:
    prior = random_distribution(1, 1, 8)
    assert prior.condition([]) is prior
    empty = np.zeros(0)
    mean, covariance = condition_gaussian(np.ones(2), np.eye(2), np.zeros((0, 2)), values=empty, noise=empty)
    np.testing.assert_array_equal(mean, np.ones(2))
    np.testing.assert_array_equal(covariance, np.eye(2))


def test_via_point_refuses_what_does_not_fit() -> None:
    with pytest.raises(ShapeError, match="degrees of freedom"):
        ViaPoint(0.5, np.zeros(2), (0,))
    with pytest.raises(ConfigurationError, match="repeats"):
        ViaPoint(0.5, np.zeros(2), (1, 1))
    with pytest.raises(ConfigurationError, match="std"):
        ViaPoint(0.5, np.zeros(2), std=-1.0)
    with pytest.raises(ShapeError, match="finite"):
        ViaPoint(float("nan"), np.zeros(2))
    with pytest.raises(ConfigurationError, match="order"):
        ViaPoint(0.5, np.zeros(2), order=3)
    prior = random_distribution(1, 2, 8)
    with pytest.raises(ShapeError, match="3 values for 2"):
        prior.condition([ViaPoint(0.5, np.zeros(3))])
    with pytest.raises(ShapeError, match=r"not all in 0…1"):
        prior.condition([ViaPoint(0.5, np.zeros(1), (2,))])


def test_via_point_json_round_trip() -> None:
    point = ViaPoint(0.25, np.array([1.0, -2.0]), (3, 0), [0.1, 0.0], order=1)
    back = ViaPoint.from_json(point.to_json())
    assert (back.phase, back.degrees_of_freedom, back.order) == (0.25, (3, 0), 1)
    np.testing.assert_array_equal(back.values, point.values)
    np.testing.assert_array_equal(back.std, point.std)
    with pytest.raises(FileFormatError, match="via-point JSON"):
        ViaPoint.from_json({"phase": 0.5})
