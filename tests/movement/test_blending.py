import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import (
    GaussianBasis,
    PoseChart,
    TrajectoryDistribution,
    ViaPoint,
    blend,
    combine,
    in_basis,
    in_chart,
)

BASIS = GaussianBasis()
PHASES = np.linspace(0.0, 1.0, 41)


def draw(seed: int, dimensions: int = 2, rank: int | None = None) -> TrajectoryDistribution:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(dimensions * 8, rank or dimensions * 8))
    return TrajectoryDistribution(
        BASIS, rng.normal(size=(dimensions, 8)), factor @ factor.T, duration=1.0 + seed % 3
    )


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.integers(1, 16), st.floats(0.2, 0.8))
def test_blending_a_movement_with_itself_changes_nothing(seed: int, rank: int, phase: float) -> None:
    one = draw(seed, rank=rank)
    both = blend(one, one, phase=phase, width=0.3)
    np.testing.assert_allclose(both.mean(PHASES), one.mean(PHASES), atol=1e-8)
    scale = np.abs(one.weight_covariance).max()
    np.testing.assert_allclose(both.covariance(PHASES), one.covariance(PHASES), atol=1e-6 * scale)
    assert both.duration == pytest.approx(one.duration)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.integers(0, 1000), st.integers(1, 16))
def test_a_blend_begins_as_the_first_and_ends_as_the_second(a: int, b: int, rank: int) -> None:
    first, second = draw(a, rank=rank), draw(b + 1001)
    both = blend(first, second)
    for end, source in ((0.0, first), (1.0, second)):
        np.testing.assert_allclose(both.mean([end]), source.mean([end]), atol=1e-4)
        np.testing.assert_allclose(both.std([end]), source.std([end]), rtol=1e-3, atol=1e-3)
    assert np.linalg.eigvalsh(both.weight_covariance)[0] > -1e-9 * np.abs(both.weight_covariance).max()


def test_the_spread_does_not_shrink_where_two_alike_movements_meet() -> None:
    first = draw(3)
    second = TrajectoryDistribution(BASIS, first.weight_mean + 1.0, first.weight_covariance)
    np.testing.assert_allclose(blend(first, second).std(PHASES), first.std(PHASES), rtol=1e-3)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.floats(0.1, 5.0))
def test_combination_is_the_product_of_the_densities(seed: int, power: float) -> None:
    first, second = draw(seed), draw(seed + 5000)
    both = combine([first, second], [1.0, power])
    P1, P2 = np.linalg.inv(first.weight_covariance), power * np.linalg.inv(second.weight_covariance)
    covariance = np.linalg.inv(P1 + P2)
    mean = covariance @ (P1 @ first.weight_mean.ravel() + P2 @ second.weight_mean.ravel())
    scale = np.abs(covariance).max()
    np.testing.assert_allclose(both.weight_covariance, covariance, atol=1e-5 * max(scale, 1.0))
    np.testing.assert_allclose(both.weight_mean.ravel(), mean, atol=1e-3)
    # No wider than either, anywhere.
    assert (both.std(PHASES) <= first.std(PHASES) * (1 + 1e-6) + 1e-9).all()


def test_combination_with_itself_halves_the_variance_even_without_full_rank() -> None:
    one = draw(7, rank=3)
    both = combine([one, one])
    np.testing.assert_allclose(both.mean(PHASES), one.mean(PHASES), atol=1e-6)
    np.testing.assert_allclose(both.std(PHASES) ** 2, one.std(PHASES) ** 2 / 2, rtol=1e-5)
    assert combine([one]).weight_mean is not None


def test_a_start_and_a_goal_are_combined() -> None:
    """One distribution knows where to start, the other where to end; the product does both."""
    wide = TrajectoryDistribution(BASIS, np.zeros((1, 8)), np.eye(8))
    start = wide.condition([ViaPoint(0.0, np.array([1.0]), std=0.01)])
    goal = wide.condition([ViaPoint(1.0, np.array([-1.0]), std=0.01)])
    both = combine([start, goal])
    np.testing.assert_allclose(both.mean([0.0, 1.0])[:, 0], [1.0, -1.0], atol=0.01)


def test_bases_and_charts_are_brought_together() -> None:
    first = draw(1, dimensions=6)
    task = TrajectoryDistribution(BASIS, 0.2 * first.weight_mean, 0.01 * np.eye(48), space="task")
    elsewhere = in_chart(task, PoseChart(np.array([0.1, -0.2, 0.05, 1.0])))
    assert np.abs(elsewhere.weight_mean - task.weight_mean).max() > 0.05
    both = blend(task, elsewhere)
    np.testing.assert_allclose(both.mean(PHASES), task.mean(PHASES), atol=0.01)
    coarse = in_basis(draw(2), GaussianBasis.spaced(12))
    assert blend(draw(2), coarse).basis == BASIS
    np.testing.assert_allclose(combine([draw(2), coarse]).mean(PHASES), draw(2).mean(PHASES), atol=0.05)


def test_refusals() -> None:
    one = draw(0)
    with pytest.raises(ConfigurationError, match="phase ± width"):
        blend(one, one, phase=0.9, width=0.4)
    with pytest.raises(ShapeError, match="2 degrees of freedom and 3"):
        blend(one, draw(0, dimensions=3))
    task = TrajectoryDistribution(BASIS, np.zeros((6, 8)), np.eye(48), space="task")
    with pytest.raises(ConfigurationError, match="joint space and task space"):
        combine([draw(0, dimensions=6), task])
    with pytest.raises(ShapeError, match="no distribution"):
        combine([])
    with pytest.raises(ShapeError, match="2 weights for 1"):
        combine([one], [1.0, 2.0])
    with pytest.raises(ConfigurationError, match="positive"):
        combine([one, one], [1.0, 0.0])
    fixed = TrajectoryDistribution(BASIS, np.zeros((2, 8)), np.zeros((16, 16)))
    moved = TrajectoryDistribution(BASIS, np.ones((2, 8)), np.zeros((16, 16)))
    with pytest.raises(ConfigurationError, match="contradict"):
        combine([fixed, moved])
