import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import make_transform, pose_error, rotation_from_vector
from punnet.movement import GaussianBasis, PoseChart, ProMP, Ridge, TrajectoryDistribution

PHASES = np.linspace(0.0, 1.0, 60)


def turning(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Poses (T, 4, 4) that turn about an axis while moving along x."""
    axis = axis / np.linalg.norm(axis)
    R = rotation_from_vector(np.asarray(angles)[:, None] * axis)
    return make_transform(
        R, np.stack([np.linspace(0.3, 0.5, len(R)), 0 * R[:, 0, 0], 0 * R[:, 0, 0]], axis=1)
    )


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.floats(0.0, 2.9))
def test_coordinates_and_poses_are_inverse(seed: int, reach: float) -> None:
    rng = np.random.default_rng(seed)
    chart = PoseChart(rng.normal(size=4))
    poses = chart.poses(np.zeros((1, 6))) @ turning(rng.normal(size=3), np.linspace(-reach, reach, 20))
    coordinates = chart.coordinates(poses)
    distance, angle = pose_error(chart.poses(coordinates), poses)
    assert distance.max() < 1e-12
    assert angle.max() < 1e-7
    assert np.abs(np.diff(coordinates[:, 3:], axis=0)).max() < 0.5


def test_a_turn_through_half_a_turn_is_continuous() -> None:
    coordinates = PoseChart().coordinates(turning(np.array([0.0, 0.0, 1.0]), np.linspace(0.0, 4.5, 50)))
    np.testing.assert_allclose(np.abs(coordinates[:, 5]), np.linspace(0.0, 4.5, 50), atol=1e-7)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_jacobian_matches_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chart, c, rate = PoseChart(rng.normal(size=4)), rng.normal(size=6), rng.normal(size=6)
    step = 1e-6
    before, after = chart.poses(c - step * rate), chart.poses(c + step * rate)
    turn = (after[:3, :3] @ before[:3, :3].T - np.eye(3)) / (2 * step)
    velocity = chart.jacobian(c) @ rate
    np.testing.assert_allclose(velocity[:3], rate[:3], atol=1e-12)
    np.testing.assert_allclose(velocity[3:], [turn[2, 1], turn[0, 2], turn[1, 0]], atol=2e-5)


def test_jacobian_at_the_reference_is_that_of_small_turns() -> None:
    tiny, small = PoseChart().jacobian(np.full(6, 1e-6)), PoseChart().jacobian(np.full(6, 2e-4))
    np.testing.assert_allclose(tiny, np.eye(6), atol=1e-5)
    np.testing.assert_allclose(small, np.eye(6), atol=3e-4)


def demonstrations(count: int = 12, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    share = PHASES**2 * (3 - 2 * PHASES)
    found = []
    for _ in range(count):
        axis = np.array([0.2, 1.0, 0.1]) + 0.1 * rng.normal(size=3)
        poses = turning(axis, (1.4 + 0.1 * rng.normal()) * share)
        poses[:, :3, 3] += 0.02 * rng.normal(size=3) * share[:, None]
        found.append(poses)
    return found


def test_every_mean_and_sample_of_a_task_space_movement_is_a_pose() -> None:
    shown = demonstrations()
    distribution = ProMP().fit_poses(shown, durations=[2.0] * 12)
    assert (distribution.space, distribution.names) == ("task", ("x", "y", "z", "rx", "ry", "rz"))
    for coordinates in (distribution.mean(PHASES), distribution.sample(np.random.default_rng(0), 20, PHASES)):
        poses = distribution.chart.poses(coordinates)
        R = poses[..., :3, :3]
        np.testing.assert_allclose(
            R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12
        )
    distance, angle = pose_error(distribution.chart.poses(distribution.mean([1.0])), shown[0][-1:])
    assert distance[0] < 0.08
    assert angle[0] < 0.5


def test_the_sign_of_a_quaternion_and_the_world_it_is_seen_from_change_nothing() -> None:
    shown = demonstrations()
    promp = ProMP(estimator=Ridge(shrinkage=0.0))  # the estimated one depends on the axes of the positions
    plain = promp.fit_poses(shown)
    turned = make_transform(rotation_from_vector(np.array([2.0, -1.5, 0.7])), np.zeros(3))
    other = promp.fit_poses([turned @ poses for poses in shown])
    np.testing.assert_allclose(
        other.chart.poses(other.mean(PHASES))[:, :3, :3],
        turned[:3, :3] @ plain.chart.poses(plain.mean(PHASES))[:, :3, :3],
        atol=1e-6,
    )
    np.testing.assert_allclose(other.std(PHASES)[:, 3:], plain.std(PHASES)[:, 3:], atol=1e-6)
    flipped = promp.fit_poses(shown, chart=PoseChart(-plain.chart.reference))
    np.testing.assert_allclose(flipped.mean(PHASES), plain.mean(PHASES), atol=1e-9)


def test_task_space_is_saved_with_its_chart(tmp_path) -> None:
    distribution = ProMP().fit_poses(demonstrations())
    back = TrajectoryDistribution.load(distribution.save(tmp_path / "reach.json"))
    np.testing.assert_array_equal(back.chart.reference, distribution.chart.reference)
    np.testing.assert_array_equal(back.weight_mean, distribution.weight_mean)


def test_refusals() -> None:
    with pytest.raises(ShapeError, match="reference"):
        PoseChart(np.zeros(3))
    with pytest.raises(ConfigurationError, match="zero"):
        PoseChart(np.zeros(4))
    chart = PoseChart()
    with pytest.raises(ShapeError, match="pose 1 is not a rigid"):
        chart.coordinates(np.stack([np.eye(4), 2 * np.eye(4)]))
    with pytest.raises(ShapeError, match="pose 0 is not finite"):
        chart.coordinates(np.full((1, 4, 4), np.nan))
    with pytest.raises(ShapeError, match=r"\(T ≥ 1, 4, 4\)"):
        chart.coordinates(np.eye(4))
    with pytest.raises(ShapeError, match="coordinates"):
        chart.poses(np.zeros(7))
    with pytest.raises(ConfigurationError, match="from the reference"):
        chart.coordinates(turning(np.array([0.0, 0.0, 1.0]), np.linspace(0.0, 6.25, 60)))
    with pytest.raises(ShapeError, match="six coordinates"):
        TrajectoryDistribution(GaussianBasis(), np.zeros((7, 8)), np.eye(56), space="task")
    with pytest.raises(ConfigurationError, match="belongs to task space"):
        TrajectoryDistribution(GaussianBasis(), np.zeros((6, 8)), np.eye(48), chart=chart)
    with pytest.raises(ShapeError, match="no demonstrations"):
        ProMP().fit_poses([])
