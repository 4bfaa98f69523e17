"""A picture of the harvest benchmark's suites: what the wrist camera sees first of some plants of each.

python benchmarks/harvest_suites.py docs/figures/harvest-suites.jpg --plants 3 --seed 100
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.harvest.suites import SUITES, Suite
from punnet.outputs import write_bytes
from punnet.sim.camera_effects import NIGHT_CAMERA
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import WorldConfig, build_world

SIZE = (400, 300)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--plants", type=int, default=3, help="of each suite")
    parser.add_argument("--seed", type=int, default=100, help="of the first; the others have the next ones")
    parser.add_argument("--force", action="store_true", help="replace the picture if it exists")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.plants)
    rows = [np.hstack([named(suite, first_look(suite, seed)) for seed in seeds]) for suite in SUITES.values()]
    _, encoded = cv2.imencode(".jpg", np.vstack(rows)[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    write_bytes(options.out, encoded.tobytes(), force=options.force)


def first_look(suite: Suite, seed: int) -> NDArray[np.uint8]:
    """Colour picture (H, W, 3) from home."""
    world_seed, config = suite.plant(seed, WorldConfig(arm_visuals=False))
    camera = NIGHT_CAMERA if config.light == "lamp" else None
    robot = SimulatedRobot(build_world(world_seed, config), np.random.default_rng((seed, 1)), camera=camera)
    try:
        return robot.look().rgb
    finally:
        robot.close()


def named(suite: Suite, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture, smaller, with the suite's name."""
    small = np.ascontiguousarray(cv2.resize(rgb, SIZE, interpolation=cv2.INTER_AREA))
    cv2.putText(
        small, suite.label, (8, SIZE[1] - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 3, cv2.LINE_AA
    )
    cv2.putText(
        small, suite.label, (8, SIZE[1] - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA
    )
    return np.asarray(small, dtype=np.uint8)


if __name__ == "__main__":
    main()
