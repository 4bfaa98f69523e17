from __future__ import annotations

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from punnet.data.demos import (
    DemonstrationSet,
    Episode,
    Photograph,
    PictureFile,
    WeightDistribution,
    read_demos,
    read_readable_demos,
    write_lerobot,
)
from punnet.errors import ConfigurationError, FileFormatError, ShapeError

LEROBOT = os.environ.get("PUNNET_LEROBOT_PYTHON", "")


def smooth_photographs(demonstrations: DemonstrationSet, folder: Path) -> DemonstrationSet:
    """A plain picture of its own for each episode: video coding leaves those nearly as they are."""
    episodes = []
    for number, episode in enumerate(demonstrations):
        path = folder / f"plain{number}.png"
        cv2.imwrite(str(path), np.full((48, 64, 3), 30 + 40 * number, np.uint8))
        episodes.append(replace(episode, photographs=(Photograph(PictureFile(path), (48, 64)),)))
    return DemonstrationSet(tuple(episodes))


def test_round_trip(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    given = smooth_photographs(small_wall, tmp_path)
    losses = write_lerobot(given, tmp_path / "out", fps=30)
    assert "double precision" in losses
    again = read_demos(tmp_path / "out")
    for number, (before, after) in enumerate(zip(given, again, strict=True)):
        assert (after.id, after.target_id, after.group) == (before.id, before.target_id, before.group)
        assert before.joints is not None
        assert after.joints is not None
        # 61 samples in 2 s are whole frames at 30 Hz: only single precision is lost
        np.testing.assert_allclose(after.joints.values, before.joints.values, atol=1e-6)
        np.testing.assert_allclose(after.joints.times, before.joints.times, atol=1e-6)
        assert after.joints.names == before.joints.names
        assert before.poses is not None
        assert after.poses is not None
        np.testing.assert_allclose(after.poses.values, before.poses.values, atol=1e-6)
        assert before.target is not None
        assert after.target is not None
        np.testing.assert_allclose(after.target.box, before.target.box, atol=1e-4)
        assert after.home is not None
        assert np.abs(after.home.rgb().astype(int) - (30 + 40 * number)).max() <= 4


def test_what_stands_in_the_tables(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    write_lerobot(small_wall, tmp_path / "out", fps=10)
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["total_frames"] == 4 * 21
    table = parquet.read_table(tmp_path / "out" / "data" / "chunk-000" / "file-000.parquet")
    assert set(info["features"]) == {*table.column_names, "observation.images.home"}
    data = table.to_pydict()
    assert data["index"] == list(range(84))
    assert data["frame_index"][:22] == [*range(21), 0]
    np.testing.assert_allclose(data["timestamp"][:21], np.arange(21) / 10, atol=1e-6)
    state, action = np.array(data["observation.state"][:21]), np.array(data["action"][:21])
    np.testing.assert_array_equal(action[:-1], state[1:])
    np.testing.assert_array_equal(action[-1], state[-1])
    stats = json.loads((tmp_path / "out" / "meta" / "stats.json").read_text())
    every = np.array(data["observation.state"])
    np.testing.assert_allclose(stats["observation.state"]["mean"], every.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(stats["observation.state"]["std"], every.std(axis=0), atol=1e-6)
    np.testing.assert_allclose(stats["observation.state"]["max"], every.max(axis=0), atol=1e-6)
    assert np.shape(stats["observation.images.home"]["mean"]) == (3, 1, 1)
    rows = parquet.read_table(
        tmp_path / "out" / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    ).to_pylist()
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in rows] == [
        (0, 21), (21, 42), (42, 63), (63, 84)
    ]  # fmt: skip


def test_an_episode_without_a_duration_needs_one(tmp_path: Path, rng: np.random.Generator) -> None:
    weights = WeightDistribution(rng.normal(size=(7, 8)), np.zeros((7, 8, 8)), 0.07)
    one = DemonstrationSet((Episode(id="a", joints=weights.mean_trajectory(), joint_weights=weights),))
    with pytest.raises(ConfigurationError, match="--seconds"):
        write_lerobot(one, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    losses = write_lerobot(one, tmp_path / "out", seconds=4.0, fps=25)
    assert any("covariances" in loss for loss in losses)
    (again,) = read_demos(tmp_path / "out")
    assert again.movement.duration == pytest.approx(4.0)
    assert again.home is None
    assert again.target is None
    np.testing.assert_allclose(again.movement.end, one[0].movement.end, rtol=1e-5)


def test_odd_pictures_and_several_of_them(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    paths = []
    for level in (40, 200):
        paths.append(tmp_path / f"{level}.png")
        cv2.imwrite(str(paths[-1]), np.full((33, 47, 3), level, np.uint8))
    pictures = tuple(
        Photograph(PictureFile(path), (33, 47), time=t) for path, t in zip(paths, (0.0, 1.0), strict=True)
    )
    one = DemonstrationSet((replace(small_wall[0], photographs=pictures, target=None),))
    write_lerobot(one, tmp_path / "out", fps=10)
    (again,) = read_demos(tmp_path / "out")
    assert again.home is not None
    assert again.home.size == (34, 48)
    assert abs(int(again.home.rgb()[5, 5, 0]) - 40) <= 4
    from punnet.data.demos.pictures import VideoPicture

    assert isinstance(again.home.picture, VideoPicture)
    later = [replace(again.home.picture, time=time).read()[5, 5, 0] for time in (0.85, 0.95, 1.9)]
    assert [abs(int(level) - wanted) <= 4 for level, wanted in zip(later, (40, 200, 200), strict=True)] == [
        True
    ] * 3


def test_sets_that_do_not_fit(wall: DemonstrationSet, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="fps"):
        write_lerobot(wall, tmp_path / "out", fps=0)
    with pytest.raises(ConfigurationError, match="no episode"):
        write_lerobot(DemonstrationSet(()), tmp_path / "out")
    with pytest.raises(ShapeError, match="35 of 36 episodes have a photograph"):
        write_lerobot(
            DemonstrationSet((replace(wall[0], photographs=()), *wall.episodes[1:])), tmp_path / "out"
        )
    with pytest.raises(ShapeError, match="no joints"):
        write_lerobot(DemonstrationSet((replace(wall[0], joints=None),)), tmp_path / "out")
    with pytest.raises(ShapeError, match="have poses"):
        write_lerobot(DemonstrationSet((replace(wall[0], poses=None), wall[1])), tmp_path / "out")


def image_dataset(folder: Path, **changes: Any) -> Path:
    """A dataset by another hand: pictures inside the table, no file of ours."""
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    content = cv2.imencode(".png", np.full((6, 8, 3), 77, np.uint8))[1].tobytes()
    info = {
        "codebase_version": "v3.0",
        "fps": 20,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {
            "observation.state": {"dtype": "float32", "shape": [2], "names": {"motors": ["a", "b"]}},
            "observation.images.wrist": {"dtype": "image", "shape": [6, 8, 3]},
        },
    } | changes
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    rows = [
        {
            "observation.state": [0.1 * frame, 0.2 * episode],
            "observation.images.wrist": {"bytes": content, "path": None},
            "timestamp": frame / 20,
            "episode_index": episode,
        }
        for episode in range(2)
        for frame in range(10)
    ]
    parquet.write_table(pa.Table.from_pylist(rows), folder / "data" / "chunk-000" / "file-000.parquet")
    table = [
        {"episode_index": k, "data/chunk_index": 0, "data/file_index": 0, "tasks": ["pick"]} for k in range(2)
    ]
    parquet.write_table(
        pa.Table.from_pylist(table), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    )
    return folder


def test_datasets_by_other_hands(tmp_path: Path) -> None:
    first, second = read_demos(image_dataset(tmp_path))
    assert first.id == "0"
    assert first.movement.names == ("a", "b")
    np.testing.assert_allclose(second.movement.values[:, 1], 0.2)
    assert first.extra == {"tasks": ["pick"]}
    assert first.home is not None
    assert (first.home.rgb() == 77).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"codebase_version": "v2.1"}, "v3.0 is read"),
        ({"features": {"action": {}}}, "observation.state"),
        ({"features": 3}, "features"),
    ],
)
def test_datasets_that_are_not_read(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(FileFormatError, match=words):
        read_demos(image_dataset(tmp_path, **changes))


@pytest.mark.parametrize("feature", [None, 3, [], {}])
def test_a_feature_that_tells_nothing_leaves_its_numbers_without_names(tmp_path: Path, feature: Any) -> None:
    folder = image_dataset(tmp_path)
    info = json.loads((folder / "meta" / "info.json").read_text())
    info["features"]["observation.state"] = feature
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    assert len(read_demos(folder).episodes) == 2


def test_damaged_datasets(tmp_path: Path) -> None:
    outside = read_readable_demos(image_dataset(tmp_path / "a", data_path="../{chunk_index}.parquet"))
    assert "leaves the dataset" in outside.left_out[0].message
    nowhere = read_readable_demos(image_dataset(tmp_path / "b", data_path="{planet}"))
    assert [fault.code for fault in nowhere.left_out] == ["missing-field"] * 2
    folder = image_dataset(tmp_path / "c")
    (folder / "data" / "chunk-000" / "file-000.parquet").write_bytes(b"PAR1 no table")
    assert [fault.code for fault in read_readable_demos(folder).left_out] == ["unreadable"] * 2


def lerobot_says(program: str, *arguments: object) -> str:
    """What the program prints, run by the Python that has lerobot."""
    run = [LEROBOT, "-W", "ignore", "-c", program, *map(str, arguments)]
    done = subprocess.run(
        run, capture_output=True, text=True, check=False, env={**os.environ, "HF_HUB_OFFLINE": "1"}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(not LEROBOT, reason="PUNNET_LEROBOT_PYTHON names no Python that has lerobot installed")
def test_lerobot_itself_loads_what_is_written(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    write_lerobot(smooth_photographs(small_wall, tmp_path), tmp_path / "out", fps=30)
    program = """
import sys, json, torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("punnet/test", root=sys.argv[1], video_backend="pyav")
batch = next(iter(torch.utils.data.DataLoader(data, batch_size=4)))
levels = [round(float(data[61 * k + 30]["observation.images.home"].mean()) * 255) for k in range(4)]
print(json.dumps([len(data), data.num_episodes, list(batch["action"].shape), data[0]["task"], levels]))
"""
    frames, episodes, shape, task, levels = json.loads(
        lerobot_says(program, tmp_path / "out").splitlines()[-1]
    )
    assert (frames, episodes, shape) == (4 * 61, 4, [4, 3])
    assert "strawberry" in task
    assert np.abs(np.array(levels) - [30, 70, 110, 150]).max() <= 4


@pytest.mark.skipif(not LEROBOT, reason="PUNNET_LEROBOT_PYTHON names no Python that has lerobot installed")
@pytest.mark.parametrize("kind", ["image", "video"])
def test_what_lerobot_writes_is_read(tmp_path: Path, kind: str) -> None:
    program = """
import sys, numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset
names = ["a", "b", "c"]
features = {
    "observation.state": {"dtype": "float32", "shape": (3,), "names": names},
    "action": {"dtype": "float32", "shape": (3,), "names": names},
    "observation.images.wrist": {"dtype": sys.argv[2], "shape": (96, 128, 3), "names": ["height", "width", "channels"]},
}
data = LeRobotDataset.create("punnet/test", fps=20, features=features, root=sys.argv[1], use_videos=sys.argv[2] == "video")
for episode in range(2):
    for frame in range(12):
        state = np.array([0.1 * frame, episode, 1.0], dtype=np.float32)
        picture = np.full((96, 128, 3), 60 + 100 * episode, dtype=np.uint8)
        data.add_frame({"observation.state": state, "action": state, "observation.images.wrist": picture, "task": "pick"})
    data.save_episode()
data.finalize()
"""
    lerobot_says(program, tmp_path / "out", kind)
    demonstrations = read_demos(tmp_path / "out")
    assert len(demonstrations) == 2
    for number, episode in enumerate(demonstrations):
        np.testing.assert_allclose(episode.movement.values[:, 0], np.arange(12) * 0.1, atol=1e-6)
        np.testing.assert_allclose(episode.movement.values[:, 1], number)
        assert episode.home is not None
        assert np.abs(episode.home.rgb().astype(int) - (60 + 100 * number)).max() <= 4
