"""Orientations that a source spoilt by averaging quaternions of both signs, taken from the joints in their place.

q and −q are one orientation, but weights fitted to some repeats of either sign average to a quaternion shorter than one, which
points elsewhere: on 8 of the lab's 75 real reaches, on three of them by 15° to 35° at the end. The joints of the same repeats
know better; ``punnet demos validate`` names such episodes (``quaternion-norm``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import Episode, WeightDistribution
from punnet.data.demos.trajectory import as_poses
from punnet.geometry import continuous_quaternions, quaternion_from_rotation
from punnet.robot import Panda

__all__ = ["SHORTEST", "mended"]

SHORTEST = 0.9
"""Length of a mean quaternion below which it is not believed."""
SAMPLES = 150
Array = NDArray[np.float64]


def mended(episode: Episode, arm: Panda | None = None) -> Episode:
    """The episode, its orientations those of its joints where the mean quaternion of its weights is too short.

    Positions stay what the source has. The spread of the orientation is that of the joints, to the first order.

    Parameters
    ----------
    episode
        Poses of an episode with weights are taken to be the flange's.
    arm
        Whose joints they are; the Panda if not given.
    """
    weights, joints = episode.task_weights, episode.joint_weights
    if weights is None or joints is None or episode.poses is None:
        return episode
    phases = np.linspace(0.0, 1.0, SAMPLES)
    values = weights.mean_values(phases)
    if np.linalg.norm(values[:, 3:], axis=1).min() >= SHORTEST:
        return episode
    arm = arm or Panda()
    mean = _quaternions(arm, joints.mean_values(phases))
    values[:, 3:] = mean
    fit = np.linalg.pinv(weights.basis_values(phases))
    covariance = weights.covariance.copy()
    covariance[3:] = _spread(arm, joints, phases, mean, fit)
    told = WeightDistribution((fit @ values).T, covariance, weights.width, "task")
    return replace(episode, poses=as_poses(phases, values, clock="phase"), task_weights=told)


def _quaternions(arm: Panda, joints: Array) -> Array:
    """(T, 4) without jumps of sign."""
    rotations = arm.forward_kinematics(joints)[:, :3, :3]
    return np.asarray(continuous_quaternions(quaternion_from_rotation(rotations)))


def _spread(arm: Panda, joints: WeightDistribution, phases: Array, mean: Array, fit: NDArray[Any]) -> Array:
    """Covariance blocks (4, B, B) of the quaternion's weights: a joint's deviations, one direction at a time."""
    path, basis = joints.mean_values(phases), joints.basis_values(phases)
    blocks = np.zeros((4, len(fit), len(fit)))
    for joint, block in enumerate(joints.covariance):
        values, vectors = np.linalg.eigh(block)
        for direction in (vectors * np.sqrt(np.maximum(values, 0.0))).T[values > 1e-9 * values[-1]]:
            moved = path.copy()
            moved[:, joint] += basis @ direction
            away = _quaternions(arm, moved)
            away *= np.where(np.sum(away * mean, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
            off = fit @ (away - mean)
            blocks += np.einsum("bd,cd->dbc", off, off)
    return (blocks + blocks.transpose(0, 2, 1)) / 2.0
