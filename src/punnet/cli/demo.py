"""``punnet demo`` and ``punnet harvest``: a simulated plant, harvested before your eyes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from punnet.cli.console import note, print_json, say, whisper
from punnet.cli.eyes import perception_in_simulation
from punnet.cli.harvest_progress import harvest_progress
from punnet.cli.options import (
    ArmName,
    DetectorName,
    Force,
    Json,
    Oracle,
    OutFolder,
    PlannerBundle,
    PlannerName,
    Seed,
)
from punnet.errors import ConfigurationError

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
    report = _harvest({"seed": seed, "perception": perception_in_simulation(detector)}, out, force=force)
    _tell(report, out)


def harvest(
    out: OutFolder,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of everything random.", show_default="0")
    ] = None,
    detector: DetectorName = None,
    oracle: Oracle = False,
    suite: Annotated[
        str | None,
        typer.Option(
            "--suite", help="Kind of plant: easy, thesis, clustered, occluded or night.", show_default=False
        ),
    ] = None,
    planner: PlannerName = None,
    planner_bundle: PlannerBundle = None,
    choice: Annotated[
        str | None,
        typer.Option(
            "--choice",
            help="Which reach of a planner's: mean, clearest or collision-aware (default).",
            show_default=False,
        ),
    ] = None,
    pick: Annotated[
        int | None,
        typer.Option(
            "--pick",
            min=1,
            help="Harvest up to this attempt; report and film are of it alone.",
            show_default=False,
        ),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            help="simulated, or dry-run: nothing moves, each motion is written as a JointTrajectory file.",
        ),
    ] = "simulated",
    arm: ArmName = "panda",
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Go on with a harvest that was killed or interrupted in this folder."),
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Harvest the plant of a seed in the simulator; like demo, for any plant, and for machines to read.

    A pick that failed is looked at alone with --pick: the same seed harvests the same way.

    What is done is on the disk at once (harvest.jsonl): after a kill, --resume goes on with the berry that was in
    flight, and no berry counts twice.
    """
    if robot not in ("simulated", "dry-run"):
        raise ConfigurationError(f"--robot: there is no '{robot}'; there are simulated and dry-run")
    dry = robot == "dry-run"
    if dry and (pick or resume):
        raise ConfigurationError("--robot dry-run writes files and has no attempts to look at or go on with")
    if resume:
        from punnet.harvest.folder import options_of

        given = (detector, oracle, suite, planner, planner_bundle, choice, pick, arm != "panda", force)
        if seed is not None or any(given):
            raise ConfigurationError("--resume takes all options from the log; leave the others out")
        options = options_of(out)
    else:
        options = {"seed": seed or 0, "perception": perception_in_simulation(detector, oracle=oracle)}
        others = {
            "suite": suite,
            "planner": planner,
            "planner_bundle": planner_bundle,
            "choice": choice,
            "pick": pick,
            "arm": None if arm == "panda" else arm,
        }
        options |= {name: value for name, value in others.items() if value}
    if dry:
        _rehearse(options, out, force=force, as_json=as_json)
        return
    report = _harvest(options, out, force=force, resume=resume)
    if as_json:
        print_json({"out": str(out), **report.to_json()})
    else:
        _tell(report, out)
    if report.ripe and not report.picked and "pick" not in options:
        raise typer.Exit(1)


def _harvest(options: dict[str, Any], out: Path, *, force: bool = False, resume: bool = False) -> Any:
    """Harvest what ``options``, which the log keeps, say; anew, or on from where the log ends."""
    from punnet.harvest.config import HarvestConfig
    from punnet.harvest.folder import HarvestFolder
    from punnet.harvest.picks_table import PARQUET_EXTRA, parquet_is_there
    from punnet.harvest.scenario import Scenario
    from punnet.harvest.session_folder import harvest_into

    plant = {name: value for name, value in options.items() if name != "pick"}
    with HarvestFolder(out, force=force, resume=resume) as output:
        whisper(f"growing the plant of seed {options['seed']}")
        with harvest_progress(HarvestConfig().nominal_punnet) as announcer:
            report = harvest_into(output, Scenario(**plant), announcer, options, options.get("pick"))
    if not parquet_is_there():
        note(
            f"picks.parquet was not written, it needs pyarrow: {PARQUET_EXTRA}; harvest.jsonl has the same rows"
        )
    return report


def _rehearse(options: dict[str, Any], out: Path, *, force: bool, as_json: bool) -> None:
    """The harvest that ``options`` say, as files."""
    import json

    from punnet.harvest.rehearsal import rehearse
    from punnet.harvest.scenario import Scenario
    from punnet.outputs import OutputFolder, write_text

    with OutputFolder(out, force=force) as output:
        whisper(f"growing the plant of seed {options['seed']}")
        rehearsal = rehearse(Scenario(**options), output.path, lambda line, attempt: whisper(line))
        told = rehearsal.to_json()
        write_text(
            output.path / "harvest.json",
            json.dumps({"options": options, **told}, indent=2) + "\n",
        )
    if as_json:
        print_json({"out": str(out), **told})
        return
    say(
        f"{len(rehearsal.trajectories)} motions for {len(told['berries'])} berries, {rehearsal.seconds:.0f} s:"
    )
    for number, berry in enumerate(told["berries"], 1):
        place = ", ".join(f"{value:.3f}" for value in berry["picking_point"])
        fate = f"to punnet {berry['punnet']}" if berry["punnet"] else f"not; {berry['reason']}"
        say(f"  berry {number} at ({place}) m, {berry['estimate_g']:.1f} g: {fate}")
    say(f"look at {out / 'actions.jsonl'} and the trajectories beside it; nothing has moved")


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
