import frankik
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ShapeError
from punnet.geometry import make_transform
from punnet.robot import HOME, PANDA_LIMITS, Panda
from punnet.robot.inverse_kinematics import BRANCHES, solve, solve_any
from tests.timing import times_as_long

ARM = Panda()


def random_joints(seed, count):
    return np.random.default_rng(seed).uniform(PANDA_LIMITS.lower, PANDA_LIMITS.upper, (count, 7))


def worst_pose_error(joints, poses):
    return np.abs(ARM.forward_kinematics(joints) - poses).max()


def test_every_solution_is_exact_and_the_true_one_is_among_them():
    joints = random_joints(0, 3000)
    poses = ARM.forward_kinematics(joints)
    found = solve(poses, joints[:, 6])
    assert found.shape == (3000, BRANCHES, 7)
    exists = ~np.isnan(found[..., 0])
    index = np.nonzero(exists)
    assert worst_pose_error(found[index], poses[index[0]]) < 1e-12
    assert ARM.within_limits(found[index]).all()
    nearest = np.nanmin(np.abs(found - joints[:, None]).max(axis=-1), axis=1)
    assert nearest.max() < 1e-6


def test_finds_all_that_frankik_finds_and_more():
    more = 0
    for joints in random_joints(1, 300):
        pose = ARM.forward_kinematics(joints)
        theirs = frankik.ik_full(pose, q7=joints[6])
        ours = solve(pose, joints[6])
        for arm in theirs[~np.isnan(theirs).any(axis=1)]:
            if worst_pose_error(arm, pose) < 1e-9 and ARM.within_limits(arm):
                assert np.nanmin(np.abs(ours - arm).max(axis=-1)) < 1e-6
        more += int((~np.isnan(ours[:, 0])).sum() - (~np.isnan(theirs).any(axis=1)).sum() > 0)
    assert more > 0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 100_000))
def test_inverse_of_forward_is_the_identity_on_poses(seed):
    joints = random_joints(seed, 1)[0]
    pose = ARM.forward_kinematics(joints)
    found = solve(pose, joints[6])
    assert np.nanmin(np.abs(found - joints).max(axis=-1)) < 1e-6


def test_at_least_999_of_1000_reachable_poses_are_solved():
    joints = random_joints(2, 10_000)
    poses = ARM.forward_kinematics(joints)
    found = solve_any(poses)
    solved = ~np.isnan(found[:, 0])
    assert solved.mean() >= 0.999
    assert ARM.within_limits(found[solved]).all()
    assert worst_pose_error(found[solved], poses[solved]) < 1e-9


def test_singular_arms_are_solved_exactly():
    upright = HOME.copy()
    upright[1] = 0.0  # joints 1 and 3 in line
    bent = HOME.copy()
    bent[5] = 0.0
    for joints in (upright, bent):
        pose = ARM.forward_kinematics(joints)
        found = solve(pose, joints[6])
        exists = ~np.isnan(found[:, 0])
        assert exists.any()
        assert worst_pose_error(found[exists], pose) < 1e-9


def test_150_poses_with_all_branches_take_a_few_times_what_forward_kinematics_take():
    joints = random_joints(3, 150)
    poses = ARM.forward_kinematics(joints)
    # Five times; 0.8 ms on a quiet core.
    assert times_as_long(lambda: solve(poses, 0.3), lambda: ARM.forward_kinematics(joints), turns=20) < 12


def test_shapes_broadcast():
    joints = random_joints(4, 5)
    poses = ARM.forward_kinematics(joints)
    grid = np.linspace(-2.0, 2.0, 9)
    swept = solve(poses[:, None], grid)
    assert swept.shape == (5, 9, BRANCHES, 7)
    np.testing.assert_array_equal(swept[3, 4], solve(poses[3], grid[4]))
    assert solve(poses[0], 0.1).shape == (BRANCHES, 7)
    assert solve_any(poses[0]).shape == (7,)
    assert solve_any(poses.reshape(5, 1, 4, 4)).shape == (5, 1, 7)
    assert solve_any(np.zeros((0, 4, 4))).shape == (0, 7)
    with pytest.raises(ShapeError, match="broadcast"):
        solve(poses, np.zeros(3))
    for call in (lambda: solve(np.eye(3), 0.0), lambda: solve_any(np.eye(3))):
        with pytest.raises(ShapeError, match="4, 4"):
            call()


def test_margin_is_kept():
    poses = ARM.forward_kinematics(random_joints(5, 500))
    found = solve(poses[:, None], np.linspace(-2.8, 2.8, 15), margin=0.2)
    exists = ~np.isnan(found[..., 0])
    assert ARM.within_limits(found[exists], 0.2).all()
    best = solve_any(poses, margin=0.2)
    assert ARM.within_limits(best[~np.isnan(best[:, 0])], 0.2).all()


def test_out_of_reach_is_nan():
    far = make_transform(np.eye(3), [[2.0, 0.0, 0.5], [0.0, 0.0, 0.34]])
    assert np.isnan(solve_any(far[0])).all()
    assert np.isnan(solve(far[0], 0.0)).all()
    assert np.isnan(solve(np.full((4, 4), np.nan), 0.0)).all()
