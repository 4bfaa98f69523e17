"""``punnet benchmark table`` and ``compare``: tables, pictures, JSON, going on, and bad input."""

import json

import pytest

from punnet.cli.benchmark_harvest import INTERRUPTED
from punnet.harvest.benchmark_folder import BenchmarkFolder


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


def test_a_run_as_markdown(punnet, tmp_path, one_plant):
    punnet("benchmark", "harvest", "--suite", "thesis", "--clusters", 1, "-j", 1, "--out", tmp_path / "run")
    assert punnet("benchmark", "compare", tmp_path / "run", "--out", tmp_path / "table.md").code == 0
    head, rule, row = (tmp_path / "table.md").read_text().splitlines()
    assert head.count("|") == rule.count("|") == row.count("|")
    assert row.startswith("| thesis/1 | default | 1 | 50% (1/2;")
    assert "| 20.0 | 0.50 | 3.0 | 5% |" in row


def test_a_table_goes_on_where_it_was(punnet, tmp_path, one_plant):
    folder = tmp_path / "table"
    command = ("benchmark", "table", "--clusters", 1, "--workers", 1, "--out", folder)
    result = punnet(*command, "--row", "skeleton", "--row", "default", "--suite", "easy")
    assert result.code == 0, result.err
    assert one_plant == [("easy", "colour", "mean"), ("easy", "sim-fast", "collision-aware")]
    assert (folder / "outcomes.png").read_bytes().startswith(b"\x89PNG")
    lines = (folder / "table.md").read_text().splitlines()
    assert [line.split(" | ")[:2] for line in lines[2:]] == [
        ["| easy/1", "skeleton"],
        ["| easy/1", "default"],
    ]

    runs = json.loads(punnet(*command, "--json").out)
    assert len(runs) == 2 * 5 + 4 * 2
    assert all("per_cluster" not in run for run in runs)
    assert len(one_plant) == len(runs)  # none of the two again
    punnet(*command, "--seed", 1).fails_with("begun with seed 0", "--force")


def test_an_interrupted_table_says_how_to_go_on(punnet, tmp_path, monkeypatch):
    def interrupted(settings, number):
        raise KeyboardInterrupt

    monkeypatch.setattr("punnet.harvest.benchmark.run_plant", interrupted)
    result = punnet("benchmark", "table", "--clusters", 1, "--workers", 1, "--out", tmp_path / "table")
    assert result.code == INTERRUPTED
    assert "goes on" in result.err


@pytest.mark.parametrize(
    ("options", "named"),
    [(("--row", "best"), ("no row 'best'", "oracle")), (("--suite", "hard"), ("no suite 'hard'", "easy"))],
)
def test_rows_and_suites_that_there_are_not(punnet, tmp_path, options, named):
    punnet("benchmark", "table", *options, "--out", tmp_path / "table").fails_with(*named)
    assert not (tmp_path / "table").exists()


def test_bad_folders_are_named(punnet, tmp_path, taken):
    punnet("benchmark", "table", "--out", taken).fails_with("is no table of harvest benchmarks")
    punnet("benchmark", "compare", tmp_path).fails_with("figures.json")
    punnet("benchmark", "compare", tmp_path, "--out", tmp_path / "a.txt").fails_with("ends in .png or .md")
    BenchmarkFolder(tmp_path / "begun", {"suite": "easy"}).open(force=False)
    (tmp_path / "begun" / "figures.json").write_text("{}")
    punnet("benchmark", "compare", tmp_path / "begun").fails_with("no figures")
