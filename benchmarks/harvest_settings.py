"""Harvest plants with one setting of the loop changed, count by the simulator's truth, and tell what the tool ran into.

    python benchmarks/harvest_settings.py --plants 10 --seed 77
    python benchmarks/harvest_settings.py --plants 10 --seed 77 --set look_on_the_way=0
    python benchmarks/harvest_settings.py --plants 10 --seed 501 --suite clustered --choice collision-aware

``--set`` takes any number of :class:`punnet.harvest.HarvestConfig`. ``punnet benchmark harvest`` does suites too; this is for
what is not an option of the command, and for which part of the tool met a fruit first, and when. Without ``--suite`` plants
are of the demo's kind.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from punnet.harvest.attempts import Attempt, Outcome
from punnet.harvest.benchmark import plant_seed
from punnet.harvest.config import HarvestConfig
from punnet.harvest.judge import TOUCH_FORCE, Fate
from punnet.harvest.scenario import Scenario, Session
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.sim.contacts import BRUISING_FORCE
from punnet.sim.world import World, WorldConfig

ACTIONS = ("look", "follow", "separate", "grip", "cut", "release", "weigh_punnet")


class FirstContacts:
    """Which part of the tool first pressed each fruit with more than a touch or bruised it, in what phase and action."""

    def __init__(self) -> None:
        self.doing, self.phase, self.action = 0, "home", "home"
        self.touched: dict[int, str] = {}
        self.bruised: dict[int, str] = {}

    def attach(self, session: Session) -> None:
        """Note what the robot is told to do, and look at every step of the world."""
        robot = session.robot
        for name in ACTIONS:
            setattr(robot, name, self._named(name, getattr(robot, name)))
        robot.observers.append(self._step)

    def listen(self, line: str, attempt: Attempt | None) -> None:
        """Take a step of the loop in."""
        phase = "home" if attempt is None else str(attempt.phase)
        if phase != self.phase:
            self.phase, self.doing = phase, 0

    def _named(self, name: str, call: Any) -> Any:
        def called(*arguments: Any, **options: Any) -> Any:
            self.doing += 1
            self.action = f"{self.phase} {self.doing} {name}"
            return call(*arguments, **options)

        return called

    def _step(self, world: World) -> None:
        monitor = world.contacts
        for limit, peaks, known in (
            (TOUCH_FORCE, monitor.tool_peak_on_berry, self.touched),
            (BRUISING_FORCE, monitor.peak_on_berry, self.bruised),
        ):
            for berry in np.flatnonzero(peaks > limit):
                if int(berry) not in known:
                    known[int(berry)] = f"{self.action}: {_part(world, int(berry))}"


def _part(world: World, berry: int) -> str:
    """What presses a berry most: a geometry's name, or its body's."""
    model, data = world.model, world.data
    fruit = model.geom(world.planted[berry].fruit).id
    strongest, name = 0.0, "unknown"
    force = np.zeros(6)
    for number in range(data.ncon):
        pair = data.contact.geom[number]
        if fruit in pair:
            mujoco.mj_contactForce(model, data, number, force)
            if force[0] > strongest:
                other = model.geom(int(pair[0] if pair[1] == fruit else pair[1]))
                strongest, name = float(force[0]), other.name or model.body(int(other.bodyid[0])).name
    return name.rsplit("_", 1)[0] if name.endswith(("left", "right")) else name


def harvest(scenario: Scenario) -> tuple[Counter[str], dict[str, Counter[str]], float]:
    """Harvest a plant: counts of berries, tables of reasons and contacts, and simulated seconds."""
    contacts = FirstContacts()
    with Session(scenario, contacts.listen) as session:
        contacts.attach(session)
        run = session.run()
        fates = session.fates()
    tables = {
        "failed": Counter(
            f"{attempt.phase}: {(attempt.reason or '').partition(':')[0]}"
            for attempt in run.attempts
            if attempt.outcome is not Outcome.PICKED
        ),
        "ran_into_when": Counter(
            contacts.touched[fate.index] for fate in fates if fate.collided and not fate.pluckable
        ),
        "damaged_when": Counter(
            contacts.bruised[fate.index] for fate in fates if fate.damaged and fate.detached
        ),
    }
    return counted(fates, len(run.attempts), len(run.picked)), tables, run.seconds_simulated


def counted(fates: list[Fate], attempts: int, in_punnets: int) -> Counter[str]:
    """What became of the berries."""
    return Counter(
        reachable_ripe=sum(fate.pluckable and fate.reachable for fate in fates),
        picked=sum(fate.success for fate in fates),
        wrong=sum(fate.wrongly_picked for fate in fates),
        came_off=sum(fate.detached for fate in fates),
        damaged=sum(fate.damaged and fate.detached for fate in fates),
        unripe=sum(not fate.pluckable for fate in fates),
        unripe_run_into=sum(fate.collided and not fate.pluckable for fate in fates),
        attempts=attempts,
        in_punnets=in_punnets,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="number of the first plant")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--suite", help="of the benchmark; without it the demo's kind of plants")
    parser.add_argument("--perception", default=SIMULATION_DETECTOR, help="a detector, or oracle")
    parser.add_argument("--choice", help="mean, clearest or collision-aware")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=NUMBER", help="a setting; may be repeated"
    )
    arguments = parser.parse_args()
    changes: dict[str, Any] = {
        name: json.loads(value) for name, value in (s.split("=") for s in arguments.set)
    }
    base = Scenario(
        0,
        arguments.perception,
        WorldConfig(arm_visuals=False),
        HarvestConfig(**changes),
        suite=arguments.suite,
        **({"choice": arguments.choice} if arguments.choice else {}),
    )
    counts: Counter[str] = Counter()
    tables: dict[str, Counter[str]] = {}
    seconds = 0.0
    for number in range(arguments.first, arguments.first + arguments.plants):
        more, found, took = harvest(replace(base, seed=plant_seed(arguments.seed, number)))
        counts, seconds = counts + more, seconds + took
        tables = {name: tables.get(name, Counter()) + table for name, table in found.items()}
        print(number, dict(more), {name: dict(table) for name, table in found.items()}, file=sys.stderr)
    tables_sorted = {name: dict(table.most_common()) for name, table in tables.items()}
    print(json.dumps({**counts, "seconds_a_pick": seconds / counts["in_punnets"], **tables_sorted}, indent=2))


if __name__ == "__main__":
    main()
