"""``punnet reproduce``: tables and figures of the thesis, our numbers beside its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import note, print_json, progress_bar, say
from punnet.cli.options import Json
from punnet.cli.reproduce_planner import register_planner
from punnet.cli.reproduce_weight import fig_4_12
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.data.thesis_tables import DatasetFacts, MarkdownTable

__all__ = ["register"]

DataSets = Annotated[
    list[str],
    typer.Option(
        "--data", help="[NAME=]PATH of annotated images; may be given several times.", show_default=False
    ),
]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Tables and figures of the thesis, ours beside its own.", no_args_is_help=True)
    group.command("table-3-1", epilog="Example: punnet reproduce table-3-1 --data sim=simulated/")(table_3_1)
    group.command("table-3-2", epilog="Example: punnet reproduce table-3-2 --data sim=simulated/")(table_3_2)
    group.command(
        "table-3-3", epilog="Example: punnet reproduce table-3-3 'colour, field=scores/evaluation.json'"
    )(table_3_3)
    group.command("fig-4-12", epilog="Example: punnet reproduce fig-4-12 --data dataset-1 --out fig-4-12")(
        fig_4_12
    )
    register_planner(group)
    app.add_typer(group, name="reproduce")


def table_3_1(data: DataSets, as_json: Json = False) -> None:
    """What data sets hold: depth, masks, key-points, weights."""
    from punnet.data import thesis_tables

    _show(thesis_tables.table_3_1(_facts(data)), as_json)


def table_3_2(data: DataSets, as_json: Json = False) -> None:
    """How many berries of each class data sets hold."""
    from punnet.data import thesis_tables

    _show(thesis_tables.table_3_2(_facts(data)), as_json)


def table_3_3(
    evaluations: Annotated[
        list[str] | None,
        typer.Argument(
            help="[NAME=]PATH of what punnet evaluate detector --out or --json wrote.", show_default=False
        ),
    ] = None,
    rows: Annotated[
        list[str] | None,
        typer.Option("--row", help="[NAME=]BUNDLE:DATA[:SPLIT], evaluated now; may be given several times."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Average precision of masks at IoU .5 .7 .9 and of key-points at OKS .1 .3 .5, per class.

    Rows stand in the order: evaluations made earlier, those made now, the thesis.
    """
    from punnet.perception.evaluation_folder import read_evaluation
    from punnet.perception.precision_table import table_3_3 as tabulate

    figures: dict[str, dict[str, Any]] = {}
    for given in evaluations or []:
        name, path = _named(given)
        _add(figures, name, read_evaluation(Path(path)))
    for given in rows or []:
        name, row = _named(given)
        _add(figures, name, _evaluate(row))
    _show(tabulate(figures), as_json)
    left_out = {name: len(data["skipped"]) for name, data in figures.items() if data["skipped"]}
    for name, count in left_out.items():
        note(f"{name}: {count} images could not be scored and are left out")
    if left_out:
        raise typer.Exit(1)


def _show(table: MarkdownTable, as_json: bool) -> None:
    if as_json:
        print_json(table.to_json())
    else:
        say(table.markdown())


def _facts(data: list[str]) -> list[DatasetFacts]:
    from punnet.data.formats import read_dataset
    from punnet.data.thesis_tables import dataset_facts

    return [dataset_facts(read_dataset(path), name) for name, path in map(_named, data)]


def _named(given: str) -> tuple[str | None, str]:
    name, separator, rest = given.partition("=")
    return (name, rest) if separator else (None, given)


def _add(figures: dict[str, dict[str, Any]], name: str | None, data: dict[str, Any]) -> None:
    split = f", {data['split']}" if data.get("split") else ""
    name = f"{data['detector']}, {data['data']}{split}" if name is None else name
    if name in figures:
        raise ConfigurationError(f"two rows are called '{name}'; name them: NAME=…")
    figures[name] = data


def _evaluate(row: str) -> dict[str, Any]:
    from punnet.data.formats import read_dataset
    from punnet.data.splits.part import choose_part
    from punnet.perception.evaluation import evaluate_detector, prepare_detector

    bundle, *rest = row.split(":")
    if not bundle or len(rest) not in (1, 2) or not all(rest):
        raise ConfigurationError(f"row '{row}': must be BUNDLE:DATA or BUNDLE:DATA:SPLIT")
    detector, settings = prepare_detector(bundle)
    images = read_dataset(rest[0])
    split = rest[1] if len(rest) == 2 else None
    if split is not None:
        images = choose_part(images, split)
    with progress_bar(f"evaluating {detector.name}", len(images)) as advance:
        evaluation = evaluate_detector(images, detector, settings, data=images.name, progress=advance)
    return evaluation.to_json() | {"split": split}
