"""``punnet demo``, ``harvest``, ``benchmark`` and ``demos``: bad input, and Ctrl-C in the middle of a pick."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from punnet.bundle import load_bundle
from punnet.harvest.benchmark_plants import PlantResult
from punnet.outputs import MARKER_FILE

# A shell that runs the tests in the background has Ctrl-C ignored, and its children inherit that.
COMMAND = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from punnet.cli import main
main()
"""


@pytest.mark.parametrize("command", ["demo", "harvest"])
def test_output_is_checked_before_anything_is_grown(
    punnet, command: str, unwritable: Path, taken: Path
) -> None:
    punnet(command, "--out", unwritable).fails_with(str(unwritable), "file stands")
    punnet(command, "--out", taken).fails_with("exists", "--force")
    punnet(command, "--out", taken, "--force").fails_with("not made by punnet")
    assert (taken / "thesis.txt").read_text() == "the only copy"


@pytest.mark.parametrize(
    "arguments",
    [
        ("demo", "--seed", "-1"),
        ("harvest",),
        ("benchmark", "harvest", "--clusters", "0"),
        ("benchmark", "harvest", "--workers", "none"),
        ("demos", "simulate"),
        ("demos", "simulate", "--bundle", "x", "--configs", "0"),
    ],
    ids=" ".join,
)
def test_wrong_options(punnet, arguments: tuple[str, ...]) -> None:
    assert punnet(*arguments).code == 2


def test_demos_simulate_makes_a_bundle(punnet, tmp_path: Path, unwritable: Path) -> None:
    options = ("--configs", "3", "--repeats", "2", "--seed", "1", "--bundle")
    assert punnet("demos", "simulate", *options, tmp_path / "reach").code == 0
    bundle = load_bundle(tmp_path / "reach", kind="promp")
    assert bundle.manifest.seed == 1
    punnet("demos", "simulate", *options, tmp_path / "reach").fails_with("exists", "--force")
    assert punnet("demos", "simulate", *options, tmp_path / "reach", "--force").code == 0
    punnet("demos", "simulate", *options, unwritable).fails_with(str(unwritable))


def test_interrupted_harvest_is_kept_and_said_so(tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "harvest", "--seed", "7", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    said = ""
    for line in process.stderr:
        said += line
        if "reaches for berry" in line:
            break
    process.send_signal(signal.SIGINT)
    said += process.communicate(timeout=120)[1]
    assert process.returncode == 130, said
    assert f"interrupted; kept what was finished in {out}" in said
    assert "Traceback" not in said
    record = json.loads((out / "harvest.json").read_text())
    assert record["interrupted"] is True
    assert len(record["picks"]) == 1
    assert "interrupted" in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "first_view.png").is_file()
    assert json.loads((out / MARKER_FILE).read_text())["complete"] is False
    kinds = [json.loads(line)["kind"] for line in (out / "harvest.jsonl").read_text().splitlines()]
    assert kinds == ["begun", "attempt_begun", "ended"]


def test_resume_takes_everything_from_the_log(punnet, tmp_path: Path) -> None:
    punnet("harvest", "--resume", "--out", tmp_path / "none").fails_with("holds no harvest.jsonl", "--resume")
    punnet("harvest", "--resume", "--seed", "3", "--out", tmp_path).fails_with("leave the others out")


@pytest.mark.parametrize("finished", [0, 2])
def test_interrupted_benchmark_gives_the_figures_of_what_is_done(
    punnet, monkeypatch: pytest.MonkeyPatch, finished: int
) -> None:
    def broken_off(*args: object, progress: Callable[[PlantResult], None], **kwargs: object) -> None:
        for number in range(finished):
            progress(PlantResult(number, 7))
        raise KeyboardInterrupt

    monkeypatch.setattr("punnet.harvest.benchmark.run_benchmark", broken_off)
    result = punnet("benchmark", "harvest", "--clusters", "5", "--json")
    assert result.code == 130
    if finished:
        assert json.loads(result.out)["clusters"] == 2
        assert "2 of 5 plants" in result.err
    else:
        assert "nothing was finished" in result.err


def test_a_dry_run_writes_motions_only(punnet, tmp_path: Path) -> None:
    command = ("harvest", "--robot", "dry-run", "--suite", "easy", "--seed", "3", "--oracle")
    result = punnet(*command, "--out", tmp_path / "dry", "--json")
    assert result.code == 0, result.err
    told = json.loads(result.out)
    assert told["berries"]
    assert (tmp_path / "dry" / told["trajectories"][0]).is_file()
    assert {path.suffix for path in (tmp_path / "dry").iterdir()} == {".json", ".jsonl"}
    punnet(*command, "--out", tmp_path / "dry").fails_with("exists", "--force")
    punnet(*command, "--pick", "1", "--out", tmp_path / "other").fails_with("dry-run")
    punnet("harvest", "--robot", "ur5e", "--out", tmp_path / "other").fails_with("no 'ur5e'", "dry-run")


def test_a_dry_run_of_another_arm(punnet, tmp_path: Path) -> None:
    command = ("harvest", "--suite", "easy", "--seed", "3", "--oracle", "--arm", "xarm7")
    result = punnet(*command, "--robot", "dry-run", "--out", tmp_path / "dry", "--json")
    assert result.code == 0, result.err
    told = json.loads(result.out)
    assert told["berries"]
    assert all(berry["punnet"] for berry in told["berries"])
    motion = json.loads((tmp_path / "dry" / told["trajectories"][0]).read_text())
    assert motion["joint_names"] == [f"joint{number}" for number in range(1, 8)]
    punnet("harvest", "--arm", "ur6", "--out", tmp_path / "other").fails_with("no file 'ur6'", "xarm7")
