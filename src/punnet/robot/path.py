"""Joint paths along flange poses: which branch, and how the free joint moves.

:func:`follow_path` guesses in two ways, completes both guesses and keeps the cheaper one. Guess one is a straight line in joint
space to the nearest solution of the last pose. Guess two comes from :mod:`punnet.robot.sweep`, over some of the poses. If both
fail the start is tracked from pose to pose, and at last the sweep looks at every pose. A guess is completed by moving every
point onto its pose and smoothing the path within its poses. Cost: squared joint motion, nearness to limits and singularities.
J is the arm's number of joints, 7 for the Panda.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import KinematicsError, ShapeError
from punnet.geometry import pose_error
from punnet.robot.arm import Arm
from punnet.robot.nearest import MARGIN, nearest_solution
from punnet.robot.panda import Panda
from punnet.robot.projection import projected, relaxed
from punnet.robot.sweep import PathRequest, discomfort, swept_path

__all__ = ["follow_path"]

Array = NDArray[np.float64]

STRIDE = 5
"""The first sweep looks at every fifth pose."""
SLACK = 1e-6
RIGID = 1e-6
METRES_PER_RADIAN = 0.5
"""Weight of turning against moving in how far along the path a pose is."""


def follow_path(
    T_base_flange: ArrayLike,
    start: ArrayLike | None = None,
    *,
    arm: Arm | None = None,
    margin: float = MARGIN,
    largest_step: float = 0.3,
) -> Array:
    """Continuous joints (T, J) along flange poses (T, 4, 4).

    Parameters
    ----------
    T_base_flange
        Poses (T, 4, 4) in metres, base frame, T ≥ 1, dense: neighbours a few centimetres and degrees apart.
    start
        Joints (J,) that the path should begin near; exactly there if they reach the first pose. None:
        anywhere.
    arm
        The Panda if None.
    margin
        Radians to keep from the limits (less if ``start`` itself is nearer to one).
    largest_step
        Radians that a joint may move from one pose to the next; more is a jump between branches.

    Raises
    ------
    KinematicsError
        If a pose can't be reached or the arm can't get from one pose to the next; the message names the
        pose.
    ShapeError
        If poses or start have the wrong shape or are not rigid transforms.
    """
    arm = arm or Panda()
    poses, home = _validated(T_base_flange, start, arm)
    if home is not None:
        margin = min(margin, max(0.0, float(arm.limit_margin(home))))
    request = PathRequest(poses, home, arm, margin, largest_step)
    paths: list[Array] = []
    failure = "follow_path: no way found"
    for way in (_straight, _coarse, _tracked, _fine):
        if paths and way in (_tracked, _fine):
            break
        try:
            paths.append(_completed(request, way(request)))
        except KinematicsError as error:
            failure = str(error)  # not the error: its traceback holds all that the callers hold
    if not paths:
        raise KinematicsError(failure)
    return min(paths, key=lambda path: _cost(path, arm))


def _straight(request: PathRequest) -> Array:
    """Guess (T, J): from the start straight to the solution of the last pose that is nearest to it."""
    start = request.first
    if start is None:
        raise KinematicsError("pose 0 of the path: the start is elsewhere")
    end = nearest_solution(request.poses[-1], start, arm=request.arm, margin=request.margin)
    distance, angle = pose_error(request.poses[:-1], request.poses[1:])
    travelled = np.concatenate(([0.0], np.cumsum(distance + METRES_PER_RADIAN * angle)))
    share = travelled / max(float(travelled[-1]), 1e-12)
    return np.asarray(start + share[:, None] * (end - start))


def _tracked(request: PathRequest) -> Array:
    """Guess (T, J): from the start pose by pose, each time by the shortest way."""
    joints = request.first
    if joints is None:
        raise KinematicsError("pose 0 of the path: the start is elsewhere")
    path = [joints]
    for pose in request.poses[1:]:
        path.append(projected(request.arm, path[-1][None], pose[None])[0])
    return np.stack(path)


def _coarse(request: PathRequest) -> Array:
    return swept_path(request, STRIDE)


def _fine(request: PathRequest) -> Array:
    return swept_path(request, 1)


def _cost(path: Array, arm: Arm) -> float:
    return float(len(path) * np.square(np.diff(path, axis=0)).sum() + discomfort(path, arm).mean())


def _validated(T_base_flange: ArrayLike, start: ArrayLike | None, arm: Arm) -> tuple[Array, Array | None]:
    poses = np.asarray(T_base_flange, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) == 0:
        raise ShapeError(f"follow_path: poses must be (T ≥ 1, 4, 4), got {poses.shape}")
    rigid = _rigid(poses)
    if not rigid.all():
        raise ShapeError(f"follow_path: pose {int(np.argmin(rigid))} is not a rigid transform")
    if start is None:
        return poses, None
    home = np.asarray(start, dtype=np.float64)
    if home.shape != (arm.joint_count,) or not np.isfinite(home).all():
        raise ShapeError(f"follow_path: start must be {arm.joint_count} finite joints, got {home.shape}")
    return poses, home


def _rigid(poses: Array) -> NDArray[np.bool_]:
    """Which poses (T, 4, 4) are rigid transforms."""
    R = poses[:, :3, :3]
    skew = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    last_row = np.abs(poses[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray((skew < RIGID) & (last_row < RIGID) & (np.linalg.det(R) > 0))


def _completed(request: PathRequest, guess: Array) -> Array:
    """Bring a guess (T, J) onto the poses, smooth it and check it for limits and jumps."""
    path = projected(request.arm, guess, request.poses)
    inside = request.arm.within_limits(path, request.margin - SLACK)
    if not inside.all():
        raise KinematicsError(
            f"pose {int(np.argmin(inside))} of the path: no solution inside the joint limits "
            "that joins up with its neighbours"
        )
    path = relaxed(request.arm, path, request.poses, margin=request.margin - SLACK)
    steps = np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0)
    if (steps > request.largest_step).any():
        index = int(np.argmax(steps > request.largest_step)) + 1
        raise KinematicsError(
            f"pose {index} of the path: a joint would jump by {steps[index - 1]:.2f} rad; "
            "give denser poses, or keep away from singularities"
        )
    return path
