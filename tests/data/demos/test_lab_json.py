from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data.demos import read_demos, read_readable_demos
from punnet.errors import FileFormatError

TIMES = [0.0, 0.1, 0.2, 0.3]
JOINTS = [[0.1 * k * j for j in range(7)] for k in range(4)]
POSES = [[0.3 + 0.1 * k, 0.0, 0.7, 0.0, 0.0, 0.1 * k, 1.0] for k in range(4)]


def write(path: Path, **fields: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"joint_position": JOINTS, "time": TIMES} | fields))
    return path


def test_one_file(tmp_path: Path) -> None:
    path = write(tmp_path / "007.json", pose=POSES, box=[1, 2, 30, 40], target="b2", configuration=4, rate=10)
    (episode,) = read_demos(path)
    assert (episode.id, episode.target_id, episode.group) == ("007", "b2", "4")
    assert episode.joints is not None
    np.testing.assert_allclose(episode.joints.values, JOINTS)
    assert episode.joints.duration == pytest.approx(0.3)
    assert episode.poses is not None
    np.testing.assert_allclose(np.linalg.norm(episode.poses.values[:, 3:], axis=1), 1.0)
    assert episode.target is not None
    assert episode.target.box.tolist() == [1, 2, 30, 40]
    assert episode.extra == {"rate": 10}


def test_the_labs_folders(tmp_path: Path) -> None:
    for name in ("A_001", "A_002"):
        write(tmp_path / "trajectories" / f"{name}.json", box=[2, 2, 9, 9])
        (tmp_path / "trajectories_task").mkdir(exist_ok=True)
        (tmp_path / "trajectories_task" / f"{name}.json").write_text(json.dumps({"pose": POSES}))
    for folder in ("color_img", "depth"):
        (tmp_path / folder).mkdir()
    cv2.imwrite(str(tmp_path / "color_img" / "A_001.png"), np.full((12, 16, 3), 50, np.uint8))
    cv2.imwrite(str(tmp_path / "depth" / "A_001.png"), np.full((12, 16), 700, np.uint16))
    first, second = read_demos(tmp_path)
    assert first.home is not None
    depth = first.home.frame().depth
    assert depth is not None
    assert depth[0, 0] == pytest.approx(0.7)
    assert second.home is None
    assert second.poses is not None
    assert second.poses.duration == pytest.approx(0.3)


def test_without_time_the_duration_is_not_known(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"joint_position": JOINTS}))
    (episode,) = read_demos(path)
    assert episode.movement.clock == "phase"
    assert episode.movement.duration == 1.0


@pytest.mark.parametrize(
    ("fields", "code", "words"),
    [
        ({"joint_position": JOINTS[:1], "time": [0.0]}, "too-short", "1 sample"),
        ({"joint_position": [], "time": []}, "missing-field", "must be"),
        ({"time": TIMES[:3]}, "length-mismatch", "3 times for 4"),
        ({"time": [0.0, 0.2, 0.1, 0.3]}, "time-order", "goes back at 1 places, first at sample 2"),
        ({"time": [0.0, 0.1, 0.1, 0.3]}, "time-order", "stands still"),
        ({"time": [0.0, None, 0.2, 0.3]}, "not-finite", "time of 1 samples, the first is sample 1"),
        ({"joint_position": [[None] * 7, *JOINTS[1:]]}, "not-finite", "joints of 1 samples"),
        ({"joint_position": [[float("nan")] * 7, *JOINTS[1:]]}, "not-finite", "joints of 1 samples"),
        ({"time": [0.0, 0.1, float("inf"), 0.3]}, "not-finite", "time of 1 samples, the first is sample 2"),
        ({"joint_position": [[0.0], [0.0, 1.0]]}, "missing-field", "rectangular"),
        ({"joint_position": "fast"}, "missing-field", "numbers"),
        ({"pose": [[0.0] * 7] * 4}, "bad-pose", "zero"),
        ({"pose": [[0.0] * 6] * 4}, "bad-pose", "7"),
        ({"box": [5, 5, 5, 9]}, "bad-box", "empty"),
        ({"box": [1, 2, 3]}, "bad-box", "4 finite"),
    ],
)
def test_faults_are_named_and_the_rest_is_read(
    tmp_path: Path, fields: dict[str, Any], code: str, words: str
) -> None:
    write(tmp_path / "good.json")
    write(tmp_path / "bad.json", **fields)
    reading = read_readable_demos(tmp_path)
    assert [episode.id for episode in reading.episodes] == ["good"]
    assert [(fault.code, fault.episode) for fault in reading.left_out] == [(code, "bad")]
    assert words in reading.left_out[0].message
    with pytest.raises(FileFormatError, match=r"bad\.json.*" + code):
        read_demos(tmp_path)


def test_all_faults_of_an_episode_are_named(tmp_path: Path) -> None:
    write(
        tmp_path / "bad.json",
        time=[0.0, None, 0.2, 0.1],
        joint_position=[[float(k)] for k in (1, 2, 3)] + [[None]],
    )
    codes = [fault.code for fault in read_readable_demos(tmp_path).left_out]
    assert codes == ["not-finite", "not-finite", "time-order"]


def test_an_arm_with_other_joints_is_left_out(tmp_path: Path) -> None:
    for name in "abc":
        write(tmp_path / f"{name}.json")
    write(tmp_path / "d.json", joint_position=[row[:6] for row in JOINTS])
    reading = read_readable_demos(tmp_path)
    assert [fault.code for fault in reading.left_out] == ["joint-count"]
    assert "6 joints" in reading.left_out[0].message
    assert len(reading.demonstrations()) == 3


def test_nothing_readable_is_an_error(tmp_path: Path) -> None:
    write(tmp_path / "bad.json", time=[3, 2, 1, 0])
    with pytest.raises(FileFormatError, match=r"no demonstration could be read.*time-order"):
        read_readable_demos(tmp_path).demonstrations()
    with pytest.raises(FileFormatError, match="no such file"):
        read_demos(tmp_path / "gone")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileFormatError, match="no known demonstrations"):
        read_demos(tmp_path / "empty")


def test_a_hundred_thousand_samples(tmp_path: Path) -> None:
    count = 100_000
    write(tmp_path / "long.json", time=list(range(count)), joint_position=[[1e-6 * k] for k in range(count)])
    (episode,) = read_demos(tmp_path)
    assert len(episode.movement) == count
