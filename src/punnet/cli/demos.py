"""``punnet demos``: demonstrated reaches, made, converted, checked, counted and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import busy, note, print_json, print_table, say
from punnet.cli.demos_convert import convert
from punnet.cli.demos_options import DemoFormatName, DemoPath
from punnet.cli.demos_simulate import simulate
from punnet.cli.demos_validate import validate
from punnet.cli.options import Json

if TYPE_CHECKING:
    from punnet.data.demos import DemonstrationSet
    from punnet.data.demos.statistics import DemoStatistics

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Demonstrated reaches: make, convert, check, count, draw.", no_args_is_help=True)
    group.command(
        "simulate", epilog="Example: punnet demos simulate --configs 25 --repeats 10 --out demos --workers 2"
    )(simulate)
    group.command("convert", epilog="Example: punnet demos convert recordings --to lerobot --out dataset")(
        convert
    )
    group.command("validate", epilog="Example: punnet demos validate recordings --json")(validate)
    group.command("stats", epilog="Example: punnet demos stats demos")(stats)
    group.command("plot", epilog="Example: punnet demos plot demos --out demos.png")(plot)
    app.add_typer(group, name="demos")


def stats(path: DemoPath, data_format: DemoFormatName = None, as_json: Json = False) -> None:
    """Count demonstrations: targets, durations, how far each joint goes, how much repeats differ.

    What can't be read is left out, said so, and makes the exit code 1.
    """
    from punnet.data.demos.statistics import demonstration_statistics

    demonstrations, left_out = _read(path, data_format)
    told = demonstration_statistics(demonstrations)
    if as_json:
        print_json(told.to_json() | {"left_out": left_out})
    else:
        _print_statistics(told)
    if left_out:
        raise typer.Exit(1)


def plot(
    path: DemoPath,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The figure: PNG, SVG or PDF.", show_default=False)
    ],
    data_format: DemoFormatName = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the figure.")] = False,
) -> None:
    """Draw demonstrations: each coordinate over time, the paths, the first photograph with its targets.

    What can't be read is left out, said so, and makes the exit code 1.
    """
    from punnet.data.demos.plot import draw_demonstrations

    demonstrations, left_out = _read(path, data_format)
    with busy("drawing"):
        draw_demonstrations(demonstrations, out, force=force)
    say(f"wrote {out}")
    if left_out:
        raise typer.Exit(1)


def _read(path: Path, data_format: str | None) -> tuple[DemonstrationSet, list[str]]:
    from punnet.data.demos import read_readable_demos

    with busy("reading"):
        reading = read_readable_demos(path, data_format)
    left_out = [str(fault) for fault in reading.left_out]
    for message in left_out:
        note(f"left out: {message}")
    return reading.demonstrations(), left_out


def _print_statistics(told: DemoStatistics) -> None:
    data = told.to_json()
    rows = [(name, str(data[name])) for name in ("episodes", "targets", "groups", "photographs", "samples")]
    for name in ("seconds", "samples_per_second"):
        if data[name] is not None:
            least, median, most = (f"{data[name][level]:.4g}" for level in ("least", "median", "most"))
            rows.append((name.replace("_", " "), f"{median} ({least} … {most})"))
    print_table(told.name, ("", "count>"), rows)
    for space in told.spaces:
        unit = "rad" if space.space == "joint" else "m, quaternion"
        print_table(
            f"{space.space} space ({unit})",
            ("", "lowest>", "highest>", "spread of repeats at the end>"),
            [
                (name, f"{low:.3f}", f"{high:.3f}", "–" if spread != spread else f"{spread:.3f}")
                for name, low, high, spread in zip(
                    space.names, space.lowest, space.highest, space.spread, strict=True
                )
            ],
        )
