import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import KinematicsError, ShapeError
from punnet.geometry import make_transform
from punnet.robot import HOME, PANDA_LIMITS, Panda, nearest_solution, nearest_solutions
from punnet.robot.inverse_kinematics import solve
from tests.timing import times_as_long

ARM = Panda()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_none_of_a_dense_sweep_is_nearer(seed):
    random = np.random.default_rng(seed)
    joints = random.uniform(PANDA_LIMITS.lower + 0.1, PANDA_LIMITS.upper - 0.1)
    reference = joints + random.normal(0.0, 0.1, 7)
    pose = ARM.forward_kinematics(joints)
    found = nearest_solution(pose, reference)
    assert np.abs(ARM.forward_kinematics(found) - pose).max() < 1e-9
    assert ARM.within_limits(found, 0.03 - 1e-9)
    swept = solve(pose, np.linspace(-2.86, 2.86, 3000), margin=0.03)
    best = np.sqrt(np.nanmin(np.square(swept - reference).sum(axis=-1)))
    # Where two branches meet, the last step of the search in q7 is up to this far in the other joints.
    assert np.linalg.norm(found - reference) <= best + 0.05


def test_the_reference_itself_is_returned():
    np.testing.assert_allclose(nearest_solution(ARM.forward_kinematics(HOME), HOME), HOME, atol=1e-9)


def test_many_at_once_and_nan_where_there_is_none():
    poses = np.stack((ARM.forward_kinematics(HOME), make_transform(np.eye(3), (2.0, 0.0, 0.0))))
    found = nearest_solutions(poses, HOME)
    np.testing.assert_allclose(found[0], HOME, atol=1e-9)
    assert np.isnan(found[1]).all()


def test_failures_are_named():
    with pytest.raises(KinematicsError, match=r"\(2\.000, 0\.000, 0\.000\) m can't be reached"):
        nearest_solution(make_transform(np.eye(3), (2.0, 0.0, 0.0)), HOME)
    with pytest.raises(ShapeError, match="rigid"):
        nearest_solution(np.ones((4, 4)), HOME)
    with pytest.raises(ShapeError, match="joints"):
        nearest_solutions(np.eye(4)[None], np.zeros(6))


def test_is_quick():
    pose = ARM.forward_kinematics(HOME + 0.2)
    # 2.5 ms on a quiet core, 50 times forward kinematics.
    plain = times_as_long(
        lambda: nearest_solution(pose, HOME), lambda: ARM.forward_kinematics(HOME), turns=10
    )
    assert plain < 110
