"""``punnet demos simulate``: demonstrations in the simulator, and the movement primitive that they teach."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from punnet.cli.console import counted_progress, note, print_json, say
from punnet.cli.options import Force, Json, Seed

__all__ = ["SceneName", "Spread", "simulate"]


class SceneName(StrEnum):
    """What stands before the arm."""

    SINGLE = "single"
    MULTI = "multi"


class Spread(StrEnum):
    """How much reaches to the same berry differ."""

    REACH = "reach"
    THESIS = "thesis"
    EXPLORING = "exploring"


def simulate(
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for photographs and reaches.", show_default=False),
    ] = None,
    configs: Annotated[int, typer.Option("--configs", min=1, help="Target berries.")] = 25,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Reaches to each of them.")] = 10,
    scene: Annotated[
        SceneName,
        typer.Option("--scene", help="One ripe berry a plant, or several of which each is a target."),
    ] = SceneName.SINGLE,
    spread: Annotated[
        Spread,
        typer.Option(
            "--spread",
            help="How repeats differ: as in the 75 real reaches, as in the thesis' 25, or using all of the arm.",
        ),
    ] = Spread.REACH,
    seed: Seed = 0,
    workers: Annotated[
        int, typer.Option("--workers", "-j", min=1, help="Processes that work at a time.")
    ] = 1,
    bundle: Annotated[
        Path | None,
        typer.Option(
            "--bundle",
            help="In place of --out: learn a movement primitive for the planner promp-depth from reaches alone.",
            show_default=False,
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Simulate reaches to berries by the thesis' protocol (section 6.1).

    Each episode: the photograph from home with depth, the target's box, joints and poses. Started again, it goes on where
    it was.
    """
    if (out is None) == (bundle is None):
        raise typer.BadParameter("give either --out FOLDER or --bundle FOLDER")
    if bundle is not None:
        from punnet.sim.reach_bundle import build_reach_bundle

        build_reach_bundle(bundle, configurations=configs, repeats=repeats, seed=seed, force=force)
        say(f"wrote {bundle}; use it with ProMPDepthPlanner.from_bundle('{bundle}')")
        return
    assert out is not None
    _simulate(out, configs, repeats, scene, spread, seed, workers, force=force, as_json=as_json)


def _simulate(
    out: Path,
    configs: int,
    repeats: int,
    scene: SceneName,
    spread: Spread,
    seed: int,
    workers: int,
    *,
    force: bool,
    as_json: bool,
) -> None:
    import time

    from punnet.sim.demonstrations_factory import simulate_demonstration_set

    started = time.monotonic()
    with counted_progress("episodes") as show:
        report = simulate_demonstration_set(
            out,
            configurations=configs,
            repeats=repeats,
            seed=seed,
            scene=scene.value,
            spread=spread.value,
            workers=workers,
            force=force,
            progress=lambda done: show(done, configs * repeats),
        )
    seconds = time.monotonic() - started
    if as_json:
        print_json(
            {
                "folder": str(out),
                "episodes": report.episodes,
                "targets": report.targets,
                "plants": report.plants,
                "made": report.made,
                "kept": report.kept,
                "megabytes": round(report.megabytes, 2),
                "seconds": round(seconds, 2),
            }
        )
        return
    if report.kept:
        note(f"{report.kept} episodes of an earlier run were kept")
    say(
        f"wrote {out}: {report.episodes} episodes of {report.targets} targets on {report.plants} plants, "
        f"{report.megabytes:.0f} MB in {seconds:.0f} s"
    )
