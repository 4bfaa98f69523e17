"""Harvest the demo's kind of plants with one setting of the loop changed, and count by the simulator's truth.

    python benchmarks/harvest_settings.py --plants 10 --seed 77
    python benchmarks/harvest_settings.py --plants 10 --seed 77 --set look_on_the_way=0

``--set`` takes any number of :class:`punnet.harvest.HarvestConfig`. ``punnet benchmark harvest`` does suites; this is for
what is not an option of the command.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from typing import Any

from punnet.harvest.attempts import Outcome
from punnet.harvest.benchmark import plant_seed
from punnet.harvest.config import HarvestConfig
from punnet.harvest.scenario import Scenario, Session
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.sim.world import WorldConfig


def harvest(seed: int, perception: str, config: HarvestConfig) -> tuple[Counter[str], Counter[str], float]:
    """Harvest a plant: counts of berries, reasons of failed attempts, and simulated seconds."""
    with Session(Scenario(seed, perception, WorldConfig(arm_visuals=False), config)) as session:
        run = session.run()
        fates = session.fates()
    counts = Counter(
        reachable_ripe=sum(fate.pluckable and fate.reachable for fate in fates),
        picked=sum(fate.success for fate in fates),
        wrong=sum(fate.wrongly_picked for fate in fates),
        came_off=sum(fate.detached for fate in fates),
        damaged=sum(fate.damaged and fate.detached for fate in fates),
        unripe=sum(not fate.pluckable for fate in fates),
        unripe_run_into=sum(fate.collided and not fate.pluckable for fate in fates),
        attempts=len(run.attempts),
        in_punnets=len(run.picked),
    )
    reasons = Counter(
        f"{attempt.phase}: {(attempt.reason or '').partition(':')[0]}"
        for attempt in run.attempts
        if attempt.outcome is not Outcome.PICKED
    )
    return counts, reasons, run.seconds_simulated


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--perception", default=SIMULATION_DETECTOR, help="a detector, or oracle")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=NUMBER", help="a setting; may be repeated"
    )
    arguments = parser.parse_args()
    changes: dict[str, Any] = {
        name: json.loads(value) for name, value in (s.split("=") for s in arguments.set)
    }
    config = HarvestConfig(**changes)
    counts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    seconds = 0.0
    for number in range(arguments.plants):
        more, why, took = harvest(plant_seed(arguments.seed, number), arguments.perception, config)
        counts, reasons, seconds = counts + more, reasons + why, seconds + took
    print(
        json.dumps({**counts, "seconds_a_pick": seconds / counts["in_punnets"], "failed": reasons}, indent=2)
    )


if __name__ == "__main__":
    main()
