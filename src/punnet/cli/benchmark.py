"""``punnet benchmark``: many unseen plants, counted by the simulator's truth; and punnets packed with a weigher's errors."""

from __future__ import annotations

import typer

from punnet.cli.benchmark_harvest import harvest
from punnet.cli.benchmark_packing import packing
from punnet.cli.benchmark_table import compare, table

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Measure how well it picks.", no_args_is_help=True)
    group.command(
        "harvest",
        epilog="Example: punnet benchmark harvest --suite clustered --clusters 20 --seed 1 --workers 2",
    )(harvest)
    group.command(
        "table", epilog="Example: punnet benchmark table --clusters 20 --seed 1 --workers 2 --out table"
    )(table)
    group.command(
        "compare", epilog="Example: punnet benchmark compare easy-colour easy-default --out outcomes.png"
    )(compare)
    group.command(
        "packing", epilog="Example: punnet benchmark packing weighed-berries.csv --out packing.png"
    )(packing)
    app.add_typer(group, name="benchmark")
