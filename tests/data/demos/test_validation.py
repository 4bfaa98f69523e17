from __future__ import annotations

import json
from pathlib import Path

import pytest

from punnet.data.demos import DEMO_FAULTS, DemoFault, DemonstrationSet, validate_demos, write_punnet_folder
from punnet.errors import ConfigurationError, FileFormatError


def test_a_sound_set(wall: DemonstrationSet, tmp_path: Path) -> None:
    write_punnet_folder(wall, tmp_path / "out")
    seen: list[tuple[int, int]] = []
    report = validate_demos(tmp_path / "out", progress=lambda done, total: seen.append((done, total)))
    assert report.faults == ()
    assert report.episodes == 36
    assert seen[-1] == (36, 36)


def test_what_the_reader_left_out_is_in_the_report(small_wall: DemonstrationSet, tmp_path: Path) -> None:
    write_punnet_folder(small_wall, tmp_path / "out")
    file = tmp_path / "out" / "demonstrations.json"
    data = json.loads(file.read_text())
    data["episodes"][0]["box"] = [0, 0, 0, 0]
    file.write_text(json.dumps(data))
    (tmp_path / "out" / data["episodes"][1]["photographs"][0]["rgb"]).write_bytes(b"no picture")
    report = validate_demos(tmp_path / "out")
    assert report.episodes == 3
    assert [(fault.code, fault.episode) for fault in report.faults] == [
        ("bad-box", "0-0-0"),
        ("unreadable-image", "0-0-1"),
    ]
    told = report.to_json()
    assert told["errors"] == 2
    assert told["by_code"] == {"bad-box": 1, "unreadable-image": 1}
    json.dumps(told)


def test_all_episodes_faulty_is_a_report_not_an_error(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps({"joint_position": [[1.0]], "time": [0.0]}))
    report = validate_demos(tmp_path / "a.json")
    assert report.episodes == 0
    assert [fault.code for fault in report.faults] == ["too-short"]


def test_formats_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        validate_demos(tmp_path / "gone")
    with pytest.raises(ConfigurationError, match="no format of demonstrations 'hdf5'"):
        validate_demos(tmp_path, "hdf5")
    with pytest.raises(FileFormatError, match="holds no demonstration"):
        validate_demos(tmp_path, "lab-json")


def test_codes_are_known() -> None:
    with pytest.raises(KeyError, match="no-such-fault"):
        DemoFault("no-such-fault", "", "")
    assert all(DemoFault(code, "text", "file", "3").severity in ("error", "warning") for code in DEMO_FAULTS)
