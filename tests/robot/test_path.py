import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import KinematicsError, ShapeError
from punnet.geometry import make_transform, rotation_from_vector, vector_from_rotation
from punnet.movement import retime
from punnet.robot import HOME, PANDA_LIMITS, Panda, follow_path

ARM = Panda()
AT_HOME = ARM.forward_kinematics(HOME)
LEVEL = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])


def reach(goal, rotation=LEVEL, count=150, begin=AT_HOME):
    """Straight poses (T, 4, 4) from home to a goal."""
    share = np.linspace(0.0, 1.0, count)[:, None]
    share = share**2 * (3 - 2 * share)
    turn = vector_from_rotation(begin[:3, :3].T @ rotation)
    position = begin[:3, 3] + share * (np.asarray(goal) - begin[:3, 3])
    return make_transform(begin[:3, :3] @ rotation_from_vector(share * turn), position)


def assert_follows(joints, poses, margin=0.03, step=0.3):
    assert joints.shape == (len(poses), 7)
    assert np.abs(ARM.forward_kinematics(joints) - poses).max() < 1e-9
    assert ARM.within_limits(joints, margin - 1e-5).all()
    assert np.abs(np.diff(joints, axis=0)).max(initial=0.0) < step


@settings(max_examples=15, deadline=None)
@given(st.floats(0.50, 0.60), st.floats(-0.20, 0.16), st.floats(0.60, 0.85))
def test_reaches_to_berries_are_continuous_smooth_and_exact(x, y, z):
    poses = reach((x, y, z))
    joints = follow_path(poses, HOME)
    assert_follows(joints, poses)
    np.testing.assert_allclose(joints[0], HOME, atol=1e-8)
    assert np.abs(np.diff(joints, 2, axis=0)).max() < 0.02


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_follows_the_poses_of_any_joint_path_between_comfortable_arms(seed):
    random = np.random.default_rng(seed)
    ends = HOME + random.uniform(-0.3, 0.3, (2, 7))
    poses = ARM.forward_kinematics(np.linspace(ends[0], ends[1], 60))
    joints = follow_path(poses, ends[0])
    assert_follows(joints, poses)
    # It is no longer than the path that the poses were made from, but for comfort.
    assert np.abs(np.diff(joints, axis=0)).sum() < 2 * np.abs(ends[1] - ends[0]).sum() + 1.0


def test_reach_takes_about_a_second():
    poses = reach((0.56, 0.0, 0.80))
    trajectory = retime(follow_path(poses, HOME), PANDA_LIMITS)
    assert trajectory.duration < 1.2
    assert np.abs(ARM.forward_kinematics(trajectory.end) - poses[-1]).max() < 1e-9


def test_without_start_it_begins_where_it_likes():
    poses = reach((0.55, 0.05, 0.7))
    joints = follow_path(poses)
    assert_follows(joints, poses)


def test_start_elsewhere_is_come_near_to():
    poses = reach((0.55, 0.05, 0.8))[20:]
    assert_follows(follow_path(poses, HOME), poses)


def test_passes_an_upright_upper_arm():
    """At q2 = 0 the axes of joints 1 and 3 coincide: the branches of the analytic solution meet there."""
    begin, end = HOME.copy(), HOME.copy()
    begin[1], end[1] = -0.3, 0.3
    poses = ARM.forward_kinematics(np.linspace(begin, end, 100))
    joints = follow_path(poses, begin)
    assert_follows(joints, poses)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.05


def test_standing_still_and_single_poses():
    poses = np.repeat(AT_HOME[None], 20, axis=0)
    np.testing.assert_allclose(follow_path(poses, HOME), np.tile(HOME, (20, 1)), atol=1e-6)
    assert_follows(follow_path(poses[:1], HOME), poses[:1])
    assert_follows(follow_path(poses[:1]), poses[:1])


def test_the_unreachable_pose_is_named():
    poses = reach((0.75, 0.0, 1.3))
    with pytest.raises(KinematicsError, match=r"pose \d+ of the path") as caught:
        follow_path(poses, HOME)
    index = int(str(caught.value).split()[1])
    assert_follows(follow_path(poses[: index - 10], HOME), poses[: index - 10])


def test_a_jump_is_refused():
    poses = np.stack((AT_HOME, reach((0.5, 0.3, 0.5))[-1]))
    with pytest.raises(KinematicsError, match="pose 1 of the path"):
        follow_path(poses, HOME)


@pytest.mark.parametrize(
    ("poses", "start", "words"),
    [
        (np.eye(4), None, "T ≥ 1"),
        (np.zeros((0, 4, 4)), None, "T ≥ 1"),
        (np.stack((np.eye(4), np.ones((4, 4)))), None, "pose 1 is not a rigid"),
        (np.full((1, 4, 4), np.nan), None, "pose 0 is not a rigid"),
        (np.eye(4)[None], np.zeros(6), "7 finite joints"),
        (np.eye(4)[None], np.full(7, np.nan), "7 finite joints"),
    ],
)
def test_bad_input_is_refused(poses, start, words):
    with pytest.raises(ShapeError, match=words):
        follow_path(poses, start)
