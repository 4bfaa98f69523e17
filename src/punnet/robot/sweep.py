"""The cheapest joint path through all postures found at each pose, by dynamic programming over the poses.

The Panda's postures are q7 × branches: first over a coarse grid of q7, then over ever finer ones around the path found. Another
arm's are those of :mod:`punnet.robot.multistart`, once. J is the arm's number of joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from punnet.errors import KinematicsError
from punnet.robot.arm import Arm
from punnet.robot.inverse_kinematics import solve
from punnet.robot.multistart import postures
from punnet.robot.panda import Panda
from punnet.robot.projection import projected

__all__ = ["PathRequest", "discomfort", "swept_path"]

Array = NDArray[np.float64]

SWEEP = 48
ZOOM = np.linspace(-1.0, 1.0, 9)
ZOOM_ROUNDS = 3
COMFORT = 0.4
"""Nearer than this (radians) to a limit costs."""
DEXTERITY = 0.03
"""A manipulability below this costs; home has 0.057."""
LARGEST_REACH = 1.2
"""Radians (Euclidean) between two poses of a sweep that skips poses."""
AT_START = 0.05
"""Radians: a start this near to a solution of the first pose counts as being there."""


@dataclass(frozen=True, eq=False)
class PathRequest:
    """What :func:`~punnet.robot.path.follow_path` was asked for, checked."""

    poses: Array
    start: Array | None
    arm: Arm
    margin: float
    largest_step: float

    @cached_property
    def first(self) -> Array | None:
        """Joints (J,) for the first pose, if ``start`` is there already but for a measuring error."""
        if self.start is None:
            return None
        joints = projected(self.arm, self.start[None], self.poses[:1])[0]
        return joints if np.abs(joints - self.start).max() < AT_START else None


@dataclass(frozen=True, eq=False)
class _Layer:
    """Solutions (S, J) of one pose and their own cost (S,)."""

    joints: Array
    cost: Array


def swept_path(request: PathRequest, stride: int) -> Array:
    """Guess (T, J) by dynamic programming over every ``stride``-th pose, interpolated between."""
    count = len(request.poses)
    keys = np.unique(np.append(np.arange(0, count, stride), count - 1))
    reach = min(LARGEST_REACH, np.sqrt(request.arm.joint_count) * request.largest_step * stride)
    if isinstance(request.arm, Panda):
        way = _panda_way(request, request.arm, keys, reach)
    else:
        reference = request.arm.home if request.start is None else request.start
        joints = postures(request.arm, request.poses[keys], reference, request.margin)
        way = _cheapest_way(_layers(request, keys, joints), keys, request.start, reach)
    return np.asarray(PchipInterpolator(keys, way)(np.arange(count))) if len(keys) > 1 else way


def _panda_way(request: PathRequest, arm: Panda, keys: NDArray[np.intp], reach: float) -> Array:
    lower = arm.limits.lower[6] + request.margin
    upper = arm.limits.upper[6] - request.margin
    step = (upper - lower) / (SWEEP - 1)
    grids = np.broadcast_to(np.linspace(lower, upper, SWEEP), (len(keys), SWEEP))
    for _ in range(ZOOM_ROUNDS + 1):
        joints = solve(request.poses[keys, None], grids, limits=arm.limits, margin=request.margin)
        layers = _layers(request, keys, joints.reshape(len(keys), -1, 7))
        way = _cheapest_way(layers, keys, request.start, reach)
        grids = np.clip(way[:, 6, None] + step * ZOOM, lower, upper)
        step *= 2.0 / (len(ZOOM) - 1)
    return way


def _layers(request: PathRequest, keys: NDArray[np.intp], joints: Array) -> list[_Layer]:
    """Of joints (K, S, J) those that exist, pose by pose; the first pose's is the start if the arm is there."""
    arm, margin, poses = request.arm, request.margin, request.poses
    valid = ~np.isnan(joints[..., 0])
    if not valid.any(axis=1).all():
        index = int(keys[np.argmin(valid.any(axis=1))])
        raise KinematicsError(
            f"pose {index} of the path: flange at {np.round(poses[index, :3, 3], 3).tolist()} m "
            f"can't be reached inside the joint limits less {margin:.3f} rad"
        )
    found = joints[valid]
    cost = discomfort(found, arm) / len(keys)
    ends = np.cumsum(valid.sum(axis=1))[:-1]
    layers = [_Layer(q, c) for q, c in zip(np.split(found, ends), np.split(cost, ends), strict=True)]
    first = request.first
    if first is not None:
        layers[0] = _Layer(first[None], np.zeros(1))
    return layers


def discomfort(joints: Array, arm: Arm) -> Array:
    """Cost (N,) of being near limits and singularities."""
    nearness = np.minimum(joints - arm.limits.lower, arm.limits.upper - joints)
    near_limits = np.square(np.maximum(0.0, 1.0 - nearness / COMFORT)).sum(axis=-1)
    return np.asarray(near_limits + np.square(np.maximum(0.0, 1.0 - arm.manipulability(joints) / DEXTERITY)))


def _cheapest_way(layers: list[_Layer], keys: NDArray[np.intp], start: Array | None, reach: float) -> Array:
    """Solutions (K, J), one a layer, of least total cost (Viterbi), no step longer than ``reach``."""
    total = layers[0].cost.copy()
    if start is not None:
        total += len(layers) * np.square(layers[0].joints - start).sum(axis=-1)
    came_from = []
    for k, (before, after) in enumerate(pairwise(layers), start=1):
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
                f"pose {int(keys[k])} of the path: no way found from pose {int(keys[k - 1])} to it "
                "without a jump"
            )
        came_from.append(best)
    state = int(np.argmin(total))
    way = [layers[-1].joints[state]]
    for layer, best in zip(reversed(layers[:-1]), reversed(came_from), strict=True):
        state = int(best[state])
        way.append(layer.joints[state])
    return np.stack(way[::-1])
