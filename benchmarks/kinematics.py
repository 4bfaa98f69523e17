"""Speed, success and error of the Panda's kinematics against frankik, in one run.

``python benchmarks/kinematics.py [--poses 10000] [--seed 0] [--json]``

Poses are drawn from joints spread evenly between the limits. Times are the least of several runs. An arm
counts as found if it is inside the limits and our forward kinematics puts it on the pose.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Callable
from typing import Any

import frankik
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import make_transform
from punnet.movement import retime
from punnet.robot import HOME, PANDA_LIMITS, Panda, follow_path, nearest_solution
from punnet.robot.inverse_kinematics import solve, solve_any

Array = NDArray[np.float64]
ARM = Panda()
ON_THE_POSE = 1e-9
PATH_LENGTH = 150


def least_seconds(call: Callable[[], Any], repeats: int) -> float:
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def judged(joints: Array, poses: Array) -> tuple[float, float]:
    """Share of poses solved, and the largest position error of those in metres."""
    found = ~np.isnan(joints).any(axis=1)
    error = np.full(len(joints), np.inf)
    error[found] = np.abs(ARM.forward_kinematics(joints[found]) - poses[found]).max(axis=(1, 2))
    good = ARM.within_limits(joints) & (error < ON_THE_POSE)
    distance = np.linalg.norm(ARM.forward_kinematics(joints[good])[:, :3, 3] - poses[good, :3, 3], axis=1)
    return float(good.mean()), float(distance.max(initial=0.0))


def frankik_sweep(pose: Array, grid: Array) -> Array:
    """Find the arm farthest from its limits of a sweep with frankik, as ``solve_any`` chooses."""
    arms = np.concatenate([frankik.ik_full(pose, q7=q7) for q7 in grid])
    margin = np.nan_to_num(ARM.limit_margin(arms), nan=-np.inf)
    best = int(np.argmax(margin))
    return arms[best] if margin[best] >= 0 else np.full(7, np.nan)


def reach() -> Array:
    """Make a straight reach of 0.29 m from home, 150 flange poses."""
    start = ARM.forward_kinematics(HOME)
    share = np.linspace(0.0, 1.0, PATH_LENGTH)[:, None]
    return make_transform(start[:3, :3], start[:3, 3] + share * ((0.55, -0.02, 0.80) - start[:3, 3]))


def measure(count: int, seed: int) -> dict[str, dict[str, float]]:
    random = np.random.default_rng(seed)
    joints = random.uniform(PANDA_LIMITS.lower, PANDA_LIMITS.upper, (count, 7))
    poses = ARM.forward_kinematics(joints)
    path, q7 = poses[:PATH_LENGTH], 0.3
    grid = np.linspace(PANDA_LIMITS.lower[6], PANDA_LIMITS.upper[6], 40)
    few = poses[: min(count, 1000)]
    results: dict[str, dict[str, float]] = {}

    def time_of(name: str, call: Callable[[], Any], repeats: int = 20) -> None:
        results[name] = {"milliseconds": 1e3 * least_seconds(call, repeats)}

    time_of("forward kinematics, 150 arms", lambda: ARM.forward_kinematics(joints[:PATH_LENGTH]))
    time_of("Jacobian, 150 arms", lambda: ARM.jacobian(joints[:PATH_LENGTH]))
    time_of("all branches, 150 poses, ours", lambda: solve(path, q7))
    time_of("all branches, 150 poses, frankik", lambda: [frankik.ik_full(T, q7=q7) for T in path])
    for name, solutions in (
        ("any arm, sweep of q7, ours", lambda: solve_any(few)),
        ("any arm, sweep of q7, frankik", lambda: np.stack([frankik_sweep(T, grid) for T in few])),
    ):
        time_of(name, solutions, 2)
        results[name]["milliseconds"] /= len(few)
        results[name]["share_solved"], results[name]["worst_error_m"] = judged(solutions(), few)
    share, error = judged(solve_any(poses), poses)
    results[f"any arm, all {count} poses, ours"] = {"share_solved": share, "worst_error_m": error}
    goal = reach()
    time_of("nearest solution, one pose", lambda: nearest_solution(goal[-1], HOME))
    time_of("follow a path of 150 poses", lambda: follow_path(goal, HOME), 5)
    followed = follow_path(goal, HOME)
    time_of("retime that path", lambda: retime(followed, PANDA_LIMITS), 5)
    results["retime that path"]["duration_s"] = retime(followed, PANDA_LIMITS).duration
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=10_000, help="random reachable poses (default 10000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    if arguments.poses < PATH_LENGTH:
        parser.error(f"--poses must be at least {PATH_LENGTH}")
    results = measure(arguments.poses, arguments.seed)
    if arguments.json:
        machine = {
            "machine": platform.machine(),
            "python": platform.python_version(),
            "numpy": np.__version__,
        }
        print(json.dumps({"seed": arguments.seed, **machine, "results": results}, indent=2))
        return
    for name, figures in results.items():
        print(f"{name:40s}" + "   ".join(f"{value:10.4g} {key}" for key, value in figures.items()))


if __name__ == "__main__":
    main()
