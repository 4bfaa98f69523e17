"""``punnet demo`` and ``punnet harvest``: a simulated plant, harvested before your eyes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from punnet.cli.console import film_progress, print_json, say, whisper
from punnet.cli.eyes import perception_in_simulation
from punnet.cli.options import DetectorName, Force, Json, Oracle, OutFolder, Seed

__all__ = ["register"]

DEMO_SEED = 18


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command(epilog="Example: punnet demo --out first-harvest")(demo)
    app.command(epilog="Example: punnet harvest --seed 3 --out harvest-3")(harvest)


def demo(
    seed: Seed = DEMO_SEED,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the report, the film and the data.")
    ] = Path("punnet-demo"),
    detector: DetectorName = None,
    force: Force = False,
) -> None:
    """Harvest one plant in the simulator and write a report with a film.

    The folder holds report.html, harvest.mp4, first_view.png, reach.png, harvest.json and the first RGB-D frame.
    """
    report = _harvest(seed, perception_in_simulation(detector), out, force)
    _tell(report, out)


def harvest(
    out: OutFolder,
    seed: Seed = 0,
    detector: DetectorName = None,
    oracle: Oracle = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Harvest the plant of a seed in the simulator; like demo, for any plant, and for machines to read."""
    report = _harvest(seed, perception_in_simulation(detector, oracle=oracle), out, force)
    if as_json:
        print_json({"out": str(out), **report.to_json()})
    else:
        _tell(report, out)
    if report.ripe and not report.picked:
        raise typer.Exit(1)


def _harvest(seed: int, perception: str, out: Path, force: bool) -> Any:
    from punnet.harvest.scenario import Scenario
    from punnet.harvest.session_folder import Announcer, harvest_into
    from punnet.outputs import OutputFolder

    with OutputFolder(out, force=force) as output:
        whisper(f"growing the plant of seed {seed}")
        with film_progress() as film:
            return harvest_into(output, Scenario(seed, perception), Announcer(whisper, film))


def _tell(report: Any, out: Path) -> None:
    """What was picked, what was not and why, and where to look."""
    grams = sum(pick.weighed_g or 0.0 for pick in report.picked)
    say(f"picked {len(report.picked)} of {report.ripe} ripe berries, {grams:.0f} g:")
    for pick in report.picked:
        estimate = "no estimate" if pick.estimate_g is None else f"estimated {pick.estimate_g:.1f} g"
        say(f"  berry {pick.id}: {pick.weighed_g:.1f} g ({estimate}) in punnet {pick.punnet}")
    for pick in report.picks:
        if pick.outcome != "picked":
            say(f"  berry {pick.id}: not picked; {pick.reason}")
    for berry in report.left:
        say(f"  left on the plant ({berry.berry_class}): {berry.reason}")
    say(f"look at {out / 'report.html'} (film: {out / 'harvest.mp4'})")
