"""Inverse kinematics that asks what is likely: of all arms at a pose the one closest to a Gaussian's mean.

A seven-joint arm reaches a pose in infinitely many ways, a six-joint one in several. Given ``q ~ N(m, Σ)``, from
demonstrations, the most likely of them solves ``min (q − m)ᵀ Σ⁻¹ (q − m)`` subject to ``FK(q) = T``. Each Gauss–Newton step
linearises the forward kinematics and conditions the Gaussian on the pose, ``q ← m + Σ Jᵀ (J Σ Jᵀ)⁻¹ (e + J (q − m))``. Unlike
a solution with a fixed last joint it passes q2 = 0 without turning the elbow round.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.geometry import invert_transform, vector_from_rotation
from punnet.robot import Arm

__all__ = ["likely_joints"]

ITERATIONS = 20
LARGEST_STEP = 0.6  # radians; beyond it the linearisation is not to be trusted
CONVERGED = 1e-5  # radians; the step before left an error of the square of that in the pose
SOLVED = 1e-7  # metres and radians
REGULARISATION = 1e-10


def likely_joints(
    arm: Arm, T_base_tool: ArrayLike, mean: ArrayLike, covariance: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Most likely joints for tool poses.

    Parameters
    ----------
    arm
        The arm.
    T_base_tool
        Poses (..., 4, 4).
    mean, covariance
        (..., J) and (..., J, J) of the Gaussian; broadcast against the poses. The covariance must be
        definite.

    Returns
    -------
    tuple
        Joints (..., J), NaN where the pose was not reached within the limits, and their squared Mahalanobis
        distances (...) from the mean, infinite there.
    """
    poses = np.asarray(T_base_tool, dtype=np.float64) @ invert_transform(arm.T_flange_tool)
    shape, J = poses.shape[:-2], arm.joint_count
    poses = poses.reshape(-1, 4, 4)
    m = np.broadcast_to(np.asarray(mean, dtype=np.float64), (*shape, J)).reshape(-1, J)
    cov = np.broadcast_to(np.asarray(covariance, dtype=np.float64), (*shape, J, J)).reshape(-1, J, J)
    q = m.copy()
    active = np.arange(len(q))
    for _ in range(ITERATIONS):
        step = _step(arm, q[active], poses[active], m[active], cov[active])
        longest = np.abs(step).max(axis=-1, keepdims=True, initial=0.0)
        q[active] += step * np.minimum(1.0, LARGEST_STEP / np.maximum(longest, 1e-12))
        active = active[longest[:, 0] >= CONVERGED]
        if len(active) == 0:
            break
    error = _flange_error(arm, q, poses)
    left = np.maximum(np.linalg.norm(error[:, :3], axis=-1), np.linalg.norm(error[:, 3:], axis=-1))
    solved = (left < SOLVED) & arm.within_limits(q)
    distance = np.einsum("ni,ni->n", q - m, np.linalg.solve(cov, (q - m)[..., None])[..., 0])
    joints = np.where(solved[:, None], q, np.nan)
    return joints.reshape(*shape, J), np.where(solved, distance, np.inf).reshape(shape)


def _step(
    arm: Arm,
    q: NDArray[np.float64],
    poses: NDArray[np.float64],
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """From joints (n, J) to the most likely ones that reach the linearised poses."""
    J = arm.jacobian(q)
    cross = covariance @ np.swapaxes(J, -1, -2)
    needed = _flange_error(arm, q, poses) + np.einsum("nij,nj->ni", J, q - mean)
    gained = np.linalg.solve(J @ cross + REGULARISATION * np.eye(6), needed[..., None])[..., 0]
    return np.asarray(mean + np.einsum("nij,nj->ni", cross, gained) - q)


def _flange_error(arm: Arm, q: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give what is left to the poses: metres and rotation vector (..., 6), both in the base frame."""
    T = arm.forward_kinematics(q)
    turn = vector_from_rotation(poses[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2))
    return np.concatenate((poses[..., :3, 3] - T[..., :3, 3], turn), axis=-1)
