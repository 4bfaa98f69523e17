from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Result

Punnet = Callable[..., Result]
PHASE = np.linspace(0.0, 1.0, 30)[:, None]


def write(folder: Path, name: str, joints: np.ndarray, **fields: object) -> None:
    times = np.linspace(0.0, 3.0, len(joints)).tolist()
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.json").write_text(
        json.dumps({"joint_position": joints.tolist(), "time": times} | fields)
    )


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """Three sound reaches of a Panda from home and one whose time goes back."""
    from punnet.robot import HOME

    folder = tmp_path / "recordings"
    rng = np.random.default_rng(1)
    for name in "abc":
        write(folder, name, HOME + PHASE * rng.normal(0, 0.2, 7), target="berry")
    write(folder, "d", HOME + PHASE * 0.2, time=[0.0, 2.0, 1.0, *range(3, 30)])
    return folder


@pytest.fixture
def sound(recordings: Path) -> Path:
    """Without the bad one."""
    (recordings / "d.json").unlink()
    return recordings


def test_convert_skips_the_bad_one_and_says_so(punnet: Punnet, recordings: Path, tmp_path: Path) -> None:
    result = punnet("demos", "convert", recordings, "--out", tmp_path / "out", "--json")
    assert result.code == 1
    assert "left out" in result.err
    assert "time-order" in result.err
    told = json.loads(result.out)
    assert told["episodes"] == 3
    assert len(told["left_out"]) == 1
    result = punnet("demos", "stats", tmp_path / "out")
    assert result.code == 0
    again = punnet("demos", "convert", recordings, "--out", tmp_path / "out")
    again.fails_with("--force")


def test_convert_to_lerobot_and_back(punnet: Punnet, sound: Path, tmp_path: Path) -> None:
    result = punnet("demos", "convert", sound, "--to", "lerobot", "--fps", 10, "--out", tmp_path / "data")
    assert result.code == 0, result.err
    assert "not in lerobot: double precision" in result.err
    told = json.loads(punnet("demos", "stats", tmp_path / "data", "--json").out)
    assert told["episodes"] == 3
    assert told["targets"] == 1
    assert told["samples_per_second"]["median"] == pytest.approx(10.0)


def test_validate(punnet: Punnet, recordings: Path, sound: Path) -> None:
    assert punnet("demos", "validate", sound).code == 0
    from punnet.robot import HOME

    write(sound, "e", HOME + PHASE * np.array([0, 0, 0, -1.5, 0, 0, 0]))
    result = punnet("demos", "validate", sound, "--json")
    assert result.code == 1
    assert json.loads(result.out)["by_code"] == {"joint-limit": 1}
    result = punnet("demos", "validate", sound)
    assert "q4" in result.out
    assert "0 errors and 1 warning;" in result.err


def test_stats_and_plot(punnet: Punnet, sound: Path, tmp_path: Path) -> None:
    result = punnet("demos", "stats", sound)
    assert "spread of repeats at the end" in result.out
    assert punnet("demos", "plot", sound, "--out", tmp_path / "a.png").code == 0
    assert (tmp_path / "a.png").stat().st_size > 10_000
    punnet("demos", "plot", sound, "--out", tmp_path / "a.png").fails_with("exists")
    punnet("demos", "plot", sound, "--out", tmp_path / "a.gif").fails_with(".png")


def test_what_is_not_there_or_nothing(punnet: Punnet, tmp_path: Path) -> None:
    punnet("demos", "stats", tmp_path / "gone").fails_with("no such file or folder")
    punnet("demos", "convert", tmp_path, "--out", tmp_path / "out").fails_with(
        "no known demonstrations", "rosbag"
    )
    assert not (tmp_path / "out").exists()


def test_simulate_a_folder(punnet: Punnet, tmp_path: Path) -> None:
    options = ("--configs", 1, "--repeats", 2, "--seed", 3)
    result = punnet("demos", "simulate", *options, "--out", tmp_path / "demos", "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["episodes"] == 2
    punnet("demos", "simulate", *options, "--out", tmp_path / "demos").fails_with("complete", "--force")
    assert punnet("demos", "validate", tmp_path / "demos").code == 0


def test_simulate_needs_one_place(punnet: Punnet, tmp_path: Path) -> None:
    assert punnet("demos", "simulate").code == 2
    punnet("demos", "simulate", "--out", tmp_path / "demos.zip").fails_with("called like a file", "leave")
    both = ("--out", tmp_path / "a", "--bundle", tmp_path / "b")
    assert punnet("demos", "simulate", *both).code == 2
