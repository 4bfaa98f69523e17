from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from punnet.data.demos import (
    DemonstrationSet,
    Episode,
    WeightDistribution,
    read_demos,
    read_readable_demos,
    write_punnet_folder,
)
from punnet.errors import FileFormatError, OutputExistsError, ShapeError


def test_round_trip_without_loss(wall: DemonstrationSet, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert write_punnet_folder(wall, out) == []
    again = read_demos(out)
    assert again.info == wall.info
    assert again.joint_names == wall.joint_names
    for before, after in zip(wall, again, strict=True):
        assert (after.id, after.target_id, after.group, after.extra) == (
            before.id,
            before.target_id,
            before.group,
            before.extra,
        )
        for name in ("joints", "poses"):
            np.testing.assert_array_equal(getattr(before, name).times, getattr(after, name).times)
            np.testing.assert_allclose(getattr(before, name).values, getattr(after, name).values, atol=1e-15)
        assert before.target is not None
        assert after.target is not None
        np.testing.assert_allclose(before.target.box, after.target.box, atol=1e-3)
        assert before.home is not None
        assert after.home is not None
        first, second = before.home.frame(), after.home.frame()
        np.testing.assert_array_equal(first.rgb, second.rgb)
        assert first.depth is not None
        assert second.depth is not None
        np.testing.assert_array_equal(first.depth, second.depth)
        assert first.camera == second.camera


def test_weights_phases_and_lengths(tmp_path: Path, rng: np.random.Generator) -> None:
    weights = WeightDistribution(rng.normal(size=(7, 8)), np.tile(-np.eye(8), (7, 1, 1)), 0.07)
    episodes = tuple(
        Episode(id=str(n), joints=weights.mean_trajectory(n), joint_weights=weights) for n in (2, 30, 7)
    )
    write_punnet_folder(DemonstrationSet(episodes), tmp_path / "out")
    again = read_demos(tmp_path / "out")
    assert [len(episode.movement) for episode in again] == [2, 30, 7]
    assert again[0].movement.clock == "phase"
    assert again[1].poses is None
    assert again[2].joint_weights is not None
    np.testing.assert_array_equal(again[2].joint_weights.covariance, weights.covariance)
    mixed = DemonstrationSet((episodes[0], replace(episodes[1], joint_weights=None)))
    with pytest.raises(ShapeError, match="1 of 2 episodes have joint weights"):
        write_punnet_folder(mixed, tmp_path / "mixed")
    assert not (tmp_path / "mixed").exists()


def test_same_set_same_bytes_and_nothing_is_overwritten(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_punnet_folder(small_wall, tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 3 + 2 * len(small_wall)
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    with pytest.raises(OutputExistsError, match="--force"):
        write_punnet_folder(small_wall, tmp_path / "a")
    write_punnet_folder(small_wall, tmp_path / "a", force=True)


def test_a_failure_half_way_leaves_nothing(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    assert small_wall[1].home is not None
    gone = replace(small_wall[1].home, depth_path=tmp_path / "gone.png")
    broken = DemonstrationSet((small_wall[0], replace(small_wall[1], photographs=(gone,))))
    with pytest.raises(Exception, match=r"gone\.png"):
        write_punnet_folder(broken, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("field", "value", "code"),
    [
        ("box", [1, 2, 3], "bad-box"),
        ("box", [1, 2, "a", 4], "missing-field"),
        ("photographs", [{"rgb": "rgb/none.png"}], "missing-image"),
        ("photographs", [3], "missing-field"),
        ("photographs", [{"rgb": 3}], "unreadable"),
        ("id", "0-0-1", "duplicate-id"),
    ],
)
def test_a_faulty_episode_is_left_out(
    small_wall: DemonstrationSet, tmp_path: Path, field: str, value: Any, code: str
) -> None:
    write_punnet_folder(small_wall, tmp_path / "out")
    file = tmp_path / "out" / "demonstrations.json"
    data = json.loads(file.read_text())
    data["episodes"][2][field] = value
    file.write_text(json.dumps(data))
    reading = read_readable_demos(tmp_path / "out")
    assert len(reading.episodes) == 3
    assert [fault.code for fault in reading.left_out] == [code]


def test_other_schemas_and_unfinished_folders(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    write_punnet_folder(small_wall, tmp_path / "out")
    file = tmp_path / "out" / "demonstrations.json"
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | {"complete": False}))
    with pytest.raises(FileFormatError, match="not complete"):
        read_demos(tmp_path / "out")
    file.write_text(json.dumps(data | {"schema": "other/1"}))
    with pytest.raises(FileFormatError, match="schema must be"):
        read_demos(tmp_path / "out")
    file.write_text(json.dumps(data))
    (tmp_path / "out" / "trajectories.npz").write_bytes(b"no zip")
    with pytest.raises(FileFormatError, match=r"trajectories\.npz"):
        read_demos(tmp_path / "out")
