"""Of all postures that hold a pose, the one nearest to given joints. J is the arm's number of joints, 7 for the Panda."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import KinematicsError, ShapeError
from punnet.geometry import is_transform
from punnet.robot.arm import Arm
from punnet.robot.inverse_kinematics import solve, solve_any
from punnet.robot.multistart import STARTS, postures
from punnet.robot.panda import Panda
from punnet.robot.projection import projected

__all__ = ["MARGIN", "nearest_solution", "nearest_solutions"]

Array = NDArray[np.float64]

MARGIN = 0.03
"""Radians that solutions keep from the joint limits unless told otherwise."""

SWEEP = 48
ZOOM = np.linspace(-1.0, 1.0, 9)
ZOOM_ROUNDS = 3
DEFAULT_ARM: Arm = Panda()
HARD_STARTS = 8 * STARTS
"""For poses that no usual start leads to."""
NEIGHBOURS = np.array([-0.02, 0.0, 0.02])


def nearest_solutions(
    T_base_flange: ArrayLike, reference: ArrayLike, *, arm: Arm | None = None, margin: float = MARGIN
) -> Array:
    """Joints (N, J) for poses (N, 4, 4), each the nearest to ``reference`` (J,); NaN where none was found.

    Nearest in the Euclidean sense: over a sweep of the Panda's q7 and then a search around the best; of another arm over the
    postures that Newton's steps find from many starts, which need not be all (:mod:`punnet.robot.multistart`).

    Parameters
    ----------
    T_base_flange
        Poses (N, 4, 4) in metres, base frame.
    reference
        Joints (J,) to stay close to.
    arm
        The Panda if None.
    margin
        Radians to keep from the limits.
    """
    arm = arm or DEFAULT_ARM
    poses = np.asarray(T_base_flange, dtype=np.float64)
    reference = np.asarray(reference, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or reference.shape != (arm.joint_count,):
        raise ShapeError(
            f"nearest: need poses (N, 4, 4) and joints ({arm.joint_count},), got {poses.shape}, {reference.shape}"
        )
    if not np.isfinite(reference).all():
        raise ShapeError(f"nearest: reference joints must be finite, got {reference}")
    return (
        _swept(poses, reference, arm, margin)
        if isinstance(arm, Panda)
        else _found(poses, reference, arm, margin)
    )


def _found(poses: Array, reference: Array, arm: Arm, margin: float) -> Array:
    best = np.full((len(poses), arm.joint_count), np.nan)
    for starts in (STARTS, HARD_STARTS):
        open_rows = np.flatnonzero(np.isnan(best[:, 0]))
        joints = postures(arm, poses[open_rows], reference, margin, starts)
        distance = np.nan_to_num(np.square(joints - reference).sum(axis=-1), nan=np.inf)
        best[open_rows] = joints[np.arange(len(open_rows)), np.argmin(distance, axis=1)]
    return best


def _swept(poses: Array, reference: Array, arm: Panda, margin: float) -> Array:
    lower, upper = arm.limits.lower[6] + margin, arm.limits.upper[6] - margin
    # Besides the sweep: where Newton steps from the reference end, perhaps a sliver between grid points.
    newton = projected(arm, np.tile(reference, (len(poses), 1)), poses)[:, 6]
    newton = np.where(np.isnan(newton), reference[6], newton)[:, None] + NEIGHBOURS
    sweep = np.broadcast_to(np.linspace(lower, upper, SWEEP), (len(poses), SWEEP))
    grid = np.concatenate((sweep, np.clip(newton, lower, upper)), axis=1)
    step = (upper - lower) / (SWEEP - 1)
    best = np.full((len(poses), 7), np.nan)
    nearest = np.full(len(poses), np.inf)
    rows = np.arange(len(poses))
    for _ in range(ZOOM_ROUNDS + 1):
        joints = solve(poses[:, None], grid, limits=arm.limits, margin=margin).reshape(len(poses), -1, 7)
        distance = np.square(joints - reference).sum(axis=-1)
        distance[np.isnan(distance)] = np.inf
        first = np.argmin(distance, axis=1)
        better = distance[rows, first] < nearest
        best[better] = joints[rows, first][better]
        nearest[better] = distance[rows, first][better]
        grid = np.clip(np.nan_to_num(best[:, 6])[:, None] + step * ZOOM, lower, upper)
        step *= 2.0 / (len(ZOOM) - 1)
    return np.asarray(best)


def nearest_solution(
    T_base_flange: ArrayLike, reference: ArrayLike, *, arm: Arm | None = None, margin: float = MARGIN
) -> Array:
    """Joints (J,) for one pose (4, 4), the solution nearest to ``reference`` (J,).

    Parameters are those of :func:`nearest_solutions`.

    Raises
    ------
    KinematicsError
        If the pose can't be reached inside the limits and their margin.
    ShapeError
        If the pose is not a rigid transform.
    """
    arm = arm or DEFAULT_ARM
    T = np.asarray(T_base_flange, dtype=np.float64)
    if not is_transform(T):
        raise ShapeError(f"nearest_solution: T_base_flange is not a 4×4 rigid transform, got shape {T.shape}")
    joints = nearest_solutions(T[None], reference, arm=arm, margin=margin)[0]
    if np.isnan(joints).any() and isinstance(arm, Panda):
        joints = solve_any(T, limits=arm.limits, margin=margin)
    if np.isnan(joints).any():
        x, y, z = T[:3, 3]
        raise KinematicsError(
            f"flange at ({x:.3f}, {y:.3f}, {z:.3f}) m can't be reached "
            f"inside the joint limits less {margin} rad"
        )
    return np.asarray(joints)
