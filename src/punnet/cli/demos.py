"""``punnet demos simulate``: demonstrations, and the movement primitive that they teach."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from punnet.cli.console import say
from punnet.cli.options import Force, Seed

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Demonstrated reaches.", no_args_is_help=True)
    group.callback()(lambda: None)  # keeps the one command a command of the group
    group.command(
        "simulate",
        epilog="Example: punnet demos simulate --configs 25 --repeats 10 --seed 0 --bundle my-reach",
    )(simulate)
    app.add_typer(group, name="demos")


def simulate(
    bundle: Annotated[
        Path,
        typer.Option("--bundle", help="Folder for the bundle that is learnt from them.", show_default=False),
    ],
    configs: Annotated[int, typer.Option("--configs", min=3, help="Places that a berry hangs in.")] = 25,
    repeats: Annotated[int, typer.Option("--repeats", min=2, help="Reaches to each of them.")] = 10,
    seed: Seed = 0,
    force: Force = False,
) -> None:
    """Simulate reaches to berries by the thesis' protocol (section 6.1) and fit a movement primitive to them."""
    from punnet.sim.reach_bundle import build_reach_bundle

    build_reach_bundle(bundle, configurations=configs, repeats=repeats, seed=seed, force=force)
    say(f"wrote {bundle}; use it with ProMPDepthPlanner.from_bundle('{bundle}')")
