"""A plan as files: the picture, a table, and the trajectory as robots take it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from punnet.movement import JointTrajectory, TrajectoryDistribution
from punnet.planning.plot import plot_distribution

__all__ = ["write_plan"]

TIME_STEP = 0.02


def write_plan(folder: Path, distribution: TrajectoryDistribution, trajectory: JointTrajectory) -> list[Path]:
    """Write ``plan.png``, ``plan.csv``, ``distribution.json`` and ``trajectory.json``.

    ``plan.png`` and ``distribution.json`` are of the distribution, over joints or poses. ``plan.csv`` has one row
    every 20 ms: seconds, each joint's position in radians. ``trajectory.json`` has the fields of
    ``trajectory_msgs/JointTrajectory``.
    """
    files = [folder / name for name in ("plan.png", "plan.csv", "distribution.json", "trajectory.json")]
    plot_distribution(distribution, files[0], title="Planned reach")
    sampled = trajectory.resample(TIME_STEP)
    with files[1].open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["seconds", *(f"{name}_rad" for name in trajectory.joint_names)])
        for instant, joints in zip(sampled.times, sampled.positions, strict=True):
            writer.writerow([f"{instant:.3f}", *(f"{angle:.6f}" for angle in joints)])
    files[2].write_text(json.dumps(distribution.to_json()) + "\n")
    files[3].write_text(json.dumps(trajectory.to_json()) + "\n")
    return files
