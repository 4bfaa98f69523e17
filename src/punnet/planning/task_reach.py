"""From a distribution over poses to joints: what the arm has to do for the tool to follow it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import PlanningError
from punnet.movement import TrajectoryDistribution
from punnet.robot import Arm, Panda, follow_path

__all__ = ["joints_along"]

POSES = 150


def joints_along(
    distribution: TrajectoryDistribution,
    start: ArrayLike,
    *,
    arm: Arm | None = None,
    samples: int = POSES,
) -> NDArray[np.float64]:
    """Joints (T, J) whose tool follows the mean of a task-space distribution, beginning near joints ``start``.

    :func:`punnet.movement.retime` gives them their time.

    Raises
    ------
    PlanningError
        If the distribution is not in task space.
    KinematicsError
        If the arm can't follow; the message names the pose.
    """
    if distribution.chart is None:
        raise PlanningError("joints_along: the distribution is over joints already; its mean is the path")
    arm = arm or Panda()
    poses = distribution.chart.poses(distribution.mean(np.linspace(0.0, 1.0, samples)))
    return follow_path(arm.flange_pose(poses), start, arm=arm)
