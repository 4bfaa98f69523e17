"""Orientations that averaging spoilt."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.data.demos import Episode, WeightDistribution, read_demos
from punnet.geometry import quaternion_angle, quaternion_from_rotation
from punnet.planning.orientation_mending import SHORTEST, mended
from punnet.robot import HOME, Panda

PHASES = np.linspace(0.0, 1.0, 80)
WIDTH = 0.07


def episode(spoilt: float) -> Episode:
    """One whose quaternion weights are (1 − 2·spoilt) of what they should be, as of so many repeats of the other sign."""
    basis = WeightDistribution(np.zeros((7, 8)), np.zeros((7, 8, 8)), WIDTH).basis_values(PHASES)
    fit = np.linalg.pinv(basis)
    path = np.asarray(HOME) + np.outer(PHASES**2, [0.2, 0.1, 0.0, 0.2, 0.1, -0.1, 0.3])
    poses = Panda().forward_kinematics(path)
    quaternions = quaternion_from_rotation(poses[:, :3, :3])
    quaternions *= np.sign(quaternions @ quaternions[0])[:, None]
    quaternions[:, 0] += 0.2 * spoilt * PHASES
    values = np.column_stack((poses[:, :3, 3], (1.0 - 2.0 * spoilt) * quaternions))
    joint = WeightDistribution((fit @ path).T, np.stack([1e-4 * np.eye(8)] * 7), WIDTH)
    task = WeightDistribution((fit @ values).T, np.stack([np.eye(8)] * 7), WIDTH, "task")
    return Episode(
        id="a",
        joints=joint.mean_trajectory(),
        poses=task.mean_trajectory(),
        joint_weights=joint,
        task_weights=task,
    )


def test_takes_orientation_from_the_joints() -> None:
    spoilt = episode(0.4)
    found = mended(spoilt)
    assert found.poses is not None
    assert found.joints is not None
    true = quaternion_from_rotation(Panda().forward_kinematics(found.joints.end)[:3, :3])
    assert quaternion_angle(found.poses.end[3:], true) < 1e-3
    assert quaternion_angle(spoilt.poses.end[3:], true) > 0.05
    np.testing.assert_allclose(found.poses.end[:3], spoilt.poses.end[:3], atol=1e-3)
    assert found.task_weights.std([1.0])[0, 3:].max() < 0.1
    assert found.task_weights.is_psd.all()


def test_leaves_sound_ones_alone() -> None:
    sound = episode(0.0)
    assert mended(sound) is sound
    bare = replace(episode(0.4), task_weights=None)
    assert mended(bare) is bare


def test_the_shared_reaches(shared_data) -> None:
    off = {}
    for found in read_demos(shared_data / "reach"):
        new = mended(found)
        if new is not found:
            off[found.id] = float(quaternion_angle(found.poses.end[3:], new.poses.end[3:]))
            assert np.linalg.norm(new.task_weights.mean_values(PHASES)[:, 3:], axis=1).min() > SHORTEST
    assert sorted(off) == ["017", "018", "117", "119", "209", "219", "300", "319"]
    assert [name for name, angle in off.items() if angle > np.deg2rad(10.0)] == ["119", "219", "319"]
    assert off["119"] == pytest.approx(0.807, abs=0.02)
