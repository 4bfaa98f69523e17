from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data.demos import DemonstrationSet, Episode, Trajectory, WeightDistribution, check_demonstrations
from punnet.data.demos.checks import check_episode, find_jumps
from punnet.movement import JointLimits
from punnet.robot import PANDA_LIMITS, Panda

MakeReach = Callable[..., Episode]
LIMITS = JointLimits(
    lower=np.full(3, -1.0), upper=np.full(3, 1.0), velocity=np.full(3, 1.0), acceleration=np.full(3, 9.0), jerk=np.full(3, 99.0)
)  # fmt: skip


def codes(episode: Episode) -> list[str]:
    return [code for code, _ in check_episode(episode, LIMITS)]


def with_joints(values: np.ndarray, seconds: float = 2.0) -> Episode:
    return Episode(id="a", joints=Trajectory(np.linspace(0.0, seconds, len(values)), values))


def test_a_sound_episode_has_no_fault(wall: DemonstrationSet) -> None:
    assert check_demonstrations(wall, limits=LIMITS) == ()


@settings(deadline=None, max_examples=40)
@given(st.integers(20, 400), st.integers(1, 98), st.floats(0.3, 2.0), st.booleans())
def test_a_jump_is_found_where_it_is(samples: int, percent: int, size: float, back: bool) -> None:
    phase = np.linspace(0.0, 1.0, samples)[:, None]
    values = np.array([0.8, -0.5, 0.3]) * (3 * phase**2 - 2 * phase**3)
    at = max(1, min(samples - 2, samples * percent // 100))
    sound = Trajectory(phase[:, 0], values.copy())
    assert not len(find_jumps(sound))
    if back:
        values[at, 1] += size  # one sample astray: there and back
    else:
        values[at:, 1] += size
    assert find_jumps(Trajectory(phase[:, 0], values)).tolist() == ([at, at + 1] if back else [at])


def test_a_quick_movement_after_a_long_wait_is_no_jump() -> None:
    wait = np.zeros((5000, 1))
    move = np.linspace(0.0, 0.4, 40)[:, None]
    values = np.concatenate((wait, move, wait + 0.4))
    assert not len(find_jumps(Trajectory(np.arange(len(values)) * 0.01, values)))


def test_real_recordings_jump_only_where_they_were_cut(shared_data: Path) -> None:
    """Five logs, 28,767 samples at 20 Hz; two of them leap from rest at one sample, where skills were joined."""
    with np.load(shared_data / "panda_logs" / "platonics_panda.npz") as data:
        joints = [data[f"trial{number}"][:, -7:].astype(float) for number in range(1, 6)]
    found = [find_jumps(Trajectory(np.arange(len(q)) / 20.0, q)).tolist() for q in joints]
    assert found == [[3825], [], [3985], [], []]


def test_limits_gaps_and_rest() -> None:
    phase = np.linspace(0.0, 1.0, 50)[:, None]
    far = phase * np.array([0.2, 1.3, -0.1])
    found = dict(check_episode(with_joints(far), LIMITS))
    assert set(found) == {"joint-limit"}
    assert "q2 reaches 1.3000 rad, 0.3000 too far" in found["joint-limit"]
    fast = dict(check_episode(with_joints(phase * 0.9 * np.ones(3), seconds=0.5), LIMITS))
    assert "1.80 times its limit" in fast["velocity-limit"]
    assert codes(with_joints(np.zeros((9, 3)))) == ["no-motion"]
    times = np.concatenate((np.arange(20) * 0.05, np.arange(20) * 0.05 + 3.0))
    gap = Episode(id="a", joints=Trajectory(times, np.linspace(0, 0.4, 40)[:, None] * np.ones(3)))
    assert "1 gaps" in dict(check_episode(gap, None))["time-gap"]
    # an arm with another number of joints is not held against these limits
    assert not list(check_episode(with_joints(phase * np.array([0.2, 1.3])), LIMITS))


def test_weights_and_photographs(wall: DemonstrationSet, rng: np.random.Generator) -> None:
    covariance = np.tile(np.eye(8), (7, 1, 1))
    covariance[2] = -np.eye(8)
    mean = rng.normal(size=(7, 8))
    weights = WeightDistribution(mean, covariance, 0.07)
    episode = Episode(id="a", joints=weights.mean_trajectory(), joint_weights=weights)
    found = [message for code, message in check_episode(episode) if code == "not-psd"]
    assert len(found) == 1
    assert "q3's weights" in found[0]
    task = mean.copy()
    task[3:] = 0.0
    task[6] = np.linspace(1.0, -0.9, 8)  # averaged over both signs
    flipped = WeightDistribution(task, np.tile(np.eye(8), (7, 1, 1)), 0.07, "task")
    told = dict(check_episode(Episode(id="a", poses=flipped.mean_trajectory(90), task_weights=flipped)))
    assert "quaternion-norm" in told
    assert wall[0].home is not None
    broken = replace(wall[0], photographs=(replace(wall[0].home, size=(9, 9)),), target=None)
    assert "unreadable-image" in dict(check_episode(broken))


def test_duplicates_are_named(wall: DemonstrationSet) -> None:
    twice = DemonstrationSet((*wall, replace(wall[4], id="again")))
    faults = check_demonstrations(twice)
    assert [(fault.code, fault.episode) for fault in faults] == [("duplicate", "again")]
    assert f"'{wall[4].id}'" in faults[0].message


def test_joints_and_poses_that_are_of_different_movements(rng: np.random.Generator) -> None:
    arm = Panda()
    episodes = []
    for number in range(5):
        joints = arm.home + np.linspace(0, 1, 40)[:, None] * rng.normal(0.0, 0.2, 7)
        T = arm.forward_kinematics_tool(joints)  # a point of the tool, not the flange: constant, so sound
        poses = np.concatenate((T[:, :3, 3], np.tile([0.0, 0.0, 0.0, 1.0], (40, 1))), axis=1)
        times = np.arange(40) * 0.05
        episodes.append(
            Episode(
                id=str(number),
                joints=Trajectory(times, joints),
                poses=Trajectory(times, poses, space="task"),
            )
        )
    sound = DemonstrationSet(tuple(episodes))
    kinematics = {"limits": PANDA_LIMITS, "forward_kinematics": arm.forward_kinematics}
    assert check_demonstrations(sound, **kinematics) == ()  # type: ignore[arg-type]
    stale = DemonstrationSet((*episodes[:4], replace(episodes[4], joints=episodes[0].joints)))
    faults = check_demonstrations(stale, **kinematics)  # type: ignore[arg-type]
    assert ("pose-mismatch", "4") in [(fault.code, fault.episode) for fault in faults]
    assert "0" not in [fault.episode for fault in faults]


def test_a_hundred_thousand_samples() -> None:
    times = np.arange(100_000) * 0.001
    values = np.sin(times[:, None] * np.array([0.2, 0.3, 0.1]))
    long = Episode(id="long", joints=Trajectory(times, values))
    assert codes(long) == []
    assert long.joints is not None
    assert long.joints.resampled(150).shape == (150, 3)


@pytest.mark.parametrize("samples", [2, 3])
def test_the_shortest_movements(samples: int) -> None:
    assert codes(with_joints(np.linspace(0, 0.5, samples)[:, None] * np.ones(3))) == []
