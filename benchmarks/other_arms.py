"""How much of the workspace other arms than the Panda reach, and how long planning takes for them.

python benchmarks/other_arms.py [--stems 60] [--seed 0]

Stems at random in the lab's workspace; a reach counts if it is planned, ends within 2 mm of the stem, and passes the guard.
"""

import argparse
import time

import numpy as np

from punnet.errors import PunnetError
from punnet.movement import retime
from punnet.planning import ProMPDepthPlanner
from punnet.robot import ARMS, Arm, MotionGuard, load_arm
from punnet.scene import Frame, Target

NEAREST, FARTHEST = (0.70, -0.17, 0.62), (0.79, 0.15, 0.86)
"""Stems that the lab's demonstrations reach, metres, base frame."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stems", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    stems = np.random.default_rng(options.seed).uniform(NEAREST, FARTHEST, (options.stems, 3))
    print("arm      joints  reached  ms a plan (median)  s of reach at half speed (median)")
    for name in ARMS:
        arm = load_arm(name)
        found = [_reach(ProMPDepthPlanner.from_bundle(arm=arm), arm, stem) for stem in stems]
        reached = [seconds for seconds, _ in found if seconds is not None]
        milliseconds = 1e3 * np.median([taken for _, taken in found])
        print(
            f"{name:8} {arm.joint_count:6} {len(reached):5}/{len(found)} {milliseconds:19.0f} {np.median(reached):34.1f}"
        )


def _reach(planner: ProMPDepthPlanner, arm: Arm, stem: np.ndarray) -> tuple[float | None, float]:
    """Seconds that the reach takes, None if there is none that may be executed; and seconds of planning."""
    frame = Frame(rgb=np.zeros((48, 64, 3), dtype=np.uint8))
    began = time.perf_counter()
    try:
        reach = planner.plan(frame, Target(np.array([3.0, 4.0, 20.0, 30.0]), stem), arm.home)
    except PunnetError:
        return None, time.perf_counter() - began
    taken = time.perf_counter() - began
    path = reach.mean(np.linspace(0.0, 1.0, 150))
    path[0] = arm.home
    trajectory = retime(path, arm.limits, speed=0.5)
    off = np.linalg.norm(arm.forward_kinematics_tool(trajectory.end)[:3, 3] - stem)
    passed = off < 0.002 and MotionGuard(arm).refusal(trajectory, arm.home) is None
    return (trajectory.duration if passed else None), taken


if __name__ == "__main__":
    main()
