"""The table of the benchmark: rows of settings on suites of plants, each run kept in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from punnet.errors import ConfigurationError
from punnet.harvest.benchmark import BenchmarkSettings, run_benchmark
from punnet.harvest.benchmark_picture import draw_outcomes, row_name
from punnet.harvest.benchmark_plants import PlantResult
from punnet.harvest.scenario import ORACLE
from punnet.harvest.suites import SUITES, suite_of
from punnet.outputs import MARKER_FILE, mark, write_bytes, write_text
from punnet.sim.growing_folder import open_folder

__all__ = [
    "COLUMNS",
    "PICTURE",
    "ROWS",
    "TABLE",
    "Row",
    "cells_of",
    "markdown_table",
    "row_of",
    "run_table",
    "runs_of_table",
]

SCHEMA = "punnet-harvest-table/1"
TABLE, PICTURE = "table.md", "outcomes.png"
_BEGUN = "table.json"
_NARROW = ("thesis", "clustered")
COLUMNS = (
    "suite",
    "row",
    "plants",
    "picked, of reachable ripe",
    "wrong",
    "damaged",
    "unripe hit",
    "s a pick",
    "computing s",
    "mm off at the cut",
    "weight off",
)


@dataclass(frozen=True)
class Row:
    """Settings that are measured.

    Parameters
    ----------
    about
        What it stands for.
    changes
        Fields of :class:`~punnet.harvest.benchmark.BenchmarkSettings` that are not the defaults.
    suites
        Names of those that it is measured on, if the caller names none.
    """

    about: str
    changes: Mapping[str, str]
    suites: tuple[str, ...] = _NARROW


ROWS: dict[str, Row] = {
    "skeleton": Row(
        "colour baseline, demonstrated movement conditioned on the point that depth gives, its mean",
        {"perception": "colour", "planner": "promp-depth", "choice": "mean"},
        tuple(SUITES),
    ),
    "cvae": Row(
        "the thesis': its tuned cVAE in task space, told of colour alone, its mean",
        {"planner": "deep-promp", "planner_bundle": "reach-sim:l-cvae-task", "choice": "mean"},
    ),
    "full": Row("our network, told of colour alone, its mean", {"planner": "deep-promp", "choice": "mean"}),
    "fused": Row("our network conditioned on the point that depth gives, its mean", {"choice": "mean"}),
    "default": Row("the same, and of 64 reaches the one that is clear of the scene", {}, tuple(SUITES)),
    "oracle": Row("the default with true poses and weights: what perception costs", {"perception": ORACLE}),
}
"""By name, from the least to the most told."""


def runs_of_table(
    seed: int, rows: Sequence[str] | None = None, suites: Sequence[str] | None = None
) -> dict[str, BenchmarkSettings]:
    """The runs of a table by the name of their folder, ``ROW-SUITE``.

    Parameters
    ----------
    seed
        Of the benchmark.
    rows
        Names of :data:`ROWS`; None for all.
    suites
        Names of suites, for all rows; None for those that each row is measured on.

    Raises
    ------
    ConfigurationError
        If there is no such row or suite.
    """
    for name in rows or ():
        if name not in ROWS:
            raise ConfigurationError(f"benchmark: no row '{name}'; there are {', '.join(ROWS)}")
    for name in suites or ():
        suite_of(name)
    return {
        f"{name}-{suite}": BenchmarkSettings(suite, seed, **row.changes)
        for suite in SUITES
        for name, row in ROWS.items()
        if (not rows or name in rows) and suite in (suites or row.suites)
    }


def run_table(
    folder: str | Path,
    runs: Mapping[str, BenchmarkSettings],
    plants: int,
    *,
    seed: int,
    workers: int = 1,
    backend: str = "loky",
    force: bool = False,
    progress: Callable[[str, PlantResult], None] | None = None,
) -> list[dict[str, Any]]:
    """Harvest the same ``plants`` plants of each suite with each row; the figures of the runs, in their order.

    Parameters
    ----------
    folder
        Keeps a folder a run, to which a later call adds plants or runs, :data:`TABLE` and :data:`PICTURE`.
    runs
        As :func:`runs_of_table` gives them.
    seed
        Theirs; a folder holds the plants of one seed.
    workers, backend
        See :func:`~punnet.harvest.benchmark.run_benchmark`.
    force
        Begin anew what the folder holds.
    progress
        Told of each plant, and of which run, as it is done.

    Raises
    ------
    ConfigurationError, BundleError, OutputExistsError
        As from :func:`~punnet.harvest.benchmark.run_benchmark`.
    """
    place = Path(folder).expanduser()
    begun = {"schema": SCHEMA, "seed": seed}
    open_folder(place, _BEGUN, begun, what="table of harvest benchmarks", parts=[], force=force)
    told = progress or (lambda name, plant: None)
    figures: list[dict[str, Any]] = []
    for name, settings in runs.items():

        def tell(plant: PlantResult, name: str = name) -> None:
            told(name, plant)

        result = run_benchmark(
            settings, plants, workers=workers, backend=backend, folder=place / name, progress=tell
        )
        figures.append(result.to_json())
        write_text(place / TABLE, markdown_table(figures), force=True)
    write_bytes(place / PICTURE, draw_outcomes(figures), force=True)
    write_bytes(place / MARKER_FILE, mark(complete=True), force=True)
    return figures


def markdown_table(figures: Sequence[Mapping[str, Any]]) -> str:
    """Runs as a table in Markdown: :data:`COLUMNS`, and a line a run."""
    rows = [COLUMNS, ["---"] * len(COLUMNS), *map(cells_of, figures)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def row_of(figures: Mapping[str, Any]) -> str:
    """Name in :data:`ROWS` of a run's settings; what they are, in one line, if none has them."""
    for name, row in ROWS.items():
        settings = BenchmarkSettings(figures["suite"], figures["seed"], **row.changes).to_json()
        if all(figures[field] == value for field, value in settings.items()):
            return name
    return row_name(figures)


def cells_of(run: Mapping[str, Any]) -> list[str]:
    """A run's figures under :data:`COLUMNS`; a row of the table is called by its name in :data:`ROWS`, if it has one."""
    success, weight = run["success"], run["weight"]
    picked = "none"
    if success["of"]:
        low, high = (100 * bound for bound in success["interval_95"])
        picked = f"{100 * success['share']:.0f}% ({success['hits']}/{success['of']}; {low:.0f}…{high:.0f})"
    return [
        f"{run['suite']}/{run['suite_version']}",
        row_of(run),
        str(run["clusters"]),
        picked,
        *(f"{run[name]['hits']}/{run[name]['of']}" for name in ("wrong_picks", "damaged", "unripe_touched")),
        _number(run["seconds_a_pick"], ".1f"),
        _number(run["computing_seconds_a_pick"], ".2f"),
        _number(run["cut_error_mm"]["median"] if run["cut_error_mm"]["count"] else None, ".1f"),
        _number(weight["mean_error"] if weight["berries"] else None, ".0%"),
    ]


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else f"{value:{form}}"
