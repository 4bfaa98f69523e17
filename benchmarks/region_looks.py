"""Looks on the way of simulated harvests: what the network sees in the part that matters, beside the whole frame.

    OMP_NUM_THREADS=1 python benchmarks/region_looks.py --suite clustered --suite occluded --plants 4 --seed 505

Plants are harvested as by `punnet benchmark harvest`; at every look on the way the berry that is reached for is looked for in
the whole frame too, and points and processor seconds are compared.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from punnet.harvest.benchmark import plant_seed
from punnet.harvest.eyes import region_around
from punnet.harvest.picking import Reach
from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.suites import SUITES
from punnet.perception import load_detector
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.perception.picking_points import locate_picking_points
from punnet.scene import Frame, Strawberries
from punnet.sim.world import WorldConfig

SAME_BERRY = 0.025


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--suite", action="append", choices=sorted(SUITES), required=True)
    parser.add_argument("--plants", type=int, default=4)
    parser.add_argument("--seed", type=int, default=505)
    arguments = parser.parse_args()
    for suite in arguments.suite:
        report(suite, looks_on_the_way(suite, arguments.seed, arguments.plants))


def looks_on_the_way(suite: str, seed: int, plants: int) -> list[tuple[Frame, NDArray[np.float64]]]:
    """Frames, and the point (3,) that each was taken for."""
    looks: list[tuple[Frame, NDArray[np.float64]]] = []
    shift = Reach._shift

    def noted(reach: Reach, attempt, tries):
        eyes = reach._parts.eyes
        look = eyes.look

        def looking() -> Frame:
            frame = look()
            looks.append((frame, attempt.picking_point.copy()))
            return frame

        eyes.look = looking
        try:
            return shift(reach, attempt, tries)
        finally:
            del eyes.look

    Reach._shift = noted
    try:
        for number in track(range(plants), description=suite):
            world = WorldConfig(arm_visuals=False)
            with Session(
                Scenario(plant_seed(seed, number), SIMULATION_DETECTOR, world, suite=suite)
            ) as session:
                session.run()
    finally:
        Reach._shift = shift
    return looks


def report(suite: str, looks: list[tuple[Frame, NDArray[np.float64]]]) -> None:
    """Print how far apart the points are, how often only one look shows the berry, and how long both take."""
    detector = load_detector(SIMULATION_DETECTOR)
    apart, one_only, seconds = [], 0, np.zeros(2)
    for frame, point in looks:
        region = region_around(frame, point)
        found = []
        for which in range(2):
            begin = time.process_time()
            berries = detector.detect(frame) if which or region is None else detector.detect_in(frame, region)
            seconds[which] += time.process_time() - begin
            found.append(nearest(locate_picking_points(frame, berries), point))
        one_only += (found[0] is None) != (found[1] is None)
        if found[0] is not None and found[1] is not None:
            apart.append(1000 * float(np.linalg.norm(found[0] - found[1])))
    print(
        f"{suite}: {len(looks)} looks on the way, {one_only} show the berry in the region or in the whole frame only; "
        f"points {np.median(apart):.2f} mm apart in the median, {max(apart):.2f} at most; "
        f"{seconds[0] / seconds[1]:.2f} of the processor time"
    )


def nearest(berries: Strawberries, point: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The pluckable berry's point (3,) next to ``point``, None if none is within 25 mm."""
    points = berries.picking_points[berries.pluckable]
    distances = np.nan_to_num(np.linalg.norm(points - point, axis=1), nan=np.inf)
    return points[int(np.argmin(distances))] if len(points) and distances.min() < SAME_BERRY else None


if __name__ == "__main__":
    main()
