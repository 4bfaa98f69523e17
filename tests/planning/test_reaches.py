"""Reaches of demonstrations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.data.demos import DemonstrationSet, Episode, Photograph, Trajectory, read_demos
from punnet.data.demos.pictures import RawPicture
from punnet.errors import ConfigurationError, ShapeError
from punnet.planning.reaches import as_distribution, reaches_from
from punnet.scene import Target


def episode(number: int, target: str, sign: float = 1.0) -> Episode:
    """A reach along a curve; quaternions of either sign."""
    z = np.linspace(0.0, 1.0, 60)
    joints = np.outer(z, np.arange(1.0, 8.0)) * 0.1 + 0.01 * number
    turn = 0.4 * z
    quaternions = sign * np.column_stack((np.sin(turn / 2), 0 * z, 0 * z, np.cos(turn / 2)))
    poses = np.column_stack((0.3 + 0.4 * z, 0.01 * number + 0 * z, 0.6 - 0.1 * z, quaternions))
    rgb = np.full((96, 128, 3), 50, dtype=np.uint8)
    return Episode(
        id=str(number),
        joints=Trajectory(2.0 * z, joints),
        poses=Trajectory(2.0 * z, poses, space="task"),
        photographs=(Photograph(RawPicture(rgb, "made"), (96, 128)),),
        target=Target(np.array([32.0, 24.0, 64.0, 48.0]), picking_point=np.array([0.7, 0.0, 0.5])),
        target_id=target,
        group=f"plant {target}",
    )


DEMONSTRATIONS = DemonstrationSet((episode(0, "a"), episode(1, "a", -1.0), episode(2, "b")))


def test_repeats_share_a_target_and_quaternions_a_hemisphere() -> None:
    reaches = reaches_from(DEMONSTRATIONS)
    assert reaches.target_ids == ("a", "b")
    assert reaches.picture_groups == ("plant a", "plant a", "plant b")
    np.testing.assert_allclose(reaches.centres, np.tile((0.375, 0.375), (3, 1)))
    assert (reaches.pictures[0, 40:56, 40:56] == 255).all()
    ends = reaches.basis.phi([1.0]) @ reaches.pose.mean.transpose(0, 2, 1)
    np.testing.assert_allclose(ends[:, 0], [reaches.ends[:2].mean(axis=0), reaches.ends[2]], atol=2e-3)
    assert (reaches.ends @ reaches.ends[0] > 0).all()
    assert reaches.duration == pytest.approx(2.0)


def test_a_target_becomes_a_distribution_in_either_space() -> None:
    reaches = reaches_from(DEMONSTRATIONS)
    for space in ("joint", "task"):
        movements = reaches.movements(space)
        distribution = as_distribution(reaches.basis, movements.mean[0], movements.covariance[0], space)
        assert distribution.space == space
    last = distribution.chart.poses(distribution.mean([1.0]))[0]
    np.testing.assert_allclose(last[:3, 3], reaches.ends[:2, :3].mean(axis=0), atol=2e-3)


def test_subset_keeps_photographs_with_their_targets() -> None:
    second = reaches_from(DEMONSTRATIONS).of_groups(["plant b"])
    assert second.target_ids == ("b",)
    assert second.targets.tolist() == [0]
    assert len(second.joint) == 1


def test_what_is_missing_is_named() -> None:
    blind = DemonstrationSet((replace(episode(0, "a"), photographs=()),))
    with pytest.raises(ConfigurationError, match="episode '0' has no photograph"):
        reaches_from(blind)
    with pytest.raises(ConfigurationError, match="no demonstrations"):
        reaches_from(DemonstrationSet(()))
    with pytest.raises(ShapeError, match="boxes must be"):
        replace(reaches_from(DEMONSTRATIONS), boxes=np.zeros((2, 4)))


def test_the_shared_reaches(shared_data: Path) -> None:
    reaches = reaches_from(read_demos(shared_data / "reach"))
    assert (len(reaches), len(set(reaches.groups)), int(reaches.suspects.sum())) == (75, 4, 9)
    ends = (reaches.basis.phi([1.0]) @ reaches.pose.mean.transpose(0, 2, 1))[:, 0]
    np.testing.assert_allclose(ends[:, :3], reaches.ends[:, :3], atol=0.02)
