"""``punnet benchmark packing``: what a weigher's errors cost in the punnets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import print_json, print_table, say, whisper
from punnet.cli.options import Json, Seed
from punnet.errors import OutputExistsError

if TYPE_CHECKING:
    from punnet.weight.packing.comparison import Setting

__all__ = ["packing"]


def packing(
    errors: Annotated[
        Path,
        typer.Argument(
            help="CSV or JSON of weighed berries: true_g, estimate_g, low_g, high_g.",
            show_default=False,
        ),
    ],
    nominal: Annotated[float, typer.Option("--nominal", help="Grams on the label.")] = 250.0,
    most_berries: Annotated[int, typer.Option("--most-berries", min=1, help="That fit in a punnet.")] = 18,
    places: Annotated[int, typer.Option("--open", min=1, help="Punnets open at a time.")] = 4,
    cell_error: Annotated[
        float, typer.Option("--cell-error", min=0.0, help="Standard deviation of a weigh cell, grams.")
    ] = 0.5,
    batches: Annotated[int, typer.Option("--batches", min=1, help="Batches, each judged by itself.")] = 20,
    berries: Annotated[int, typer.Option("--berries", min=1, help="Berries in a batch.")] = 1_000,
    weights: Annotated[
        Path | None,
        typer.Option(
            "--weights", help="CSV with a column weight: your field's berries, grams.", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Picture to write, PNG.", show_default=False)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the picture if it exists.")] = False,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Pack berries into punnets with a weigher's real errors: giveaway and the average-quantity rule, beside baselines.

    The table and the picture hold the look-ahead packer, first-fit and filling by count, with weigh cells and without.
    """
    from punnet.outputs import require_suffix, write_bytes
    from punnet.weight.packing import PackingConfig
    from punnet.weight.packing.batches import read_errors, read_weights
    from punnet.weight.packing.comparison import compare

    if out is not None:
        require_suffix(out, ".png")
        if out.exists() and not force:
            raise OutputExistsError(f"{out}: exists; give another name or --force")
    comparison = compare(
        read_errors(errors),
        PackingConfig(nominal=nominal, most_berries=most_berries, cell_error=cell_error),
        batches=batches,
        berries=berries,
        places=places,
        seed=seed,
        weights=None if weights is None else read_weights(weights),
        progress=lambda name: whisper(f"packed: {name}"),
    )
    if out is not None:
        from punnet.weight.packing.figure import draw_comparison

        write_bytes(out, draw_comparison(comparison), force=force)
    if as_json:
        print_json(comparison.to_json())
        return
    for setting in comparison.settings:
        _print(setting)
    if out is not None:
        say(f"look at {out}")


def _print(setting: Setting) -> None:
    def share(value: float | None) -> str:
        return "–" if value is None else f"{100 * value:.2f}%"

    rows = []
    for result in setting.results:
        figures = result.to_json()
        rows.append(
            (
                figures["policy"],
                share(figures["giveaway"]),
                share(figures["giveaway_of_worst_batch"]),
                "–"
                if figures["standard_deviation_g"] is None
                else f"{figures['standard_deviation_g']:.1f} g",
                f"{figures['batches_passed']} of {figures['batches']}",
                share(figures["rejected"]),
                share(figures["handled_again"]),
            )
        )
    met = "met" if setting.meets_bar else "not met"
    columns = ("", "giveaway>", "worst batch>", "spread>", "batches pass>", "rejected>", "handled again>")
    print_table(f"{setting.name} (bar of 2% with all batches passing: {met})", columns, rows)
