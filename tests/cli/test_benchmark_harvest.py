"""``punnet benchmark harvest`` and ``compare``: tables, JSON, picture, and bad input."""

import json

import pytest

from punnet.harvest.benchmark_folder import BenchmarkFolder
from punnet.harvest.benchmark_plants import AttemptResult, PlantResult
from punnet.harvest.judge import Fate

FATE = {"index": 0, "stage": "ripe", "pluckable": True, "reachable": True, "mass": 20.0, "detached": True}
PLANT = PlantResult(
    0,
    7,
    (
        Fate(**FATE, punnet=0, peak_force=2.0, tool_force=0.0),
        Fate(**{**FATE, "index": 1, "detached": False}, punnet=None, peak_force=0.0, tool_force=0.0),
    ),
    (
        AttemptResult("picked", "place", aimed=0, estimate=21.0, true_weight=20.0, cut_error=0.003),
        AttemptResult("failed", "grip", "nothing between the pads", 1),
    ),
    seconds_simulated=20.0,
    seconds_computing=0.5,
)


@pytest.fixture
def one_plant(monkeypatch):
    """The command as it is, with one plant that needs no simulator."""

    def harvested(settings, number):
        return PLANT

    monkeypatch.setattr("punnet.harvest.benchmark.run_plant", harvested)


def test_a_suite_is_harvested_and_kept(punnet, tmp_path, one_plant):
    folder = tmp_path / "run"
    command = ("benchmark", "harvest", "--suite", "night", "--clusters", 1, "--workers", 1, "--out", folder)
    result = punnet(*command)
    assert result.code == 0, result.err
    for words in (
        "suite night/1",
        "50.0%",
        "1 of 2",
        "grip: nothing between the pads",
        "3.0 mm",
        "missed.png",
    ):
        assert words in result.out
    figures = json.loads(punnet(*command, "--json").out)
    assert (figures["suite"], figures["suite_version"], figures["seed"]) == ("night", 1, 0)
    assert figures["success"]["hits"] == 1
    assert (figures["planner"], figures["planner_bundle"]) == ("fused", None)
    assert figures["missed"] == {"grip: nothing between the pads": 1}
    punnet(*command, "--choice", "mean").fails_with("begun with choice 'collision-aware'", "--force")


def test_runs_side_by_side(punnet, tmp_path, one_plant):
    for suite in ("easy", "night"):
        punnet("benchmark", "harvest", "--suite", suite, "--clusters", 1, "-j", 1, "--out", tmp_path / suite)
    picture = tmp_path / "outcomes.png"
    result = punnet("benchmark", "compare", tmp_path / "easy", tmp_path / "night", "--out", picture)
    assert result.code == 0, result.err
    assert "easy/1" in result.out
    assert "night/1" in result.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    punnet("benchmark", "compare", tmp_path / "easy", "--out", picture).fails_with("exists", "--force")
    rows = json.loads(punnet("benchmark", "compare", tmp_path / "easy", "--json").out)
    assert rows[0]["suite"] == "easy"
    assert "per_cluster" not in rows[0]


def test_bad_input_is_named(punnet, tmp_path, taken):
    punnet("benchmark", "harvest", "--suite", "hard").fails_with("no suite 'hard'", "easy")
    punnet("benchmark", "harvest", "--choice", "best").fails_with("no choice 'best'", "mean")
    punnet("benchmark", "harvest", "--planner", "rrt").fails_with("no planner 'rrt'", "deep-promp")
    nowhere = ("--planner", "fused", "--planner-bundle", "nowhere")
    punnet("benchmark", "harvest", *nowhere).fails_with("nowhere")
    punnet("harvest", *nowhere, "--out", tmp_path / "harvest").fails_with("nowhere")
    punnet("benchmark", "harvest", "--backend", "threads").fails_with("backend", "loky")
    punnet("benchmark", "harvest", "--out", taken).fails_with("is no harvest benchmark")
    punnet("benchmark", "compare", tmp_path).fails_with("figures.json")
    punnet("benchmark", "compare", tmp_path, "--out", tmp_path / "a.txt").fails_with("ends in .png")
    BenchmarkFolder(tmp_path / "begun", {"suite": "easy"}).open(force=False)
    (tmp_path / "begun" / "figures.json").write_text("{}")
    punnet("benchmark", "compare", tmp_path / "begun").fails_with("no figures")
