"""What the simulator costs: building a cluster, one look, a second of physics. One core, plants of the demo's kind.

    python benchmarks/simulator.py --plants 5 --seed 0 [--json]

Run it on a quiet machine; ``taskset -c 0`` holds it to one core, the software renderer's threads included.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time

import numpy as np

from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import CAMERA_NAME
from punnet.sim.rendering import CameraRenderer
from punnet.sim.simulated_robot import WRIST_CAMERA
from punnet.sim.world import TIME_STEP, WorldConfig, build_world

STEPS = 500
BARS = {"build_s": "≤ 1.5", "look_ms": "≤ 220", "physics_x_real_time": "≥ 8", "depth_sensor_ms": ""}


def measure(seed: int) -> dict[str, float]:
    """Costs of one plant, the best of three where it is repeatable."""
    start = time.perf_counter()
    world = build_world(seed, WorldConfig(arm_visuals=False))
    figures = {"build_s": time.perf_counter() - start}
    with CameraRenderer(
        world.model, WRIST_CAMERA.width, WRIST_CAMERA.height, hidden_groups=(ARM_VISUAL,)
    ) as renderer:
        view = renderer.render_all(world.data, CAMERA_NAME)
        figures["look_ms"] = 1000 * best(lambda: renderer.render_all(world.data, CAMERA_NAME))
    sensor, rng = StereoDepthModel(), np.random.default_rng(seed)
    figures["depth_sensor_ms"] = 1000 * best(lambda: sensor.apply(view.depth, view.rgb, rng))

    def run() -> None:
        for _ in range(STEPS):
            world.step()

    figures["physics_x_real_time"] = STEPS * TIME_STEP / best(run)
    figures["berries"] = world.berries
    return figures


def best(work: object) -> float:
    """Least seconds of three runs."""
    times = []
    for _ in range(3):
        start = time.perf_counter()
        work()  # type: ignore[operator]
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    """Print the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    build_world(options.seed, WorldConfig(arm_visuals=False))  # reads the package's meshes once
    rows = [measure(options.seed + plant) for plant in range(options.plants)]
    figures = {name: statistics.median(row[name] for row in rows) for name in rows[0]}
    if options.json:
        print(json.dumps({"plants": options.plants, "seed": options.seed, **figures}, indent=2))
        return
    for name, value in figures.items():
        print(f"{name:22s} {value:8.2f}   {BARS.get(name, '')}")


if __name__ == "__main__":
    main()
