from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import make_transform, pose_error, quaternion_from_rotation, rotation_from_quaternion
from punnet.movement import (
    GaussianBasis,
    PoseChart,
    TrajectoryDistribution,
    from_quaternion_weights,
    in_basis,
    in_chart,
    to_task_space,
)
from punnet.movement.pushforward import from_quaternion_factor, pushed_forward
from punnet.planning import ProMPDepthPlanner
from punnet.robot import Panda

ARM = Panda()
REACH = ProMPDepthPlanner.from_bundle().promp
PHASES = np.linspace(0.0, 1.0, 31)


def test_task_space_of_an_arm_has_the_poses_and_the_spread_of_its_samples() -> None:
    narrow = TrajectoryDistribution(REACH.basis, REACH.weight_mean, 0.01 * REACH.weight_covariance)
    task = to_task_space(narrow, ARM.tool_kinematics)
    distance, angle = pose_error(
        task.chart.poses(task.mean(PHASES)), ARM.forward_kinematics_tool(narrow.mean(PHASES))
    )
    assert distance.max() < 0.002
    assert angle.max() < 0.01
    joints = narrow.sample(np.random.default_rng(0), 600, PHASES)
    coordinates = np.stack([task.chart.coordinates(ARM.forward_kinematics_tool(q)) for q in joints])
    np.testing.assert_allclose(task.std(PHASES), coordinates.std(axis=0), rtol=0.15, atol=5e-4)


def test_another_chart_shows_the_same_poses() -> None:
    task = to_task_space(REACH, ARM.tool_kinematics)
    turned = in_chart(task, PoseChart(task.chart.reference + 0.2))
    distance, angle = pose_error(task.chart.poses(task.mean(PHASES)), turned.chart.poses(turned.mean(PHASES)))
    assert distance.max() < 1e-9
    assert angle.max() < 0.01
    back = in_chart(turned, task.chart)
    np.testing.assert_allclose(back.std(PHASES), task.std(PHASES), rtol=0.02, atol=1e-4)


def test_recorded_basis_is_left_for_a_better_one() -> None:
    recorded = in_basis(REACH, GaussianBasis.recorded())
    back = in_basis(recorded, GaussianBasis())
    assert np.abs(recorded.weight_mean).max() > 3 * np.abs(REACH.weight_mean).max()
    assert np.abs(back.mean(PHASES) - recorded.mean(PHASES)).max() < 0.01
    assert np.abs(recorded.mean(PHASES) - REACH.mean(PHASES)).max() < 0.05


def test_recorded_quaternion_weights_become_poses(shared_data: Path) -> None:
    weights = np.load(shared_data / "reach" / "promp_weights.npz")
    basis = GaussianBasis.recorded()
    for mean in weights["task_mean"][:10]:
        task = from_quaternion_weights(basis, mean, 1e-6 * np.eye(56))
        raw = basis.phi(PHASES) @ mean.T
        poses = task.chart.poses(task.mean(PHASES))
        np.testing.assert_allclose(poses[:, :3, 3], raw[:, :3], atol=1e-3)
        q = raw[:, 3:] / np.linalg.norm(raw[:, 3:], axis=1, keepdims=True)
        assert np.abs(np.einsum("ti,ti->t", quaternion_from_rotation(poses[:, :3, :3]), q)).min() > 0.9999


def test_quaternion_weights_of_a_known_movement() -> None:
    """Spread of a free quaternion across the sphere is kept, spread along its length falls away."""
    basis = GaussianBasis()
    mean = np.zeros((7, 8))
    mean[6] = 2.0  # the identity, twice as long as it should be
    variances = np.repeat([1e-4, 1e-4, 1e-4, 4e-4, 4e-4, 4e-4, 1.0], 8)
    task = from_quaternion_weights(basis, mean, np.diag(variances), duration=3.0)
    expected = np.sqrt((basis.phi(PHASES) ** 2).sum(axis=1))
    np.testing.assert_allclose(task.std(PHASES)[:, 0], 0.01 * expected, rtol=1e-6)
    # ξ = 2 v / |q|, with |q| = 2.
    np.testing.assert_allclose(task.std(PHASES)[:, 3:], 0.02 * expected[:, None] * np.ones(3), rtol=1e-6)
    assert task.duration == 3.0


def test_refusals() -> None:
    task = to_task_space(REACH, ARM.tool_kinematics)
    with pytest.raises(ConfigurationError, match="in task space already"):
        to_task_space(task, ARM.tool_kinematics)
    with pytest.raises(ConfigurationError, match="no chart"):
        in_chart(REACH, PoseChart())
    basis = GaussianBasis()
    with pytest.raises(ShapeError, match="must be"):
        from_quaternion_weights(basis, np.zeros((6, 8)), np.eye(48))
    with pytest.raises(ShapeError, match="length of 0"):
        from_quaternion_weights(basis, np.zeros((7, 8)), np.eye(56))
    with pytest.raises(ShapeError, match="finite"):
        from_quaternion_weights(basis, np.full((7, 8), np.nan), np.eye(56))


def test_quaternions_are_pushed_forward_as_poses_are() -> None:
    """The quick way of quaternion weights is the general one: the map of its poses, differentiated numerically."""
    rng = np.random.default_rng(1)
    basis, mean = GaussianBasis(), rng.normal(size=(7, 8))
    mean[3:] = 0.3 * rng.normal(size=(4, 8)) + np.array([[0.5], [-0.4], [0.2], [-0.9]])
    factor = 0.02 * rng.normal(size=(56, 5))
    quick = from_quaternion_factor(basis, mean, factor)

    def coordinates(x: np.ndarray) -> np.ndarray:
        return quick.chart.coordinates(make_transform(rotation_from_quaternion(x[:, 3:]), x[:, :3]))

    def derivative(x: np.ndarray) -> np.ndarray:
        steps = 1e-6 * np.eye(7)
        return np.stack([(coordinates(x + s) - coordinates(x - s)) / 2e-6 for s in steps], axis=2)

    weights, spread = pushed_forward(basis, mean, factor @ factor.T, coordinates, derivative)
    np.testing.assert_allclose(quick.weight_mean, weights, atol=1e-9)
    np.testing.assert_allclose(quick.weight_covariance, spread, atol=1e-9)
    slow = from_quaternion_weights(basis, mean, factor @ factor.T)
    np.testing.assert_allclose(slow.weight_covariance, quick.weight_covariance, atol=1e-12)
