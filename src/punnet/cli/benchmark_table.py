"""``punnet benchmark table`` and ``compare``: several runs of the harvest benchmark side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from punnet.cli.benchmark_harvest import INTERRUPTED, Backend, Clusters, Workers, tell_errors
from punnet.cli.console import note, print_json, print_table, progress_bar, say
from punnet.cli.options import Json, OutFolder, Seed

__all__ = ["compare", "table"]


def table(
    out: OutFolder,
    rows: Annotated[
        list[str] | None,
        typer.Option(
            "--row",
            help="Only this one; may be repeated: skeleton, cvae, full, fused, default or oracle.",
            show_default=False,
        ),
    ] = None,
    suites: Annotated[
        list[str] | None,
        typer.Option(
            "--suite",
            help="Every row on this suite; may be repeated. Without it skeleton and default on all, the others on "
            "thesis and clustered.",
            show_default=False,
        ),
    ] = None,
    clusters: Clusters = 20,
    seed: Seed = 0,
    workers: Workers = 2,
    backend: Backend = "loky",
    force: Annotated[bool, typer.Option("--force", help="Begin the folder anew.")] = False,
    as_json: Json = False,
) -> None:
    """The whole table: the same plants harvested with each row of settings, on every suite that it is measured on.

    Interrupted, the same command goes on where it was; more --clusters, rows or suites add to the folder.
    """
    from punnet.harvest.benchmark_plants import PlantResult
    from punnet.harvest.benchmark_table import PICTURE, TABLE, run_table, runs_of_table

    runs = runs_of_table(seed, rows, suites)
    with progress_bar("harvesting", clusters * len(runs)) as advance:

        def count(name: str, plant: PlantResult) -> None:
            advance()

        try:
            figures = run_table(
                out,
                runs,
                clusters,
                seed=seed,
                workers=workers,
                backend=backend,
                force=force,
                progress=count,
            )
        except KeyboardInterrupt:
            note(f"interrupted; {out} keeps every plant that was done: the same command goes on")
            raise typer.Exit(INTERRUPTED) from None
    if as_json:
        print_json([_without_plants(run) for run in figures])
    else:
        _print_side_by_side(figures)
        say(f"wrote {out}: {TABLE}, {PICTURE}, a folder a run")
    faulty = [run for run in figures if tell_errors(run)]
    if faulty:
        raise typer.Exit(1)


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Folders of benchmarks.", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Picture, PNG, or table, MD, to write.", show_default=False),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")] = False,
    as_json: Json = False,
) -> None:
    """Set benchmarks side by side: a table, and a picture of what became of every reachable ripe berry."""
    from punnet.harvest.benchmark_folder import read_figures
    from punnet.harvest.benchmark_picture import draw_outcomes
    from punnet.harvest.benchmark_table import markdown_table
    from punnet.outputs import require_suffix, write_bytes

    if out is not None:
        require_suffix(out, ".png", ".md")
    figures = [read_figures(folder) for folder in runs]
    if out is not None:
        is_table = out.suffix.lower() == ".md"
        write_bytes(
            out, markdown_table(figures).encode() if is_table else draw_outcomes(figures), force=force
        )
    if as_json:
        print_json([_without_plants(run) for run in figures])
    else:
        _print_side_by_side(figures)


def _without_plants(run: Mapping[str, Any]) -> dict[str, Any]:
    return {name: run[name] for name in run if name != "per_cluster"}


def _print_side_by_side(figures: Sequence[Mapping[str, Any]]) -> None:
    from punnet.harvest.benchmark_table import COLUMNS, cells_of

    columns = [name if name in ("suite", "row") else f"{name}>" for name in COLUMNS]
    print_table(f"{len(figures)} harvest benchmarks", columns, [cells_of(run) for run in figures])
