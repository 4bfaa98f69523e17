from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruckig import InputParameter, Ruckig, Trajectory

from punnet.errors import ConfigurationError, KinematicsError, ShapeError
from punnet.movement import JointLimits, retime
from punnet.movement.retiming import _one_axis, _states

LIMITS = JointLimits(
    lower=np.array([-2.9, -1.7, -2.9]),
    upper=np.array([2.9, 1.7, -0.1]),
    velocity=np.array([2.2, 2.2, 2.6]),
    acceleration=np.array([15.0, 7.5, 20.0]),
    jerk=np.array([7500.0, 3750.0, 10000.0]),
    joint_names=("a", "b", "c"),
)


def assert_within_limits(trajectory, limits=LIMITS):
    """Finite differences of the interpolated positions, 40 to a sample: not by the Hermite derivatives."""
    count = 40 * (len(trajectory) - 1)
    t = np.linspace(0.0, trajectory.duration, count + 1)
    step = t[1]
    positions = trajectory.sample(t)
    assert (positions >= limits.lower - 1e-6).all()
    assert (positions <= limits.upper + 1e-6).all()
    velocity = np.diff(positions, axis=0) / step
    acceleration = np.diff(velocity, axis=0) / step
    jerk = np.diff(acceleration, axis=0) / step
    assert (np.abs(velocity) <= limits.velocity * (1 + 1e-6)).all()
    assert (np.abs(acceleration) <= limits.acceleration * (1 + 1e-3)).all()
    # Third differences of values around 1 over steps of 0.2 ms carry a rounding noise of about 1e-15/8e-12.
    assert (np.abs(jerk) <= limits.jerk * 1.02 + 2e-4 / step).all()
    for derivative in (trajectory.velocities, trajectory.accelerations):
        np.testing.assert_array_equal(derivative[[0, -1]], 0.0)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(2, 9),
    st.sampled_from([1.0, 0.5, 0.2]),
    st.sampled_from([0.01, 0.008]),
)
def test_any_path_holds_every_limit_and_keeps_its_ends(seed, count, speed, time_step):
    path = np.random.default_rng(seed).uniform(LIMITS.lower, LIMITS.upper, (count, 3))
    trajectory = retime(path, LIMITS, speed=speed, time_step=time_step)
    assert_within_limits(trajectory, LIMITS.slowed(speed))
    np.testing.assert_allclose(trajectory.start, path[0], atol=1e-12)
    np.testing.assert_allclose(trajectory.end, path[-1], atol=1e-12)
    np.testing.assert_allclose(np.diff(trajectory.times), time_step, atol=1e-12)
    assert trajectory.joint_names == LIMITS.joint_names


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_stays_within_tolerance_of_the_path(seed):
    path = np.random.default_rng(seed).uniform(LIMITS.lower, LIMITS.upper, (4, 3)) * 0.2 - [0, 0, 0.5]
    positions = retime(path, LIMITS, tolerance=0.01).positions
    share = np.linspace(0.0, 1.0, 4000)[:, None]
    line = np.concatenate([a + share * (b - a) for a, b in pairwise(path)])
    nearest = np.abs(positions[:, None] - line[None]).max(axis=2).min(axis=1)
    assert nearest.max() < 0.0105


@pytest.mark.parametrize("seed", range(5))
def test_straight_lines_are_nearly_as_quick_as_the_time_optimal_profile(seed):
    path = np.random.default_rng(seed).uniform(LIMITS.lower, LIMITS.upper, (2, 3))
    problem = InputParameter(3)
    problem.current_position, problem.target_position = path[0].tolist(), path[1].tolist()
    for name in ("velocity", "acceleration", "jerk"):
        setattr(problem, f"max_{name}", getattr(LIMITS, name).tolist())
    optimal = Trajectory(3)
    Ruckig(3).calculate(problem, optimal)
    duration = retime(path, LIMITS).duration
    assert optimal.duration - 0.011 <= duration <= 1.1 * optimal.duration + 0.07


def test_sampling_of_the_path_hardly_matters():
    ends = np.array([[0.0, 0.0, -1.0], [0.8, -0.5, -2.0]])
    share = np.linspace(0.0, 1.0, 150)[:, None] ** 2
    dense = ends[0] + share * (ends[1] - ends[0])
    repeated = np.repeat(dense, 3, axis=0)
    durations = [retime(path, LIMITS).duration for path in (ends, dense, repeated)]
    assert max(durations) - min(durations) < 0.021


