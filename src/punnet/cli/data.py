"""``punnet data``: labelled images, made, converted, checked, counted, split and shown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import busy, note, print_json, print_table, say
from punnet.cli.data_convert import convert
from punnet.cli.data_options import ClassMapping, DataFormat, DataPath, class_map_of
from punnet.cli.data_simulate import simulate
from punnet.cli.data_validate import validate
from punnet.cli.data_view import view
from punnet.cli.options import Force, Json, OutFolder, Seed
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.data.dataset import Dataset
    from punnet.data.splits import Split
    from punnet.data.statistics import DatasetStatistics
    from punnet.data.thesis_tables import MarkdownTable

__all__ = ["register"]

FEWEST_BY_IMAGE = (
    "no group is known, so each image is its own: if some show the same plant, say which by --pattern"
)
Share = Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of the images; 0 leaves the part out.")]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(
        help="Labelled images: make, convert, check, count, split, show.", no_args_is_help=True
    )
    group.command(
        "simulate", epilog="Example: punnet data simulate --images 300 --out simulated --workers 2"
    )(simulate)
    group.command("convert", epilog="Example: punnet data convert export.zip.d --out berries.json")(convert)
    group.command("validate", epilog="Example: punnet data validate berries.json --fix --out repaired.json")(
        validate
    )
    group.command("stats", epilog="Example: punnet data stats berries.json --figure berries.png")(stats)
    group.command(
        "split", epilog="Example: punnet data split berries.json --pattern 'plant\\d+' --out parts"
    )(split)
    group.command("view", epilog="Example: punnet data view berries.json --serve")(view)
    app.add_typer(group, name="data")


def stats(
    paths: Annotated[
        list[str],
        typer.Argument(metavar="[NAME=]PATH...", help="Sets of labelled images.", show_default=False),
    ],
    figure: Annotated[
        Path | None,
        typer.Option("--figure", help="Histograms of one set, PNG, SVG or PDF.", show_default=False),
    ] = None,
    data_format: DataFormat = None,
    class_map: ClassMapping = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the figure.")] = False,
    as_json: Json = False,
) -> None:
    """Tables 3.1 and 3.2 of the thesis for any set, and its sizes, occlusion, visibility, ripeness and weights."""
    from dataclasses import replace

    from punnet.data.formats import read_dataset
    from punnet.data.statistics import dataset_statistics, draw_statistics
    from punnet.data.thesis_tables import dataset_facts, table_3_1, table_3_2

    if figure is not None and len(paths) != 1:
        raise ConfigurationError("--figure shows one set; give one path")
    meaning = class_map_of(class_map)
    sets: list[Dataset] = []
    with busy("reading"):
        for given in paths:
            name, path = _named(given)
            dataset = read_dataset(path, data_format, class_map=meaning)
            sets.append(dataset if name is None else replace(dataset, name=name))
    facts = [dataset_facts(dataset) for dataset in sets]
    counted = [dataset_statistics(dataset) for dataset in sets]
    tables = {"table_3_1": table_3_1(facts), "table_3_2": table_3_2(facts)}
    if figure is not None:
        draw_statistics(counted[0], figure, force=force)
    if as_json:
        print_json(
            {name: table.to_json()["rows"] for name, table in tables.items()}
            | {"sets": [one.to_json() for one in counted]}
        )
        return
    for table in tables.values():
        _print_table(table)
    for one in counted:
        _print_statistics(one)
    if figure is not None:
        say(f"wrote {figure}")


def _named(given: str) -> tuple[str | None, str]:
    """Name and path of ``NAME=PATH``; a path that exists is a path, whatever it is called."""
    name, separator, rest = given.partition("=")
    return (name, rest) if separator and name and not Path(given).exists() else (None, given)


def _print_table(table: MarkdownTable) -> None:
    columns = (table.columns[0], *(f"{name}>" for name in table.columns[1:]))
    print_table(f"Table {table.name}", columns, table.rows)


def _print_statistics(one: DatasetStatistics) -> None:
    rows = []
    for distribution in one.distributions.values():
        levels = distribution.percentiles()
        if levels is not None:
            label = f"{distribution.name} ({distribution.unit})" if distribution.unit else distribution.name
            rows.append((label, str(len(distribution.values)), *(f"{level:.3g}" for level in levels)))
    groups = f", {one.groups} plants or scenes" if one.groups else ""
    title = f"{one.name}: {one.images} images{groups}, {one.berries} berries, {one.crowd} crowd"
    print_table(title, ("", "count>", "5%>", "25%>", "50%>", "75%>", "95%>"), rows)
    visibility = one.to_json()["visibility"]
    if one.visibility.any():
        codes = list(next(iter(visibility.values())))
        body = [(name, *(str(counts[code]) for code in codes)) for name, counts in visibility.items()]
        print_table("berries by key-point", ("key-point", *(f"{code}>" for code in codes)), body)
    if one.stages:
        print_table(
            "berries by stage", tuple(f"{stage}>" for stage in one.stages), [map(str, one.stages.values())]
        )


def split(
    path: DataPath,
    out: OutFolder,
    train: Share = 0.8,
    validation: Share = 0.1,
    test: Share = 0.1,
    pattern: Annotated[
        str | None,
        typer.Option(
            "--pattern",
            help="Regular expression that finds the plant in a file name (its first group, if it has one).",
            show_default=False,
        ),
    ] = None,
    lists: Annotated[
        Path | None,
        typer.Option("--list", help="A split.json to apply instead of drawing.", show_default=False),
    ] = None,
    seed: Seed = 0,
    data_format: DataFormat = None,
    class_map: ClassMapping = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Split into train, validation and test; images of one plant or scene are never in two parts.

    Writes one COCO file a part, which names the photographs where they are, and split.json into --out. Plants are told
    by --pattern, else by the field "group" of the images, else each image counts as one.
    """
    from punnet.data.formats import read_dataset
    from punnet.data.splits import apply_split, read_split, split_dataset, write_split
    from punnet.outputs import OutputFolder

    with busy("reading"):
        dataset = read_dataset(path, data_format, class_map=class_map_of(class_map))
    if lists is not None:
        chosen = apply_split(dataset, read_split(lists), str(lists))
    else:
        shares = {
            name: share
            for name, share in (("train", train), ("validation", validation), ("test", test))
            if share
        }
        chosen = split_dataset(dataset, shares, seed=seed, pattern=pattern)
    with OutputFolder(out, force=force) as output, busy("writing"):
        write_split(dataset, chosen, output.path)
    rows = _rows(dataset, chosen)
    if as_json:
        print_json(
            {"out": str(out), "grouped_by": chosen.grouped_by, "parts": rows, "straddling": chosen.straddling}
        )
    else:
        columns = ("part", "images>", "groups>", "pluckable>", "unpluckable>")
        print_table("", columns, [(name, *map(str, row.values())) for name, row in rows.items()])
        say(f"grouped by {chosen.grouped_by}; see {out}")
    if chosen.grouped_by == "image":
        note(FEWEST_BY_IMAGE)
    left_out = len(dataset) - sum(map(len, chosen.parts.values()))
    if left_out:
        note(f"{left_out} images are in no list and were left out")
    if chosen.straddling:
        note(
            f"{len(chosen.straddling)} groups are in more than one part, '{chosen.straddling[0]}' among them"
        )
        raise typer.Exit(1)


def _rows(dataset: Dataset, chosen: Split) -> dict[str, dict[str, Any]]:
    from punnet.scene import CLASSES

    rows: dict[str, dict[str, Any]] = {}
    for name, part in chosen.parts.items():
        berries = [a for i in part for a in dataset[i].annotations if not a.crowd]
        rows[name] = {"images": len(part), "groups": len({chosen.groups[i] for i in part})}
        rows[name] |= {label: sum(a.class_index == k for a in berries) for k, label in enumerate(CLASSES)}
    return rows
