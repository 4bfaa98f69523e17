import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, KinematicsError, ShapeError
from punnet.geometry import make_transform, pose_error
from punnet.movement import (
    GaussianBasis,
    PoseViaPoint,
    TrajectoryDistribution,
    ViaPoint,
    condition_on_poses,
    to_task_space,
)
from punnet.planning import ProMPDepthPlanner
from punnet.robot import HOME, Panda

ARM = Panda()
REACH = ProMPDepthPlanner.from_bundle().promp.broadened(0.05)
KINEMATICS = ARM.tool_kinematics
PHASES = np.linspace(0.0, 1.0, 21)


def near_the_end(seed: int) -> np.ndarray:
    """A tool pose some centimetres from the mean's last one, which the arm can reach."""
    end = REACH.mean([1.0])[0]
    return ARM.forward_kinematics_tool(end + np.random.default_rng(seed).normal(0.0, 0.12, 7))


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000))
def test_the_mean_meets_poses_and_joints_together_and_nothing_spreads(seed: int) -> None:
    pose = near_the_end(seed)
    reach = condition_on_poses(REACH, [PoseViaPoint(1.0, pose)], KINEMATICS, via_points=[ViaPoint(0.0, HOME)])
    distance, angle = pose_error(ARM.forward_kinematics_tool(reach.mean([1.0])), pose[None])
    assert distance[0] < 1e-6
    assert angle[0] < 1e-6
    np.testing.assert_allclose(reach.mean([0.0])[0], HOME, atol=1e-8)
    scale = np.abs(REACH.weight_covariance).max()
    assert np.linalg.eigvalsh(reach.weight_covariance)[0] > -1e-9 * scale
    assert (reach.std(PHASES) <= REACH.std(PHASES) + 1e-6).all()


def test_what_is_left_of_the_spread_is_at_most_the_noise_that_was_allowed() -> None:
    pose = near_the_end(1)
    reach = condition_on_poses(
        REACH, [PoseViaPoint(1.0, pose, position_std=0.005, rotation_std=0.02)], KINEMATICS
    )
    J = ARM.jacobian_tool(reach.mean([1.0])[0])
    left = np.sqrt(np.diag(J @ reach.covariance([1.0])[0] @ J.T))
    assert (left[:3] <= 0.005).all()
    assert (left[3:] <= 0.02).all()
    assert (left > 0.001).all()
    distance, angle = pose_error(ARM.forward_kinematics_tool(reach.mean([1.0])[0]), pose)
    assert distance < 0.005
    assert angle < 0.02
    # The samples too, as long as the elbow's freedom does not bend them off the pose.
    narrow = TrajectoryDistribution(REACH.basis, reach.weight_mean, 0.1 * reach.weight_covariance)
    joints = narrow.sample(np.random.default_rng(0), 400, [1.0])[:, 0]
    assert (ARM.forward_kinematics_tool(joints)[:, :3, 3].std(axis=0) < 0.005).all()


def test_a_free_orientation_asks_for_the_point_alone() -> None:
    pose = near_the_end(2)
    reach = condition_on_poses(REACH, [PoseViaPoint(1.0, pose, rotation_std=np.inf)], KINEMATICS)
    T = ARM.forward_kinematics_tool(reach.mean([1.0])[0])
    np.testing.assert_allclose(T[:3, 3], pose[:3, 3], atol=1e-6)
    assert pose_error(T, pose)[1] > 1e-3


def test_it_is_the_most_likely_trajectory() -> None:
    """No other trajectory of the same poses, found by moving in the null space, is more likely."""
    pose = near_the_end(3)
    found = condition_on_poses(REACH, [PoseViaPoint(1.0, pose)], KINEMATICS)
    root = np.linalg.cholesky(REACH.weight_covariance + 1e-12 * np.eye(56))

    def cost(w: np.ndarray) -> float:
        return float(np.square(np.linalg.solve(root, w - REACH.weight_mean.ravel())).sum())

    best = cost(found.weight_mean.ravel())
    rng = np.random.default_rng(0)
    for _ in range(5):
        asked = found.mean([0.5])[0] + rng.normal(0.0, 0.05, 7)
        other = condition_on_poses(
            REACH, [PoseViaPoint(1.0, pose)], KINEMATICS, via_points=[ViaPoint(0.5, asked)]
        )
        assert cost(other.weight_mean.ravel()) > best


def test_task_space_uses_its_own_chart_and_agrees_with_the_arm() -> None:
    task = to_task_space(REACH, KINEMATICS)
    pose = near_the_end(4)
    reach = condition_on_poses(task, [PoseViaPoint(1.0, pose)])
    distance, angle = pose_error(reach.chart.poses(reach.mean([1.0])), pose[None])
    assert distance[0] < 1e-6
    assert angle[0] < 1e-6


def test_out_of_reach_is_said() -> None:
    far = make_transform(np.eye(3), (3.0, 0.0, 0.5))
    with pytest.raises(
        KinematicsError, match=r"pose via-point 0 at phase 1, \[3.0, 0.0, 0.5\] m, is missed by"
    ):
        condition_on_poses(REACH, [PoseViaPoint(1.0, far)], KINEMATICS)
    # With a std it is a wish: the arm goes as far as the demonstrations allow.
    wish = condition_on_poses(REACH, [PoseViaPoint(1.0, far, 1.0, 1.0)], KINEMATICS)
    assert np.isfinite(wish.mean(PHASES)).all()


def test_contradictions_are_said() -> None:
    one, other = near_the_end(5), near_the_end(6)
    with pytest.raises(KinematicsError, match="missed"):
        condition_on_poses(REACH, [PoseViaPoint(1.0, one), PoseViaPoint(1.0, other)], KINEMATICS)
    same = condition_on_poses(REACH, [PoseViaPoint(1.0, one), PoseViaPoint(1.0, one)], KINEMATICS)
    assert pose_error(ARM.forward_kinematics_tool(same.mean([1.0])[0]), one)[0] < 1e-6


def test_refusals() -> None:
    with pytest.raises(ConfigurationError, match="kinematics"):
        condition_on_poses(REACH, [PoseViaPoint(1.0, np.eye(4))])
    with pytest.raises(ShapeError, match="rigid"):
        PoseViaPoint(0.5, np.zeros((4, 4)))
    for wrong in ({"phase": 1.2}, {"position_std": -1.0}, {"position_std": np.inf, "rotation_std": np.inf}):
        with pytest.raises(ConfigurationError, match="pose via-point"):
            PoseViaPoint(**{"phase": 0.5, "pose": np.eye(4), **wrong})
    assert condition_on_poses(REACH, [], KINEMATICS) is REACH
    fixed = TrajectoryDistribution(GaussianBasis(), REACH.weight_mean, np.zeros((56, 56)))
    with pytest.raises(KinematicsError, match="missed"):
        condition_on_poses(fixed, [PoseViaPoint(1.0, near_the_end(7))], KINEMATICS)
