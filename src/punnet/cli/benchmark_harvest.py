"""``punnet benchmark harvest``: a suite of unseen plants."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from punnet.cli.console import note, print_json, print_table, progress_bar, say
from punnet.cli.eyes import perception_in_simulation
from punnet.cli.options import DetectorName, Json, Oracle, PlannerBundle, PlannerName, Seed

__all__ = [
    "INTERRUPTED",
    "Backend",
    "Clusters",
    "Workers",
    "harvest",
    "tell_errors",
]

INTERRUPTED = 130
Clusters = Annotated[int, typer.Option("--clusters", min=1, help="How many plants to harvest.")]
Workers = Annotated[int, typer.Option("--workers", "-j", min=1, help="Processes side by side.")]
Backend = Annotated[
    str, typer.Option("--backend", help="loky: this machine's cores; ray: the machines of a Ray cluster.")
]


def harvest(
    suite: Annotated[
        str,
        typer.Option("--suite", help="Kind of plants: easy, thesis, clustered, occluded or night."),
    ] = "easy",
    clusters: Clusters = 20,
    seed: Seed = 0,
    workers: Workers = 2,
    backend: Backend = "loky",
    detector: DetectorName = None,
    oracle: Oracle = False,
    planner: PlannerName = None,
    planner_bundle: PlannerBundle = None,
    choice: Annotated[
        str | None,
        typer.Option(
            "--choice",
            help="Which reach of the planner's to take: mean, clearest or collision-aware.",
            show_default=False,
        ),
    ] = None,
    order: Annotated[
        str | None,
        typer.Option(
            "--order",
            help="Which berry comes next: cheapest, front-first, nearest-first or left-to-right.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder that keeps every plant as it is done, the figures and their picture; goes on where it was.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Begin the folder anew.")] = False,
    as_json: Json = False,
) -> None:
    """Harvest a suite of unseen plants: success, wrong picks, damage, collisions, seconds, errors, and why not.

    The same suite and seed give the same plants, whatever the number of workers. Interrupted, it prints the figures of
    the plants that are done; with --out the same command goes on from there.
    """
    from punnet.harvest.benchmark import BenchmarkResult, BenchmarkSettings, run_benchmark
    from punnet.harvest.benchmark_plants import PlantResult
    from punnet.harvest.order import DEFAULT_ORDER
    from punnet.planning.choice import DEFAULT_CHOICE
    from punnet.planning.named import DEFAULT_PLANNER

    perception = perception_in_simulation(detector, oracle=oracle)
    settings = BenchmarkSettings(
        suite,
        seed,
        perception,
        choice or DEFAULT_CHOICE,
        order or DEFAULT_ORDER,
        planner or DEFAULT_PLANNER,
        planner_bundle,
    )
    done: list[PlantResult] = []
    with progress_bar("harvesting", clusters) as advance:

        def count(plant: PlantResult) -> None:
            done.append(plant)
            advance()

        try:
            run_benchmark(
                settings, clusters, workers=workers, backend=backend, folder=out, force=force, progress=count
            )
        except KeyboardInterrupt:
            if not done:
                raise
    ordered = sorted(done, key=lambda plant: plant.number)
    figures = BenchmarkResult(settings, tuple(ordered)).to_json()
    if as_json:
        print_json(figures)
    else:
        _print(figures)
        if out is not None and len(done) == clusters:
            say(f"wrote {out}: figures.json, missed.png, a file a plant")
    if tell_errors(figures):
        raise typer.Exit(1)
    if len(done) < clusters:
        note(f"interrupted; these are the figures of the {len(done)} of {clusters} plants that were finished")
        raise typer.Exit(INTERRUPTED)


def tell_errors(figures: dict[str, Any]) -> bool:
    """Say on stderr which plants of a run were not finished; whether there are any."""
    for plant_seed, error in figures["errors"].items():
        note(f"the plant of seed {plant_seed} was not finished: {error}")
    return bool(figures["errors"])


def _percent(share: dict[str, Any]) -> str:
    return "none" if share["share"] is None else f"{100 * share['share']:.1f}"


def _interval(share: dict[str, Any]) -> str:
    low, high = (100 * bound for bound in share["interval_95"])
    return f"{low:.1f}…{high:.1f}"


def _number(value: float | None, unit: str = "") -> str:
    return "none" if value is None else f"{value:.2f}{unit}"


def _share(share: dict[str, Any]) -> str:
    if share["share"] is None:
        return "none"
    return f"{_percent(share)}%  ({share['hits']} of {share['of']}; 95%: {_interval(share)}%)"


def _spread(spread: dict[str, Any], unit: str) -> str:
    if not spread["count"]:
        return "none"
    return f"{spread['median']:.1f} {unit}  (95% within {spread['p95']:.1f}, largest {spread['largest']:.1f})"


def _print(figures: dict[str, Any]) -> None:
    from punnet.harvest.benchmark_picture import row_name

    weight, packing = figures["weight"], figures["packing"]
    rows = [
        ("picked, of reachable ripe berries", _share(figures["success"])),
        ("wrong picks, of berries that came off", _share(figures["wrong_picks"])),
        ("damaged, of berries that came off", _share(figures["damaged"])),
        ("unripe berries run into", _share(figures["unripe_touched"])),
        ("  force on those, median", _spread(figures["unripe_force_n"], "N")),
        ("  in the course of", _counts(figures["collisions_during"])),
        ("seconds a pick, robot's clock", _number(figures["seconds_a_pick"])),
        ("seconds a pick, computing", _number(figures["computing_seconds_a_pick"])),
        ("picking point off when seen, median", _spread(figures["located_error_mm"], "mm")),
        ("tool off the picking point at the cut, median", _spread(figures["cut_error_mm"], "mm")),
        ("weight off, of picked berries", _weight(weight)),
        (f"given away in punnets of {packing['nominal_g']:.0f} g", _packing(packing)),
        ("ripe berries, reachable / all", f"{figures['reachable_pluckable']} / {figures['pluckable']}"),
        ("attempts", str(figures["attempts"])),
    ]
    title = (
        f"suite {figures['suite']}/{figures['suite_version']}: {figures['clusters']} plants, seed {figures['seed']}, "
        f"{row_name(figures)}"
    )
    print_table(title, ("", ""), rows)
    for heading, name in (
        ("berries missed, by the last reason", "missed"),
        ("attempts failed", "failed_attempts"),
    ):
        if figures[name]:
            print_table(heading, ("reason", "times>"), [(why, str(n)) for why, n in figures[name].items()])


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items()) or "none"


def _weight(weight: dict[str, Any]) -> str:
    if not weight["berries"]:
        return "none"
    return (
        f"{100 * weight['mean_error']:.1f}% on average, bias {100 * weight['bias']:+.1f}%; "
        f"within a tenth: {_share(weight['within_10_percent'])}"
    )


def _packing(packing: dict[str, Any]) -> str:
    if packing["giveaway"] is None:
        return "no punnet was filled"
    return (
        f"{100 * packing['giveaway']:.1f}% in {packing['punnets']} punnets, {packing['short']} of them short"
    )
