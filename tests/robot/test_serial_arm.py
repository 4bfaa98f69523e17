import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import KinematicsError, ShapeError
from punnet.robot import Panda, nearest_solution, nearest_solutions
from punnet.robot.path import follow_path

seeds = st.integers(0, 2**32 - 1)


def test_franka_as_data_is_the_panda_of_the_closed_form(fr3, rng):
    """The same geometry, written down by two: a model file read by MuJoCo, and the maker's table."""
    panda = Panda()
    joints = rng.uniform(panda.limits.lower, panda.limits.upper, (200, 7))
    assert np.abs(fr3.forward_kinematics(joints) - panda.forward_kinematics(joints)).max() < 1e-6
    assert np.abs(fr3.jacobian(joints) - panda.jacobian(joints)).max() < 1e-6
    assert np.abs(fr3.manipulability(joints) - panda.manipulability(joints)).max() < 1e-6


def test_forward_kinematics_is_mujocos(six_joints, six_joint_model, rng):
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(six_joint_model))
    data = mujoco.MjData(model)
    joints = rng.uniform(-1.0, 1.0, (20, 6))
    for q, T in zip(joints, six_joints.forward_kinematics(joints), strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        body = data.body("flange")
        assert np.abs(T[:3, 3] - body.xpos - (0.0, 0.0, 0.2)).max() < 1e-9  # mounted 0.2 m up
        assert np.abs(T[:3, :3] - body.xmat.reshape(3, 3)).max() < 1e-9


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_jacobian_is_the_derivative_of_the_forward_kinematics(six_joints, seed):
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, 6)
    step = 1e-6 * np.eye(6)
    ahead, behind = six_joints.forward_kinematics(q + step), six_joints.forward_kinematics(q - step)
    J = six_joints.jacobian(q)
    assert np.abs(J[:3].T - (ahead[:, :3, 3] - behind[:, :3, 3]) / 2e-6).max() < 1e-7
    turning = (ahead[:, :3, :3] - behind[:, :3, :3]) / 2e-6 @ six_joints.forward_kinematics(q)[:3, :3].T
    assert np.abs(J[3:].T - turning[:, (2, 0, 1), (1, 2, 0)]).max() < 1e-7


def test_inverse_kinematics_brings_the_flange_there(six_joints, rng):
    q = rng.uniform(six_joints.limits.lower + 0.05, six_joints.limits.upper - 0.05, (60, 6))
    poses = six_joints.forward_kinematics(q)
    found = nearest_solutions(poses, six_joints.home, arm=six_joints)
    reached = np.isfinite(found).all(axis=1)
    assert reached.mean() > 0.95
    assert np.abs(six_joints.forward_kinematics(found[reached]) - poses[reached]).max() < 1e-9
    assert six_joints.within_limits(found[reached], 0.0299).all()
    assert (nearest_solutions(poses[:3], six_joints.home, arm=six_joints) == found[:3]).all()


def test_pose_out_of_reach_is_said_to_be(six_joints):
    far = six_joints.forward_kinematics(six_joints.home)
    far[0, 3] += 3.0
    assert np.isnan(nearest_solutions(far[None], six_joints.home, arm=six_joints)).all()
    with pytest.raises(KinematicsError, match="can't be reached"):
        nearest_solution(far, six_joints.home, arm=six_joints)


def test_path_is_followed_from_the_start_without_jumps(six_joints):
    start = six_joints.home
    poses = np.tile(six_joints.forward_kinematics(start), (40, 1, 1))
    poses[:, :3, 3] += np.linspace(0.0, 0.08, 40)[:, None] * np.array([0.3, 0.8, -0.5])
    path = follow_path(poses, start, arm=six_joints)
    assert np.abs(six_joints.forward_kinematics(path) - poses).max() < 1e-8
    assert np.abs(path[0] - start).max() < 1e-6
    assert np.abs(np.diff(path, axis=0)).max() < 0.05


def test_joint_that_turns_more_than_once_stays_near_the_reference(ur5):
    turned = ur5.home + np.where(ur5.limits.upper > 6.0, 2 * np.pi * np.sign(-ur5.home), 0.0)
    inside = ur5.within_limits(turned)
    assert inside
    found = nearest_solution(ur5.forward_kinematics(ur5.home), turned, arm=ur5)
    assert np.abs(found - turned).max() < 1e-6


def test_wrong_number_of_joints_is_refused(six_joints):
    with pytest.raises(ShapeError, match=r"joints must be \(\.\.\., 6\)"):
        six_joints.forward_kinematics(np.zeros(7))
    with pytest.raises(ShapeError, match=r"joints \(6,\)"):
        nearest_solutions(np.eye(4)[None], np.zeros(7), arm=six_joints)
