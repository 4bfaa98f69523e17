"""Rows of the benchmark's table: which runs they are, and that a run knows its row."""

import pytest

from punnet.harvest.benchmark_figures import figures_of
from punnet.harvest.benchmark_table import ROWS, markdown_table, row_of, runs_of_table
from punnet.harvest.suites import SUITES


def test_every_row_is_another_set_of_settings():
    runs = runs_of_table(3)
    assert len({tuple(run.to_json().items()) for run in runs.values()}) == len(runs)
    assert {run.seed for run in runs.values()} == {3}
    for row in ("skeleton", "default"):
        assert {run.suite for name, run in runs.items() if name.startswith(f"{row}-")} == set(SUITES)


def test_suites_that_are_named_are_for_all_rows():
    assert list(runs_of_table(0, suites=["night"])) == [f"{row}-night" for row in ROWS]


def test_a_run_knows_its_row():
    for name, run in runs_of_table(0).items():
        assert row_of(run.to_json()) == name.split("-")[0]
    other = {**runs_of_table(0)["default-easy"].to_json(), "order": "cheapest"}
    assert row_of(other) == "sim-fast + fused + collision-aware, cheapest"


@pytest.mark.parametrize("name", ["default-thesis", "cvae-thesis"])
def test_a_run_without_a_berry_is_a_line_too(name):
    line = markdown_table([{**runs_of_table(0)[name].to_json(), **figures_of(())}]).splitlines()[2]
    assert line.count("–") == 4
    assert "| none | 0/0 | 0/0 | 0/0 |" in line
