import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import ExpectationMaximisation, GaussianBasis, ProMP, Ridge, TrajectoryDistribution
from punnet.movement.reduction import reduce_demonstrations

BASIS = GaussianBasis()


def draw(
    seed: int, count: int, dimensions: int = 3, noise: float = 0.03, shortest: int = 40
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Mean (D·B,) and covariance of the truth, and noisy demonstrations of different lengths."""
    rng = np.random.default_rng(seed)
    size = dimensions * BASIS.count
    factor = rng.normal(size=(size, size)) * 0.3 / np.sqrt(size)
    mean, covariance = rng.normal(size=size), factor @ factor.T
    weights = rng.multivariate_normal(mean, covariance, count).reshape(count, dimensions, BASIS.count)
    lengths = rng.integers(shortest, shortest + 3, count)
    demonstrations = [
        BASIS.phi(np.linspace(0, 1, T)) @ w.T + rng.normal(0.0, noise, (T, dimensions))
        for T, w in zip(lengths, weights, strict=True)
    ]
    return mean, covariance, demonstrations


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 1000), st.sampled_from(["full", "per-degree"]))
def test_every_iteration_makes_the_demonstrations_more_likely(seed: int, covariance: str) -> None:
    _, _, demonstrations = draw(seed, 60, dimensions=2)
    fit = ExpectationMaximisation(covariance_strength=0.0, noise_strength=0.0, tolerance=1e-9, iterations=15)
    history = fit.estimate(reduce_demonstrations(BASIS, demonstrations), covariance).log_likelihood
    assert len(history) > 3
    assert (np.diff(history) > -1e-6 * np.abs(history[0])).all()


def test_reported_log_likelihood_is_that_of_the_distribution() -> None:
    _, _, demonstrations = draw(3, 12)
    one_step = ExpectationMaximisation(iterations=1)
    reduced = reduce_demonstrations(BASIS, demonstrations)
    reported = one_step.estimate(reduced, "full").log_likelihood[0]
    begun = Ridge().estimate(reduced, "full")
    start = TrajectoryDistribution(BASIS, begun.mean, begun.covariance, observation_std=begun.noise_std)
    assert reported == pytest.approx(sum(start.log_likelihood(values) for values in demonstrations))


def test_truth_is_found_with_data_and_noise_is_not_taken_for_spread() -> None:
    mean, covariance, demonstrations = draw(1, 400, dimensions=1, noise=0.2, shortest=20)
    found = ProMP(BASIS, ExpectationMaximisation()).fit(demonstrations)
    plain = ProMP(BASIS, Ridge(shrinkage=0.0)).fit(demonstrations)
    z = np.linspace(0.0, 1.0, 30)
    np.testing.assert_allclose(found.mean(z)[:, 0], BASIS.phi(z) @ mean, atol=0.06)
    assert found.observation_std == pytest.approx(0.2, rel=0.05)

    def error(fitted: TrajectoryDistribution) -> float:
        return float(np.linalg.norm(fitted.weight_covariance - covariance))

    # Ridge regression adds the noise of each demonstration's weights to the covariance.
    assert error(found) < 0.5 * error(plain)


def test_unseen_demonstrations_are_more_likely_than_under_ridge() -> None:
    _, _, demonstrations = draw(2, 60, noise=0.1)
    fits = [
        ProMP(BASIS, estimator).fit(demonstrations[:10]) for estimator in (ExpectationMaximisation(), Ridge())
    ]
    by_em, by_ridge = (sum(fit.log_likelihood(values) for values in demonstrations[10:]) for fit in fits)
    assert by_em > by_ridge


def test_demonstrations_shorter_than_the_basis_count_for_what_they_say() -> None:
    """Of a movement seen at five instants only, those five are met and the rest comes from the others."""
    _, _, demonstrations = draw(4, 80, dimensions=2, noise=1e-3)
    few = [values[np.linspace(0, len(values) - 1, 5).round().astype(int)] for values in demonstrations]
    fit = ProMP(BASIS, ExpectationMaximisation()).fit([*demonstrations[:40], *few[40:]])
    whole = ProMP(BASIS, ExpectationMaximisation()).fit(demonstrations)
    z = np.linspace(0, 1, 21)
    assert np.abs(fit.mean(z) - whole.mean(z)).max() < 0.1
    assert np.isfinite(fit.weight_covariance).all()


def test_a_strong_prior_wins_and_a_weak_one_loses() -> None:
    mean, covariance, demonstrations = draw(5, 10, dimensions=2)
    prior = TrajectoryDistribution(BASIS, np.full((2, 8), 5.0), 4.0 * np.eye(16))

    def fit(strength: float) -> TrajectoryDistribution:
        settings_ = ExpectationMaximisation(prior, covariance_strength=strength, mean_strength=strength)
        return ProMP(BASIS, settings_).fit(demonstrations)

    strong, weak = fit(1e6), fit(1e-6)
    np.testing.assert_allclose(strong.weight_mean, 5.0, atol=0.01)
    np.testing.assert_allclose(strong.weight_covariance, 4.0 * np.eye(16), atol=0.01)
    assert np.abs(weak.weight_mean.ravel() - mean).max() < 0.6
    assert np.trace(weak.weight_covariance) < 3 * np.trace(covariance)


def test_per_degree_blocks_keep_degrees_apart() -> None:
    _, _, demonstrations = draw(6, 20)
    for estimator in (Ridge(), ExpectationMaximisation()):
        covariance = ProMP(BASIS, estimator, "per-degree").fit(demonstrations).weight_covariance
        blocks = covariance.reshape(3, 8, 3, 8)
        assert all((blocks[a, :, b] == 0).all() for a in range(3) for b in range(3) if a != b)
        assert all(np.linalg.eigvalsh(blocks[a, :, a])[0] > 0 for a in range(3))


def test_refusals() -> None:
    for wrong in (
        {"covariance_strength": -1.0},
        {"mean_strength": 1.0},
        {"noise_std": float("nan")},
        {"iterations": 0},
        {"tolerance": 0.0},
    ):
        with pytest.raises(ConfigurationError, match="expectation-maximisation"):
            ExpectationMaximisation(**wrong)  # type: ignore[arg-type]
    other = TrajectoryDistribution(BASIS, np.zeros((2, 8)), np.eye(16))
    with pytest.raises(ShapeError, match="the prior has weights"):
        ProMP(BASIS, ExpectationMaximisation(other)).fit([np.zeros((10, 3)), np.ones((10, 3))])
    with pytest.raises(ConfigurationError, match="covariance must be one of"):
        ProMP(covariance="diagonal")  # type: ignore[arg-type]
