from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data.demos import read_demos, read_readable_demos, validate_demos
from punnet.errors import FileFormatError
from punnet.robot import PANDA_LIMITS, Panda


@pytest.fixture
def folder(tmp_path: Path, rng: np.random.Generator) -> Path:
    (tmp_path / "img").mkdir()
    cv2.imwrite(str(tmp_path / "img" / "a.png"), np.zeros((72, 128, 3), np.uint8))
    task = rng.normal(size=(3, 7, 8))
    task[:, 3:6], task[:, 6] = 0.0, 1.0
    eigen = rng.uniform(0.1, 1.0, size=(3, 7, 9))
    np.savez(
        tmp_path / "promp_weights.npz",
        ids=np.array(["000", "001", "002"]),
        joint_mean=rng.normal(size=(3, 7, 8)),
        task_mean=task,
        joint_cov_eig=eigen,
        task_cov_eig=eigen,
    )
    write_index(tmp_path, [entry(name) for name in ("000", "001", "002")])
    return tmp_path


def entry(name: str, **fields: Any) -> dict[str, Any]:
    return {
        "id": name,
        "config": 1,
        "image": "img/a.png",
        "bbox_xywh": [10, 20, 30, 40],
        "note": "n",
    } | fields


def write_index(folder: Path, entries: list[dict[str, Any]]) -> None:
    (folder / "index.json").write_text(json.dumps(entries))


def test_reads_boxes_weights_and_scenes(folder: Path) -> None:
    demonstrations = read_demos(folder)
    first = demonstrations[0]
    assert first.group == "scene-1"
    assert first.target is not None
    assert first.target.box.tolist() == [10, 20, 40, 60]
    assert first.home is not None
    assert first.home.size == (72, 128)
    assert first.joint_weights is not None
    with np.load(folder / "promp_weights.npz") as data:
        value, vector = data["joint_cov_eig"][0, 2, 0], data["joint_cov_eig"][0, 2, 1:]
    np.testing.assert_allclose(first.joint_weights.covariance[2], value * np.outer(vector, vector))
    assert first.joint_weights.is_psd.all()
    assert first.extra == {"note": "n"}


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"image": "img/gone.png"}, "missing-image"),
        ({"image": 3}, "unreadable"),
        ({"bbox_xywh": [1, 2, 0, 4]}, "bad-box"),
        ({"bbox_xywh": [300, 2, 4, 4]}, "unreadable"),
        ({"bbox_xywh": None}, "bad-box"),
        ({"id": "009"}, "missing-field"),
        ({"id": "000"}, "duplicate-id"),
    ],
)
def test_a_faulty_target_is_left_out(folder: Path, fields: dict[str, Any], code: str) -> None:
    write_index(folder, [entry("000"), entry("001", **fields)])
    reading = read_readable_demos(folder)
    assert [episode.id for episode in reading.episodes] == ["000"]
    assert [fault.code for fault in reading.left_out] == [code]


def test_damaged_files(folder: Path) -> None:
    (folder / "promp_weights.npz").write_bytes(b"PK\x03\x04 no zip")
    with pytest.raises(FileFormatError, match=r"promp_weights\.npz"):
        read_demos(folder)
    np.savez(folder / "promp_weights.npz", ids=np.array(["000"]))
    with pytest.raises(FileFormatError, match="no array"):
        read_demos(folder)
    np.savez(
        folder / "promp_weights.npz",
        ids=np.array(["000"]),
        **{
            name: np.zeros((1, 7, 8)) for name in ("joint_mean", "task_mean", "joint_cov_eig", "task_cov_eig")
        },
    )
    with pytest.raises(FileFormatError, match="must be"):
        read_demos(folder)


def test_the_labs_reaches(shared_data: Path) -> None:
    demonstrations = read_demos(shared_data / "reach")
    assert len(demonstrations) == 75
    assert [len(indices) for indices in demonstrations.groups.values()] == [19, 18, 19, 19]
    joints, poses = demonstrations.resampled(30)
    flange = Panda().forward_kinematics(joints)
    assert np.linalg.norm(flange[..., :3, 3] - poses[..., :3], axis=-1).mean() < 0.012
    report = validate_demos(
        shared_data / "reach", limits=PANDA_LIMITS, forward_kinematics=Panda().forward_kinematics
    )
    assert report.episodes == 75
    assert report.errors == 0
    assert report.by_code["joint-limit"] == 27
    assert report.by_code["quaternion-norm"] == 8
    assert report.by_code["suspected-swap"] == 6
    assert report.by_code["suspected-mismatch"] == 3
