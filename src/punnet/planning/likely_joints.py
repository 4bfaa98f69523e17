"""Inverse kinematics that asks what is likely: of all arms at a pose the one closest to a Gaussian's mean.

A seven-joint arm reaches a pose in infinitely many ways. Given ``q ~ N(m, Σ)``, from demonstrations, the most likely
of them solves ``min (q − m)ᵀ Σ⁻¹ (q − m)`` subject to ``FK(q) = T``. Each Gauss–Newton step linearises the forward
kinematics and conditions the Gaussian on the pose,
``q ← m + Σ Jᵀ (J Σ Jᵀ)⁻¹ (e + J (q − m))``. Unlike a fixed last joint it passes q2 = 0 without turning the elbow round.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.geometry import invert_transform, vector_from_rotation
from punnet.robot import Panda

__all__ = ["likely_joints"]

ITERATIONS = 25
LARGEST_STEP = 0.6  # radians; beyond it the linearisation is not to be trusted
SOLVED_METRES = 1e-7
SOLVED_RADIANS = 1e-7
REGULARISATION = 1e-10


def likely_joints(
    arm: Panda,
    T_base_tool: ArrayLike,
    mean: ArrayLike,
    covariance: ArrayLike,
    *,
    initial: ArrayLike | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Most likely joints for tool poses.

    Parameters
    ----------
    arm
        The arm.
    T_base_tool
        Poses (..., 4, 4).
    mean, covariance
        (..., 7) and (..., 7, 7) of the Gaussian; broadcast against the poses. The covariance must be definite.
    initial
        (..., 7) where to start; the mean if not given.

    Returns
    -------
    tuple
        Joints (..., 7), NaN where the pose was not reached within the limits, and their squared Mahalanobis distances
        (...) from the mean, infinite there.
    """
    poses = np.asarray(T_base_tool, dtype=np.float64) @ invert_transform(arm.T_flange_tool)
    shape = poses.shape[:-2]
    m = np.broadcast_to(np.asarray(mean, dtype=np.float64), (*shape, 7))
    cov = np.broadcast_to(np.asarray(covariance, dtype=np.float64), (*shape, 7, 7))
    q = np.array(m if initial is None else np.broadcast_to(initial, (*shape, 7)), dtype=np.float64)
    for _ in range(ITERATIONS):
        error = _flange_error(arm, q, poses)
        J = arm.jacobian(q)
        cross = cov @ np.swapaxes(J, -1, -2)
        innovation = J @ cross + REGULARISATION * np.eye(6)
        needed = error + np.einsum("...ij,...j->...i", J, q - m)
        step = (
            m
            + np.einsum("...ij,...j->...i", cross, np.linalg.solve(innovation, needed[..., None])[..., 0])
            - q
        )
        longest = np.abs(step).max(axis=-1, keepdims=True)
        q = q + step * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-12))
        if (longest < 1e-9).all():
            break
    error = _flange_error(arm, q, poses)
    solved = (np.linalg.norm(error[..., :3], axis=-1) < SOLVED_METRES) & (
        np.linalg.norm(error[..., 3:], axis=-1) < SOLVED_RADIANS
    )
    solved &= arm.within_limits(q)
    residual = q - m
    distance = np.einsum("...i,...i->...", residual, np.linalg.solve(cov, residual[..., None])[..., 0])
    return np.where(solved[..., None], q, np.nan), np.where(solved, distance, np.inf)


def _flange_error(arm: Panda, q: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """What is left to the poses: metres and rotation vector (..., 6), both in the base frame."""
    T = arm.forward_kinematics(q)
    turn = vector_from_rotation(poses[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2))
    return np.concatenate((poses[..., :3, 3] - T[..., :3, 3], turn), axis=-1)
