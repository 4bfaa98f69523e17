from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.data.demos import DemonstrationSet, Episode, Photograph, PictureFile, mark_target, target_picture
from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.scene import Target

MakeReach = Callable[..., Episode]


def test_targets_groups_and_subsets(wall: DemonstrationSet) -> None:
    assert len(wall) == 36
    assert len(wall.targets) == 18
    assert wall.targets["1-2"] == [16, 17]
    assert {name: len(indices) for name, indices in wall.groups.items()} == dict.fromkeys(
        ("plant-0", "plant-1", "plant-2"), 12
    )
    assert [episode.id for episode in wall.subset([3, 1])] == ["0-1-1", "0-0-1"]
    with pytest.raises(ConfigurationError, match="no episode 36"):
        wall.subset([36])
    joints, poses = wall.resampled(20)
    assert joints.shape == (36, 20, 3)
    assert poses.shape == (36, 20, 7)
    np.testing.assert_allclose(joints[5, -1], wall[5].joints.end)  # type: ignore[union-attr]


def test_a_photograph_becomes_a_frame(wall: DemonstrationSet) -> None:
    photograph = wall[0].home
    assert photograph is not None
    frame = photograph.frame("first")
    assert frame.depth is not None
    assert 0.3 <= frame.depth.min() <= frame.depth.max() < 0.9
    assert frame.camera == photograph.camera
    assert frame.name == "first"
    with pytest.raises(ShapeError, match="stated is"):
        replace(photograph, size=(10, 10)).rgb()
    with pytest.raises(FileFormatError, match=r"gone\.png"):
        replace(photograph, depth_path=Path("gone.png")).frame()


def test_an_episode_needs_a_movement_in_the_right_space(make_reach: MakeReach) -> None:
    episode = make_reach("a", np.array([0.5, 0.1, 0.7]))
    assert episode.target_id == "a"
    with pytest.raises(ShapeError, match="neither joints nor poses"):
        Episode(id="a")
    with pytest.raises(ShapeError, match="other one"):
        Episode(id="a", joints=episode.poses)


@pytest.mark.parametrize("box", [[70, 5, 90, 9], [5, 5, 5, 9], [-9, -9, -1, -1]])
def test_a_target_outside_its_photograph_is_refused(wall: DemonstrationSet, box: list[float]) -> None:
    with pytest.raises(ShapeError, match="empty or outside"):
        replace(wall[0], target=Target(box=np.array(box, dtype=float)))


def test_sets_are_of_one_arm_and_ids_unique(make_reach: MakeReach) -> None:
    first, second = (make_reach(name, np.array([0.5, 0.1, 0.7])) for name in "ab")
    with pytest.raises(ShapeError, match="given twice"):
        DemonstrationSet((first, first))
    assert second.joints is not None
    other = replace(second, joints=replace(second.joints, names=("x", "y", "z")))
    with pytest.raises(ShapeError, match="other joints"):
        DemonstrationSet((first, other))
    with pytest.raises(ConfigurationError, match="'b' has no poses"):
        DemonstrationSet((first, replace(second, poses=None))).resampled()


def test_the_target_is_marked_white() -> None:
    rgb = np.full((48, 64, 3), 90, dtype=np.uint8)
    marked = mark_target(rgb, [10.2, 5.0, 20.4, 70.0])
    assert (marked[5:, 10:20] == 255).all()
    assert (marked[:5] == 90).all()
    assert (marked[:, 20:] == 90).all()
    assert (rgb == 90).all()
    small = target_picture(rgb, [0, 0, 32, 48])
    assert small.shape == (128, 128, 3)
    assert (small[:, :63] == 255).all()
    assert (target_picture(rgb, None, 16) == 90).all()
    with pytest.raises(ShapeError, match="outside"):
        mark_target(rgb, [64, 0, 80, 20])


def test_pictures_that_can_not_be_had(tmp_path: Path) -> None:
    from punnet.data.demos.pictures import EncodedPicture, VideoPicture, read_depth

    for source in (
        PictureFile(tmp_path / "none.png"),
        EncodedPicture(b"\x89PNG", "row 3"),
        EncodedPicture(b"", "row 3"),
        VideoPicture(tmp_path / "none.mp4", 0.0, (4, 4)),
    ):
        with pytest.raises(FileFormatError, match=r"none|row 3"):
            source.read()
    (tmp_path / "bad.mp4").write_bytes(b"no video")
    with pytest.raises(FileFormatError, match="can't be decoded"):
        VideoPicture(tmp_path / "bad.mp4", 0.0, (4, 4)).read()
    cv2.imwrite(str(tmp_path / "grey.png"), np.zeros((4, 4), np.uint8))
    with pytest.raises(FileFormatError, match="16-bit"):
        read_depth(tmp_path / "grey.png", 0.001)
    with pytest.raises(ShapeError, match="depth_scale"):
        Photograph(PictureFile(tmp_path / "grey.png"), depth_scale=0.0)


def test_what_a_network_sees_is_the_mean_over_each_cell() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (90, 160, 3), dtype=np.uint8)
    marked = mark_target(rgb, [30.0, 20.0, 61.0, 47.0]).astype(float)
    cells = np.repeat(np.eye(16), 45, axis=1).reshape(16, 90, 8).sum(axis=2) / 45  # 5.625 rows each
    expected = np.einsum("ah,hwc,bw->abc", cells, marked, np.repeat(np.eye(16), 10, axis=1) / 10)
    seen = target_picture(rgb, [30.0, 20.0, 61.0, 47.0], 16)
    assert np.abs(seen - expected).max() <= 0.5 + 1e-4
