import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import FileFormatError, ShapeError
from punnet.movement import JointTrajectory


def sine(count=40, joints=3):
    """Samples of sin with its true derivatives."""
    times = np.linspace(0.0, 2.0, count)
    phase = times[:, None] + np.arange(joints)
    return JointTrajectory(times, np.sin(phase), np.cos(phase), -np.sin(phase))


@pytest.mark.parametrize(
    ("times", "positions", "words"),
    [
        ([0.0], [[1.0]], "T ≥ 2"),
        ([0.0, 0.0], [[1.0], [2.0]], "strictly increasing"),
        ([0.0, np.nan], [[1.0], [2.0]], "finite"),
        ([-1.0, 0.0], [[1.0], [2.0]], "not negative"),
        ([0.0, 1.0], [[1.0], [np.inf]], "positions"),
        ([0.0, 1.0], [[1.0], [2.0], [3.0]], r"\(2, J\)"),
    ],
)
def test_bad_arrays_are_named(times, positions, words):
    with pytest.raises(ShapeError, match=words):
        JointTrajectory(np.array(times), np.array(positions))


def test_accelerations_need_velocities_and_names_must_fit():
    times, positions = np.array([0.0, 1.0]), np.zeros((2, 2))
    with pytest.raises(ShapeError, match="without velocities"):
        JointTrajectory(times, positions, None, positions)
    with pytest.raises(ShapeError, match="joint names"):
        JointTrajectory(times, positions, joint_names=("a", "a"))


def test_arrays_are_copied_and_read_only():
    times, positions = np.array([0.0, 1.0]), np.zeros((2, 2))
    trajectory = JointTrajectory(times, positions)
    positions[0, 0] = 5.0
    assert trajectory.positions[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.positions[0, 0] = 1.0


@pytest.mark.parametrize(("keep", "error"), [(1, 4e-4), (2, 2e-7), (3, 3e-10)])
def test_interpolation_order_follows_what_is_known(keep, error):
    full = sine()
    known = (full.positions, full.velocities, full.accelerations)[:keep]
    t = np.linspace(0.0, 2.0, 997)
    wanted = np.sin(t[:, None] + np.arange(3))
    assert np.abs(JointTrajectory(full.times, *known).sample(t) - wanted).max() < error


def test_sample_passes_through_points_and_stands_still_outside():
    trajectory = sine()
    np.testing.assert_allclose(trajectory.sample(trajectory.times), trajectory.positions, atol=1e-14)
    np.testing.assert_array_equal(trajectory.sample(-3.0), trajectory.start)
    np.testing.assert_allclose(trajectory.sample(99.0), trajectory.end, atol=1e-14)
    assert (trajectory.sample([-1.0, 9.0], derivative=1) == 0).all()
    assert trajectory.sample(np.zeros((2, 5))).shape == (2, 5, 3)
    np.testing.assert_allclose(trajectory.sample(0.7, derivative=1), np.cos(0.7 + np.arange(3)), atol=1e-7)


def test_resample_keeps_ends_and_shape():
    trajectory = sine()
    finer = trajectory.resample(0.03)
    assert finer.times[0] == 0.0
    assert finer.times[-1] == trajectory.times[-1]
    assert np.diff(finer.times).max() < 0.03 + 1e-12
    np.testing.assert_allclose(finer.sample(1.234), trajectory.sample(1.234), atol=1e-9)
    with pytest.raises(ShapeError, match="time_step"):
        trajectory.resample(0.0)


def test_concatenate_joins_and_refuses_gaps():
    whole = sine(41)
    first = JointTrajectory(whole.times[:21], whole.positions[:21], whole.velocities[:21])
    second = JointTrajectory(whole.times[20:] + 7.0, whole.positions[20:], whole.velocities[20:])
    joined = JointTrajectory.concatenate([first, second])
    np.testing.assert_allclose(joined.times, whole.times, atol=1e-12)
    np.testing.assert_array_equal(joined.positions, whole.positions)
    assert joined.accelerations is None
    with pytest.raises(ShapeError, match="part 1 starts"):
        JointTrajectory.concatenate([second, first])
    with pytest.raises(ShapeError, match="nothing"):
        JointTrajectory.concatenate([])
    other = JointTrajectory(first.times, first.positions, joint_names=("x", "y", "z"))
    with pytest.raises(ShapeError, match="other joints"):
        JointTrajectory.concatenate([first, other])


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(1e-3, 10.0), min_size=1, max_size=8),
    st.integers(1, 3),
    st.integers(1, 7),
)
def test_json_round_trip(steps, known, joints):
    times = np.concatenate(([0.0], np.cumsum(steps)))
    values = [np.sin(np.arange(times.size * joints) + k).reshape(times.size, joints) for k in range(known)]
    trajectory = JointTrajectory(times, *values)
    again = JointTrajectory.from_json(json.loads(json.dumps(trajectory.to_json())))
    np.testing.assert_allclose(again.times, times, atol=1e-9)
    for name in ("positions", "velocities", "accelerations"):
        before, after = getattr(trajectory, name), getattr(again, name)
        assert (before is None) == (after is None)
        if before is not None:
            np.testing.assert_array_equal(before, after)
    assert again.joint_names == trajectory.joint_names


def test_json_reads_ros_1_and_refuses_rubbish():
    points = [
        {"positions": [0.0], "velocities": [], "time_from_start": {"secs": 0, "nsecs": 0}},
        {"positions": [1.0], "velocities": [], "time_from_start": {"secs": 1, "nsecs": 500_000_000}},
    ]
    trajectory = JointTrajectory.from_json({"joint_names": ["elbow"], "points": points})
    assert trajectory.duration == 1.5
    assert trajectory.joint_names == ("elbow",)
    for rubbish in ({}, {"points": [{"positions": [1]}]}, {"points": []}, [], {"points": points[:1]}, None):
        with pytest.raises(FileFormatError, match=r"plan\.json"):
            JointTrajectory.from_json(rubbish, where="plan.json")
