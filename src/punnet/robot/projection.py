"""Joints brought exactly onto poses, and smoothed along a path without leaving its poses.

The Panda's branches of :mod:`punnet.robot.inverse_kinematics` are exact but, with q7 as parameter, awkward where
q7 is a bad coordinate: where two wrist branches meet, or with a vertical upper arm (q2 = 0). A joint path
that is nearly right passes there smoothly when each of its points is moved to the nearest posture that holds
the pose. J is the number of joints, 7 for the Panda.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from punnet.robot.arm import Arm

__all__ = ["projected", "relaxed"]

Array = NDArray[np.float64]

ITERATIONS = 12
CONVERGED = 1e-10
"""Metres and radians."""
LARGEST_CORRECTION = 0.3
"""Radians in one iteration."""
SMOOTHING = 3e4
FIXED = 1e9


def projected(arm: Arm, joints: Array, poses: Array) -> Array:
    """Move joints (N, J) onto flange poses (N, 4, 4) by the shortest way; NaN rows where that fails.

    Gauss–Newton steps ``Jᵀ(JJᵀ + μI)⁻¹ e`` with damping μ ∝ |e|² (Levenberg–Marquardt, quadratic near the
    solution).
    """
    q = joints.copy()
    open_rows = np.arange(len(q))
    for _ in range(ITERATIONS):
        error = _pose_error(arm.forward_kinematics(q[open_rows]), poses[open_rows])
        size = np.abs(error).max(axis=1)
        left = size > CONVERGED
        open_rows, error = open_rows[left], error[left]
        if not len(open_rows):
            return q
        J = arm.jacobian(q[open_rows])
        damping = 1e-12 + 1e-3 * np.square(size[left])[:, None, None] * np.eye(6)
        step = np.swapaxes(J, 1, 2) @ np.linalg.solve(J @ np.swapaxes(J, 1, 2) + damping, error[..., None])
        step = step[..., 0]
        step *= np.minimum(1.0, LARGEST_CORRECTION / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
        q[open_rows] += step
    q[open_rows] = np.nan
    return q


def _pose_error(T: Array, wanted: Array) -> Array:
    """Find the translation and rotation (N, 6), base frame, that take T (N, 4, 4) to what is wanted."""
    # Half the sum over the axes of (axis × wanted axis): the antisymmetric part of R_wanted Rᵀ.
    relative = wanted[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)
    antisymmetric = (relative - np.swapaxes(relative, 1, 2)) / 2
    turn = antisymmetric[:, (2, 0, 1), (1, 2, 0)]
    return np.concatenate((wanted[:, :3, 3] - T[:, :3, 3], turn), axis=1)


def relaxed(arm: Arm, joints: Array, poses: Array, *, rounds: int = 4, margin: float = 0.0) -> Array:
    """Smooth a joint path (T, J) within the freedom that its poses (T, 4, 4) leave; both ends stay.

    Each round low-passes the path (least squares with a penalty on second differences) and projects it
    back. A round that would come nearer to a limit than ``margin``, or fail, is not taken.
    """
    if len(joints) < 4:
        return joints
    for _ in range(rounds):
        trial = projected(arm, _low_passed(joints), poses)
        trial[[0, -1]] = joints[[0, -1]]
        if not (arm.limit_margin(trial) >= margin).all():
            break
        joints = trial
    return joints


def _low_passed(joints: Array) -> Array:
    """Minimiser of Σ|q − joints|² + λ Σ|second difference of q|², ends fixed."""
    count = len(joints)
    bands = np.zeros((3, count))  # upper form: superdiagonals first
    for offset, weight in ((0, 1.0), (1, -2.0), (2, 1.0)):
        bands[2, offset : offset + count - 2] += SMOOTHING * weight**2
    bands[1, 1 : count - 1] -= 2 * SMOOTHING
    bands[1, 2:count] -= 2 * SMOOTHING
    bands[0, 2:] += SMOOTHING
    weights = np.ones(count)
    weights[[0, -1]] = FIXED
    bands[2] += weights
    return np.asarray(solveh_banded(bands, weights[:, None] * joints))
