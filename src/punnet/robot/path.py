"""Joint paths along flange poses: which branch, and how the free joint q7 moves.

:func:`follow_path` finds the cheapest way through a grid of q7 values × branches by dynamic programming over some of
the poses, then again over ever finer grids around the way found, and solves every pose at the q7 profile that results.
Cost: squared joint motion, nearness to joint limits and to singularities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from punnet.errors import KinematicsError, ShapeError
from punnet.geometry import is_transform
from punnet.robot.inverse_kinematics import solve, solve_any
from punnet.robot.panda import Panda

__all__ = ["follow_path", "nearest_solution", "nearest_solutions"]

Array = NDArray[np.float64]

MARGIN = 0.03
"""Radians that solutions keep from the joint limits unless told otherwise."""

SWEEP = 48
ZOOM = np.linspace(-1.0, 1.0, 9)
ZOOM_ROUNDS = 3
COMFORT = 0.4
"""Nearer than this (radians) to a limit costs."""
DEXTERITY = 0.03
"""A manipulability below this costs; home has 0.057."""
STRIDE = 5
LARGEST_COARSE_STEP = 1.2


@dataclass(frozen=True, eq=False)
class _Layer:
    """Solutions (S, 7) of one pose and their own cost (S,)."""

    joints: Array
    cost: Array


def nearest_solutions(
    T_base_flange: ArrayLike, reference: ArrayLike, *, arm: Panda | None = None, margin: float = MARGIN
) -> Array:
    """Joints (N, 7) for poses (N, 4, 4), each the nearest to ``reference`` (7,); NaN where no solution was found.

    Nearest in the Euclidean sense, over a sweep of q7 and then a search around the best.

    Parameters
    ----------
    T_base_flange
        Poses (N, 4, 4) in metres, base frame.
    reference
        Joints (7,) to stay close to.
    arm
        For its limits; the Panda if None.
    margin
        Radians to keep from the limits.
    """
    arm = arm or Panda()
    poses = np.asarray(T_base_flange, dtype=np.float64)
    reference = np.asarray(reference, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or reference.shape != (7,):
        raise ShapeError(
            f"nearest: need poses (N, 4, 4) and joints (7,), got {poses.shape}, {reference.shape}"
        )
    lower, upper = arm.limits.lower[6] + margin, arm.limits.upper[6] - margin
    sweep = np.append(np.linspace(lower, upper, SWEEP), np.clip(reference[6], lower, upper))
    grid = np.broadcast_to(sweep, (len(poses), len(sweep)))
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
    return best


def nearest_solution(
    T_base_flange: ArrayLike, reference: ArrayLike, *, arm: Panda | None = None, margin: float = MARGIN
) -> Array:
    """Joints (7,) for one pose (4, 4), the solution nearest to ``reference`` (7,).

    Parameters are those of :func:`nearest_solutions`.

    Raises
    ------
    KinematicsError
        If the pose can't be reached inside the limits and their margin.
    ShapeError
        If the pose is not a rigid transform.
    """
    arm = arm or Panda()
    T = np.asarray(T_base_flange, dtype=np.float64)
    if not is_transform(T):
        raise ShapeError(f"nearest_solution: T_base_flange is not a 4×4 rigid transform, got shape {T.shape}")
    joints = nearest_solutions(T[None], reference, arm=arm, margin=margin)[0]
    if np.isnan(joints).any():
        joints = solve_any(T, limits=arm.limits, margin=margin)
    if np.isnan(joints).any():
        raise KinematicsError(f"{_described(T)} can't be reached with {margin} rad from the joint limits")
    return joints


def follow_path(
    T_base_flange: ArrayLike,
    start: ArrayLike | None = None,
    *,
    arm: Panda | None = None,
    margin: float = MARGIN,
    largest_step: float = 0.3,
) -> Array:
    """Continuous joints (T, 7) along flange poses (T, 4, 4).

    Parameters
    ----------
    T_base_flange
        Poses (T, 4, 4) in metres, base frame, T ≥ 1, dense: neighbours a few centimetres and degrees apart.
    start
        Joints (7,) that the path should begin near, exactly there if they reach the first pose. None: anywhere.
    arm
        For its limits; the Panda if None.
    margin
        Radians to keep from the limits (less if ``start`` itself is nearer to one).
    largest_step
        Radians that a joint may move from one pose to the next; more is a jump between branches.

    Raises
    ------
    KinematicsError
        If a pose can't be reached or the arm can't get from one pose to the next; the message names the pose.
    ShapeError
        If poses or start have the wrong shape or are not rigid transforms.
    """
    arm = arm or Panda()
    poses, home = _validated(T_base_flange, start)
    if home is not None:
        margin = min(margin, max(0.0, float(arm.limit_margin(home))))
    if len(poses) > 2 * STRIDE:
        try:
            return _followed(poses, home, arm, margin, largest_step, STRIDE)
        except KinematicsError:
            pass  # some poses were skipped; look at every one before giving up
    return _followed(poses, home, arm, margin, largest_step, 1)


def _validated(T_base_flange: ArrayLike, start: ArrayLike | None) -> tuple[Array, Array | None]:
    poses = np.asarray(T_base_flange, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) == 0:
        raise ShapeError(f"follow_path: poses must be (T ≥ 1, 4, 4), got {poses.shape}")
    bad = [i for i, T in enumerate(poses) if not is_transform(T)]
    if bad:
        raise ShapeError(f"follow_path: pose {bad[0]} is not a rigid transform")
    if start is None:
        return poses, None
    home = np.asarray(start, dtype=np.float64)
    if home.shape != (7,) or not np.isfinite(home).all():
        raise ShapeError(f"follow_path: start must be seven finite joints, got {home.shape}")
    return poses, home


def _followed(
    poses: Array, start: Array | None, arm: Panda, margin: float, largest_step: float, stride: int
) -> Array:
    """Dynamic programming over every ``stride``-th pose, then all poses at the q7 profile found."""
    keys = np.unique(np.append(np.arange(0, len(poses), stride), len(poses) - 1))
    lower, upper = arm.limits.lower[6] + margin, arm.limits.upper[6] - margin
    step = (upper - lower) / (SWEEP - 1)
    grid = np.linspace(lower, upper, SWEEP)
    if start is not None:
        grid = np.sort(np.append(grid, np.clip(start[6], lower, upper)))
    grids = np.broadcast_to(grid, (len(keys), len(grid)))
    reach = min(LARGEST_COARSE_STEP, np.sqrt(7.0) * largest_step * stride)
    for _ in range(ZOOM_ROUNDS + 1):
        layers = _layers(poses, keys, grids, arm, margin)
        way = _cheapest_way(layers, keys, start, reach)
        grids = np.clip(way[:, 6, None] + step * ZOOM, lower, upper)
        if start is not None and np.abs(way[0] - start).max() < 1e-6:
            grids[0] = start[6]
        step *= 2.0 / (len(ZOOM) - 1)
    return _completed(poses, keys, way, arm, margin, largest_step)


def _layers(poses: Array, keys: NDArray[np.intp], grids: Array, arm: Panda, margin: float) -> list[_Layer]:
    joints = solve(poses[keys, None], grids, limits=arm.limits, margin=margin).reshape(len(keys), -1, 7)
    valid = ~np.isnan(joints[..., 0])
    if not valid.any(axis=1).all():
        index = int(keys[np.argmin(valid.any(axis=1))])
        raise KinematicsError(
            f"pose {index} of the path: {_described(poses[index])} can't be reached with {margin:.3f} rad "
            "from the joint limits"
        )
    found = joints[valid]
    nearness = np.minimum(found - arm.limits.lower, arm.limits.upper - found)
    cost = np.square(np.maximum(0.0, 1.0 - nearness / COMFORT)).sum(axis=-1)
    cost += np.square(np.maximum(0.0, 1.0 - arm.manipulability(found) / DEXTERITY))
    ends = np.cumsum(valid.sum(axis=1))[:-1]
    return [
        _Layer(q, c / len(keys)) for q, c in zip(np.split(found, ends), np.split(cost, ends), strict=True)
    ]


def _cheapest_way(layers: list[_Layer], keys: NDArray[np.intp], start: Array | None, reach: float) -> Array:
    """Solutions (K, 7), one a layer, of least total cost (Viterbi), no step longer than ``reach``."""
    total = layers[0].cost.copy()
    if start is not None:
        total += len(layers) * np.square(layers[0].joints - start).sum(axis=-1)
    came_from = []
    for k, (before, after) in enumerate(zip(layers[:-1], layers[1:], strict=True), start=1):
        square = (
            np.square(before.joints).sum(axis=1)[:, None]
            + np.square(after.joints).sum(axis=1)
            - 2.0 * before.joints @ after.joints.T
        )
        arrival = np.where(square <= reach**2, total[:, None] + len(layers) * square, np.inf)
        best = np.argmin(arrival, axis=0)
        total = arrival[best, np.arange(len(best))] + after.cost
        if not np.isfinite(total).any():
            raise KinematicsError(
                f"pose {int(keys[k])} of the path: the arm can't get there from pose {int(keys[k - 1])} without a jump"
            )
        came_from.append(best)
    state = int(np.argmin(total))
    way = [layers[-1].joints[state]]
    for layer, best in zip(reversed(layers[:-1]), reversed(came_from), strict=True):
        state = int(best[state])
        way.append(layer.joints[state])
    return np.stack(way[::-1])


def _completed(
    poses: Array, keys: NDArray[np.intp], way: Array, arm: Panda, margin: float, largest_step: float
) -> Array:
    """All poses solved at the interpolated q7, on the branch nearest to the way; checked for jumps."""
    if len(keys) > 1:
        expected = np.asarray(PchipInterpolator(keys, way)(np.arange(len(poses))))
    else:
        expected = way
    joints = solve(poses, expected[:, 6], limits=arm.limits, margin=margin * 0.999)
    distance = np.square(joints - expected[:, None]).sum(axis=-1)
    distance[np.isnan(distance)] = np.inf
    nearest = np.argmin(distance, axis=1)
    path = joints[np.arange(len(poses)), nearest]
    if np.isnan(path).any():
        index = int(np.argmax(np.isnan(path).any(axis=1)))
        raise KinematicsError(f"pose {index} of the path: no solution between its neighbours' joint angles")
    steps = np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0)
    if (steps > largest_step).any():
        index = int(np.argmax(steps > largest_step)) + 1
        raise KinematicsError(
            f"pose {index} of the path: a joint would jump by {steps[index - 1]:.2f} rad; "
            "is the path dense, and away from singularities?"
        )
    return path


def _described(T: Array) -> str:
    x, y, z = T[:3, 3]
    return f"flange at ({x:.3f}, {y:.3f}, {z:.3f}) m"