def test_slower_takes_longer_in_proportion():
    path = np.array([[0.0, 0.0, -1.0], [0.8, -0.5, -2.0]])
    full, half = retime(path, LIMITS).duration, retime(path, LIMITS, speed=0.5).duration
    assert half == pytest.approx(2 * full, abs=0.03)


def test_a_path_that_goes_nowhere_is_rest():
    trajectory = retime(np.tile([0.1, 0.2, -0.3], (5, 1)), LIMITS, time_step=0.008)
    assert len(trajectory) == 2
    assert trajectory.duration == pytest.approx(0.008)
    assert (trajectory.velocities == 0).all()


def test_a_microscopic_path_is_no_problem():
    assert_within_limits(retime([[0.0, 0.0, -1.0], [1e-7, 0.0, -1.0]], LIMITS))


def test_there_and_back_stops_in_between():
    trajectory = retime([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, -1.0]], LIMITS)
    assert_within_limits(trajectory)
    assert trajectory.positions[:, 0].max() > 0.99


@pytest.mark.parametrize(
    ("path", "error", "words"),
    [
        ([[0.0, 0.0, -1.0], [np.nan, 0.0, -1.0]], ShapeError, "point 1 is not finite"),
        ([[0.0, 0.0, -1.0]], ShapeError, "N ≥ 2"),
        ([[0.0, 0.0], [1.0, 0.0]], ShapeError, "got"),
        ([[0.0, 0.0, -1.0], [0.0, 1.8, -1.0]], KinematicsError, "point 1 has joint 2 at 1.8000 rad"),
    ],
)
def test_bad_paths_are_refused_by_name(path, error, words):
    with pytest.raises(error, match=words):
        retime(path, LIMITS)


@pytest.mark.parametrize(
    "settings_", [{"speed": 0.0}, {"speed": 1.5}, {"time_step": 0.0}, {"tolerance": 0.0}]
)
def test_bad_settings_are_refused(settings_):
    with pytest.raises(ConfigurationError):
        retime([[0.0, 0.0, -1.0], [0.1, 0.0, -1.0]], LIMITS, **settings_)


def test_limits_are_validated():
    good = {name: getattr(LIMITS, name) for name in ("lower", "upper", "velocity", "acceleration", "jerk")}
    with pytest.raises(ShapeError, match="velocity"):
        JointLimits(**{**good, "velocity": np.array([1.0, 0.0, 1.0])})
    with pytest.raises(ShapeError, match="jerk"):
        JointLimits(**{**good, "jerk": np.ones(2)})
    with pytest.raises(ShapeError, match="below upper"):
        JointLimits(**{**good, "upper": good["lower"]})
    with pytest.raises(ShapeError, match="names"):
        JointLimits(**good, joint_names=("a",))


def test_a_movement_that_dawdles_before_it_turns_is_not_all_slow():
    """A step aside by 20 mrad at a snail's pace, then the reach: as demonstrations by hand begin."""
    phase = np.linspace(0.0, 1.0, 150)
    reach = np.where(phase < 0.2, 0.0, (phase - 0.2) / 0.8)
    smooth = np.outer(reach**3 * (10.0 - 15.0 * reach + 6.0 * reach**2), [0.3, 1.4, -1.5])
    aside = np.outer(0.02 * np.exp(-np.square((phase - 0.12) / 0.05)), [-1.0, 0.6, 0.0])
    path = np.array([0.0, -0.5, -0.8]) + smooth + aside
    dawdling, straight = retime(path, LIMITS, speed=0.5), retime(path[[0, -1]], LIMITS, speed=0.5)
    assert_within_limits(dawdling, LIMITS.slowed(0.5))
    assert dawdling.duration < 2.0 * straight.duration


@pytest.mark.parametrize("length", [0.01, 1.3, 5.0])
def test_a_profile_is_sampled_as_its_own_author_does(length):
    profile = _one_axis(length, 0.8, 1.1, 5.0)
    clock = np.linspace(0.0, profile.duration, 200)
    theirs = np.array([[values[0] for values in profile.at_time(time)] for time in clock])
    np.testing.assert_allclose(np.stack(_states(profile, clock), axis=1), theirs, atol=1e-12)
