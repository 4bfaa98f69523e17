"""From a distribution over poses to one over joints: the demonstrated joints, conditioned on poses that are not certain.

The mean follows the poses' mean. With gain K of the joints' weights on the poses' twists at some instants, and V the poses'
covariance there, K V Kᵀ is added to what the poses leave open: the joints are as unsure as the poses are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from punnet.errors import PlanningError
from punnet.movement import (
    ForwardKinematics,
    PoseViaPoint,
    TrajectoryDistribution,
    ViaPoint,
    condition_on_poses,
)
from punnet.movement.covariance import covariance_factor
from punnet.robot import Arm

__all__ = ["joints_of_poses"]

Array = NDArray[np.float64]
PHASES: Array = np.array([0.4, 0.6, 0.8, 0.9, 1.0])
POSITION_STD: Array = np.array([0.02, 0.01, 0.002, 0.002, 0.001])
ROTATION_STD: Array = np.array([0.1, 0.05, 0.02, 0.02, 0.01])
"""How closely the mean follows the poses' mean at those phases, metres and radians: on the way nothing hangs on it."""
BROADENING = 0.05
"""Radians of standard deviation added to the demonstrated weights, so that new places are reached too."""


def joints_of_poses(
    predicted: TrajectoryDistribution, demonstrated: TrajectoryDistribution, arm: Arm, start: Array
) -> TrajectoryDistribution:
    """Joint-space distribution from joints ``start`` (J,) whose flange follows a task-space one.

    Parameters
    ----------
    predicted
        Over the flange's poses.
    demonstrated
        Over the joints: how this arm is usually held on such reaches.
    arm
        Its kinematics.
    start
        Joints that the arm is at, radians.

    Raises
    ------
    PlanningError
        If ``predicted`` is over joints already.
    KinematicsError
        If the arm can't follow.
    """
    chart = predicted.chart
    if chart is None:
        raise PlanningError("joints_of_poses: the distribution is over joints already")
    flange = ForwardKinematics(arm.forward_kinematics, arm.jacobian)
    natural = demonstrated.broadened(BROADENING).condition([ViaPoint(0.0, start)])
    coordinates = predicted.mean(PHASES)
    poses = [
        PoseViaPoint(float(phase), pose, float(position), float(rotation))
        for phase, pose, position, rotation in zip(
            PHASES, chart.poses(coordinates), POSITION_STD, ROTATION_STD, strict=True
        )
    ]
    followed = condition_on_poses(natural, poses, flange)
    rows = _rows(arm.jacobian(followed.mean(PHASES)), natural.basis.phi(PHASES))
    noise = np.square(np.stack([pose.std for pose in poses])).ravel()
    S = natural.weight_covariance
    gain = np.linalg.solve(rows @ S @ rows.T + np.diag(noise), rows @ S).T
    turns = _rows(chart.jacobian(coordinates), predicted.basis.phi(PHASES))
    doubt = gain @ turns @ covariance_factor(predicted.weight_covariance)
    return replace(followed, weight_covariance=followed.weight_covariance + doubt @ doubt.T)


def _rows(jacobians: Array, phi: Array) -> Array:
    """(P·6, D·B): weights to twists, of Jacobians (P, 6, D) and basis values (P, B)."""
    P, six, D = jacobians.shape
    return np.asarray(np.einsum("prd,pb->prdb", jacobians, phi).reshape(P * six, D * phi.shape[1]))
