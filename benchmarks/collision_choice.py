"""How long the collision-aware choice takes, and how often it finds a clearer reach than the planned one.

    python benchmarks/collision_choice.py --suite clustered --plants 5 --seed 1

For every ripe berry that is seen at the first look at a suite's plants, the planner's reach is planned and 64 are chosen
from; the median and the slowest time of each part, and the cost of the planned and of the chosen reach.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time

import numpy as np

from punnet.errors import PlanningError
from punnet.harvest.benchmark import plant_seed
from punnet.harvest.suites import SUITES, suite_of
from punnet.perception import load_detector
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.perception.picking_points import locate_picking_points
from punnet.planning import ProMPDepthPlanner
from punnet.planning.collision_aware import CollisionAwarePlanner
from punnet.planning.observed_scene import observe
from punnet.robot import HOME
from punnet.scene import Frame, Strawberries, Target
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import WorldConfig, build_world

PARTS = ("observe", "draw", "judge", "condition")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--suite", choices=tuple(SUITES), default="clustered")
    parser.add_argument("--plants", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=64)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    planner = CollisionAwarePlanner(ProMPDepthPlanner.from_bundle(), draws=options.draws)
    rows = []
    for number in range(options.plants):
        frame, berries = first_look(options.suite, plant_seed(options.seed, number))
        for row in np.flatnonzero(berries.pluckable & np.isfinite(berries.picking_points).all(axis=1)):
            target = Target(
                berries.boxes[row], berries.picking_points[row], berry_id=int(berries.ids[row]), among=berries
            )
            tries = [measure(planner, frame, target) for _ in range(3)]
            done = [found for found in tries if found is not None]
            if done:
                rows.append(min(done, key=lambda found: sum(found[0])))
    seconds = np.array([found[0] for found in rows])
    costs = np.array([found[1] for found in rows])
    total = seconds.sum(axis=1)
    result = {
        "suite": suite_of(options.suite).label,
        "targets": len(rows),
        "draws": options.draws,
        "milliseconds_median": dict(
            zip(PARTS, np.round(1e3 * np.median(seconds, axis=0), 2).tolist(), strict=True)
        ),
        "milliseconds_in_all": {
            "median": round(1e3 * float(np.median(total)), 1),
            "p95": round(1e3 * float(np.percentile(total, 95)), 1),
        },
        "clearer_than_planned": round(float((costs[:, 1] < costs[:, 0] - 1e-9).mean()), 3),
        "cost_median": {
            "planned": round(float(np.median(costs[:, 0])), 2),
            "chosen": round(float(np.median(costs[:, 1])), 2),
        },
        "machine": f"{platform.platform()}, {os.cpu_count()} cores, OMP_NUM_THREADS={os.environ.get('OMP_NUM_THREADS', '-')}",
    }
    if options.json:
        print(json.dumps(result, indent=2))
        return
    for name, value in result.items():
        print(f"{name:24s} {value}")


def first_look(suite: str, seed: int) -> tuple[Frame, Strawberries]:
    """What is seen from home of a suite's plant, and what is found in it."""
    world_seed, config = suite_of(suite).plant(seed, WorldConfig(arm_visuals=False))
    robot = SimulatedRobot(
        build_world(world_seed, config), np.random.default_rng((seed, 1)), StereoDepthModel()
    )
    try:
        frame = robot.look()
    finally:
        robot.close()
    berries = load_detector(SIMULATION_DETECTOR).detect(frame)
    if np.isnan(berries.picking_points).all():
        berries = locate_picking_points(frame, berries)
    return frame, berries


def measure(
    planner: CollisionAwarePlanner, frame: Frame, target: Target
) -> tuple[tuple[float, ...], tuple[float, float]] | None:
    """Seconds of each part, and the costs of the planned and the chosen reach; None if there is no plan."""
    try:
        planned = planner.planner.plan(frame, target, HOME)
    except PlanningError:
        return None
    clock = [time.perf_counter()]
    scene = observe(frame, target)
    scene.soft_at(np.zeros((1, 3)))  # the cells are filled when they are first asked for
    clock.append(time.perf_counter())
    candidates = planner.candidates(planned, target, HOME)
    clock.append(time.perf_counter())
    costs = planner.costs(candidates, scene, planned)
    clock.append(time.perf_counter())
    best = int(np.argmin(costs))
    if not np.isfinite(costs[0]) or not np.isfinite(costs[best]):
        return None
    candidates.distribution(best, HOME)
    clock.append(time.perf_counter())
    return tuple(np.diff(clock).tolist()), (float(costs[0]), float(costs[best]))


if __name__ == "__main__":
    main()
