"""Weights of a movement primitive of repeated reaches to one target, in joint and in task space."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import Episode, WeightDistribution
from punnet.movement import GaussianBasis, ProMP

__all__ = ["aligned", "fit_repeats", "reference_quaternion"]

SAMPLES = 150
Array = NDArray[np.float64]


def fit_repeats(
    episodes: list[Episode], basis: GaussianBasis, reference: Array
) -> tuple[Array, Array, Array, Array]:
    """Mean (7, B) and covariance (7·B, 7·B) of the joints' weights, and of the poses', of repeats to one target."""
    joints, poses = [], []
    for episode in episodes:
        assert episode.joints is not None
        assert episode.poses is not None
        joints.append(episode.joints.resampled(SAMPLES))
        poses.append(aligned(episode.poses.resampled(SAMPLES), reference))
    result: list[Array] = []
    for paths, kept in (
        (joints, [episode.joint_weights for episode in episodes]),
        (poses, [episode.task_weights for episode in episodes]),
    ):
        stored = [weights for weights in kept if weights is not None]
        if stored:
            result += [ProMP(basis).weights(np.mean(paths, axis=0)), _stored_covariance(stored, basis)]
        elif len(paths) == 1:
            weights = ProMP(basis).weights(paths[0])
            result += [weights, np.zeros((weights.size, weights.size))]
        else:
            distribution = ProMP(basis).fit(paths)
            result += [distribution.weight_mean, distribution.weight_covariance]
    return result[0], result[1], result[2], result[3]


def _stored_covariance(stored: list[WeightDistribution], basis: GaussianBasis) -> Array:
    """Covariance (7·B, 7·B) in ``basis`` of weights in the source's own; what is no covariance is cut to one."""
    phases = np.linspace(0.0, 1.0, SAMPLES)
    D, B = stored[0].mean.shape[0], basis.count
    whole = np.zeros((D * B, D * B))
    for weights in stored:
        change = np.linalg.pinv(basis.phi(phases)) @ weights.basis_values(phases)
        for degree, block in enumerate(weights.covariance):
            values, vectors = np.linalg.eigh(block)
            root = change @ (vectors * np.sqrt(np.maximum(values, 0.0)))
            here = slice(degree * B, (degree + 1) * B)
            whole[here, here] += root @ root.T / len(stored)
    return whole


def reference_quaternion(episodes: Iterable[Episode]) -> Array:
    """(4,) mean orientation of all final poses, to which quaternions are aligned."""
    ends = np.array([episode.poses.end[3:] for episode in episodes if episode.poses is not None])
    return np.asarray(np.linalg.eigh(ends.T @ ends)[1][:, -1])


def aligned(poses: Array, reference: Array) -> Array:
    """Poses (T, 7) whose quaternions end in the reference's hemisphere."""
    if poses[-1, 3:] @ reference < 0:
        poses = poses.copy()
        poses[:, 3:] *= -1.0
    return poses
