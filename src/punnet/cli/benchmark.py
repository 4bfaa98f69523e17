"""``punnet benchmark``: many unseen plants, counted by the simulator's truth; and punnets packed with a weigher's errors."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from punnet.cli.benchmark_packing import packing
from punnet.cli.console import note, print_json, print_table, progress_bar
from punnet.cli.eyes import perception_in_simulation
from punnet.cli.options import DetectorName, Json, Oracle, Seed

__all__ = ["register"]

INTERRUPTED = 130


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Measure how well it picks.", no_args_is_help=True)
    group.command("harvest", epilog="Example: punnet benchmark harvest --clusters 20 --seed 1 --workers 2")(
        harvest
    )
    group.command(
        "packing", epilog="Example: punnet benchmark packing weighed-berries.csv --out packing.png"
    )(packing)
    app.add_typer(group, name="benchmark")


def harvest(
    clusters: Annotated[int, typer.Option("--clusters", min=1, help="How many plants to harvest.")] = 20,
    seed: Seed = 0,
    workers: Annotated[int, typer.Option("--workers", min=1, help="Processes side by side.")] = 2,
    detector: DetectorName = None,
    oracle: Oracle = False,
    as_json: Json = False,
) -> None:
    """Harvest unseen plants: success over reachable ripe berries, wrong picks, damage, seconds, reasons.

    The same seed gives the same plants, whatever the number of workers. Interrupted, it prints the figures of
    the plants that are done.
    """
    from punnet.harvest.benchmark import BenchmarkResult, ClusterResult, run_benchmark

    perception = perception_in_simulation(detector, oracle=oracle)
    done: list[ClusterResult] = []
    with progress_bar("harvesting", clusters) as advance:

        def count(cluster: ClusterResult) -> None:
            done.append(cluster)
            advance()

        try:
            run_benchmark(clusters, seed, workers=workers, perception=perception, progress=count)
        except KeyboardInterrupt:
            if not done:
                raise
    figures = BenchmarkResult(perception, seed, tuple(done)).to_json()
    if as_json:
        print_json(figures)
    else:
        _print(figures)
    if figures["errors"]:
        for cluster_seed, error in figures["errors"].items():
            note(f"cluster of seed {cluster_seed} could not be run: {error}")
        raise typer.Exit(1)
    if len(done) < clusters:
        note(f"interrupted; these are the figures of the {len(done)} of {clusters} plants that were finished")
        raise typer.Exit(INTERRUPTED)


def _print(figures: dict[str, Any]) -> None:
    def share(name: str) -> str:
        value = figures[name]
        if value["share"] is None:
            return "none"
        low, high = (100 * bound for bound in value["interval_95"])
        return f"{100 * value['share']:.1f}%  ({value['hits']} of {value['of']}; 95%: {low:.1f}…{high:.1f}%)"

    rows = [
        ("picked, of reachable ripe berries", share("success")),
        ("wrong picks, of berries that came off", share("wrong_picks")),
        ("damaged, of berries that came off", share("damaged")),
        ("unripe berries run into", share("unripe_touched")),
        ("seconds a pick, robot's clock", str(figures["seconds_a_pick"])),
        ("seconds a pick, computing", str(figures["computing_seconds_a_pick"])),
        ("ripe berries, reachable / all", f"{figures['reachable_pluckable']} / {figures['pluckable']}"),
    ]
    title = f"{figures['clusters']} plants, seed {figures['seed']}, perception: {figures['perception']}"
    print_table(title, ("", ""), rows)
    reasons = [(reason, str(count)) for reason, count in figures["failure_reasons"].items()]
    if reasons:
        print_table("why not", ("reason", "times>"), reasons)
