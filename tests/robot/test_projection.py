import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.geometry import make_transform
from punnet.robot import HOME, Panda
from punnet.robot.projection import projected, relaxed

ARM = Panda()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_a_disturbed_arm_comes_back_onto_its_pose_by_a_short_way(seed):
    random = np.random.default_rng(seed)
    joints = HOME + random.uniform(-0.2, 0.2, (20, 7))
    disturbance = random.normal(0.0, 0.05, (20, 7))
    poses = ARM.forward_kinematics(joints)
    found = projected(ARM, joints + disturbance, poses)
    assert np.abs(ARM.forward_kinematics(found) - poses).max() < 1e-9
    shift = np.linalg.norm(found - joints - disturbance, axis=1)
    assert (shift <= 1.1 * np.linalg.norm(disturbance, axis=1)).all()


def test_what_cannot_converge_is_nan():
    found = projected(ARM, HOME[None], make_transform(np.eye(3), (3.0, 0.0, 0.0))[None])
    assert np.isnan(found).all()


def test_relaxing_smooths_noise_in_the_free_direction_and_keeps_poses_and_ends():
    smooth = np.linspace(HOME, HOME + 0.3, 80)
    poses = ARM.forward_kinematics(smooth)
    null = np.linalg.svd(ARM.jacobian(smooth))[2][:, -1]
    null *= np.sign(null[:, :1])
    noise = np.random.default_rng(0).normal(0.0, 0.02, (80, 1))
    noise[[0, -1]] = 0.0
    rough = projected(ARM, smooth + noise * null, poses)
    found = relaxed(ARM, rough, poses)
    assert np.abs(ARM.forward_kinematics(found) - poses).max() < 1e-9
    np.testing.assert_array_equal(found[[0, -1]], rough[[0, -1]])
    roughness = [np.square(np.diff(path, 2, axis=0)).sum() for path in (rough, found)]
    assert roughness[1] < 0.01 * roughness[0]


def test_relaxing_stops_at_the_limits():
    joints = np.linspace(HOME, HOME + 0.3, 30)
    poses = ARM.forward_kinematics(joints)
    margin = float(ARM.limit_margin(joints).min()) + 1.0
    np.testing.assert_array_equal(relaxed(ARM, joints, poses, margin=margin), joints)
