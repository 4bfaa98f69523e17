import frankik
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ShapeError
from punnet.geometry import (
    is_transform,
    make_transform,
    quaternion_angle,
    quaternion_from_rotation,
    rotation_from_vector,
)
from punnet.robot import HOME, JOINT_NAMES, PANDA_LIMITS, T_FLANGE_TOOL, Panda

ARM = Panda()
HAND_TURN = rotation_from_vector([0.0, 0.0, -np.pi / 4])


def random_joints(seed, count):
    return np.random.default_rng(seed).uniform(PANDA_LIMITS.lower, PANDA_LIMITS.upper, (count, 7))


def test_forward_kinematics_agrees_with_28767_samples_of_a_real_arm(shared_data):
    log = np.load(shared_data / "panda_logs" / "platonics_panda.npz")
    columns = {str(name): i for i, name in enumerate(log["columns"])}
    rows = np.concatenate([log[f"trial{i}"] for i in range(1, 6)]).astype(np.float64)
    assert len(rows) == 28_767
    joints = rows[:, [columns[f"joint_{i}"] for i in range(1, 8)]]
    hand = ARM.forward_kinematics(joints) @ make_transform(HAND_TURN, (0.0, 0.0, 0.1034))
    position = rows[:, [columns[f"current_pos_{axis}"] for axis in "xyz"]]
    quaternion = rows[:, [columns[f"current_orientation_{axis}"] for axis in "xyzw"]]
    residual = hand[:, :3, 3] - position
    assert (residual.std(axis=0) <= 1.1e-3).all()
    assert (np.abs(residual.mean(axis=0)) <= 1e-4).all()
    angle = quaternion_angle(quaternion_from_rotation(hand[:, :3, :3]), quaternion)
    assert np.degrees(np.median(angle)) < 0.02


def test_forward_kinematics_agrees_with_frankik():
    # frankik's pose is the hand's tool point, turned by −45° and 103.4 mm ahead of the flange.
    T_flange_hand = make_transform(HAND_TURN, (0.0, 0.0, 0.1034))
    for joints in random_joints(0, 100):
        np.testing.assert_allclose(
            ARM.forward_kinematics(joints) @ T_flange_hand, frankik.fk(joints), atol=1e-12
        )


def test_home_is_where_the_lab_rig_has_it():
    T = ARM.forward_kinematics(HOME)
    np.testing.assert_allclose(T[:3, 3], (0.28, -0.06, 0.73), atol=0.006)
    assert T[0, 2] > 0.97  # looks along +x
    assert T[2, 0] > 0.97  # flange x is up
    assert T[1, 1] < -0.99  # flange y is to the robot's right
    assert ARM.within_limits(HOME)
    np.testing.assert_array_equal(ARM.home, HOME)


def test_shapes_are_batched():
    joints = random_joints(1, 12).reshape(3, 4, 7)
    T, J = ARM.forward_kinematics(joints), ARM.jacobian(joints)
    assert T.shape == (3, 4, 4, 4)
    assert J.shape == (3, 4, 6, 7)
    assert ARM.manipulability(joints).shape == ARM.limit_margin(joints).shape == (3, 4)
    np.testing.assert_allclose(T[1, 2], ARM.forward_kinematics(joints[1, 2]), atol=1e-14)
    np.testing.assert_allclose(J[1, 2], ARM.jacobian(joints[1, 2]), atol=1e-14)
    assert all(is_transform(pose) for pose in T.reshape(-1, 4, 4))
    for bad in (np.zeros(6), np.zeros((7, 6)), 0.0):
        with pytest.raises(ShapeError, match=r"\(\.\.\., 7\)"):
            ARM.forward_kinematics(bad)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_jacobian_is_the_derivative(seed):
    joints = random_joints(seed, 1)[0]
    step = 1e-6
    for pose, jacobian in (
        (ARM.forward_kinematics, ARM.jacobian),
        (ARM.tool_kinematics.pose, ARM.tool_kinematics.jacobian),
    ):
        rate = (pose(joints + step * np.eye(7)) - pose(joints - step * np.eye(7))) / (2 * step)
        J = jacobian(joints)
        np.testing.assert_allclose(rate[:, :3, 3].T, J[:3], atol=1e-8)
        spin = rate[:, :3, :3] @ pose(joints)[:3, :3].T
        np.testing.assert_allclose(spin[:, (2, 0, 1), (1, 2, 0)].T, J[3:], atol=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(-2.0, 2.0))
def test_turning_the_base_turns_everything(seed, angle):
    joints = random_joints(seed, 1)[0]
    turned = joints + angle * np.eye(7)[0]
    turn = make_transform(rotation_from_vector([0.0, 0.0, angle]), np.zeros(3))
    np.testing.assert_allclose(
        ARM.forward_kinematics(turned), turn @ ARM.forward_kinematics(joints), atol=1e-12
    )
    assert ARM.manipulability(turned) == pytest.approx(float(ARM.manipulability(joints)), abs=1e-12)


def test_manipulability_is_zero_where_axes_line_up():
    assert ARM.manipulability([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) < 1e-6
    assert ARM.manipulability(HOME) > 0.05


def test_tool_and_flange_poses_are_inverse():
    T_tool = ARM.forward_kinematics_tool(HOME)
    np.testing.assert_allclose(T_tool, ARM.forward_kinematics(HOME) @ T_FLANGE_TOOL, atol=1e-15)
    np.testing.assert_allclose(ARM.flange_pose(T_tool), ARM.forward_kinematics(HOME), atol=1e-14)
    bare = Panda(T_flange_tool=np.eye(4))
    np.testing.assert_array_equal(bare.forward_kinematics_tool(HOME), bare.forward_kinematics(HOME))
    with pytest.raises(ShapeError, match="T_flange_tool"):
        Panda(T_flange_tool=np.ones((4, 4)))


def test_limits():
    assert len(JOINT_NAMES) == 7
    middle = (PANDA_LIMITS.lower + PANDA_LIMITS.upper) / 2
    assert ARM.within_limits(middle, margin=1.5)
    assert not ARM.within_limits(middle, margin=1.51)  # joint 4 has ±1.501 rad
    edge = middle.copy()
    edge[3] = PANDA_LIMITS.upper[3] + 0.01
    assert ARM.limit_margin(edge) == pytest.approx(-0.01)
    assert not ARM.within_limits(edge)
    assert not ARM.within_limits(np.full(7, np.nan))
    np.testing.assert_array_equal(ARM.within_limits(np.stack((middle, edge))), [True, False])
