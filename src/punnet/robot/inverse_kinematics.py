"""Analytic inverse kinematics of the Panda, with the last joint as the free parameter.

Seven joints for six coordinates: a flange pose and q7 leave finitely many arms. With q7 known the wrist W
(where the axes of joints 5 and 6 meet) and frame 6 are known. The shoulder S (axes of joints 1–3), the
elbow E (origin of frame 4) and W form a triangle in a plane normal to joint 4's axis:

* its side |SW| gives q4 by the law of cosines: two elbows, of which the second lies within the limits
  only for a nearly stretched arm (q4 above −0.47 rad);
* the forearm z5 lies in the plane of x6 and y6 and makes a known angle with WS: two solutions for q6;
* z5, W and S give E, its plane and so frame 4; frames 3 and 5 follow by undoing q4 and q6, hence q5;
* the direction of the upper arm z3 is (s2 c1, s2 s1, c2): two solutions for (q1, q2), and q3 follows.

Branch ``4 · elbow + 2 · wrist + shoulder`` of the eight. Everything here is batched: shapes broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.movement import JointLimits
from punnet.robot.panda import (
    ELBOW_OFFSET,
    FLANGE_LENGTH,
    FOREARM,
    PANDA_LIMITS,
    SHOULDER_HEIGHT,
    UPPER_ARM,
    WRIST_OFFSET,
)

__all__ = ["BRANCHES", "branches", "solve", "solve_any"]

BRANCHES = 8
"""Arms at most for one pose and one q7."""

Array = NDArray[np.float64]

UPPER_SIDE = float(np.hypot(UPPER_ARM, ELBOW_OFFSET))
LOWER_SIDE = float(np.hypot(FOREARM, ELBOW_OFFSET))
# Angle from ES to EW in joint 4's plane at q4 = 0.
ELBOW_ZERO = float(np.arctan2(FOREARM, -ELBOW_OFFSET) - np.arctan2(-UPPER_ARM, -ELBOW_OFFSET))
# The second elbow has q4 = 2π − ELBOW_ZERO − γ; below this γ it lies above q4 = 0.1, outside the limits.
SECOND_ELBOW = 2 * np.pi - ELBOW_ZERO - 0.1

# The sweep of q7: points, poses at a time; then local minima to search around, points and rounds of each.
SWEEP = 40
SWEEP_BATCH = 500
DIPS = 8
ZOOM_POINTS = 17
ZOOMS = 6


def solve(
    T_base_flange: ArrayLike,
    q7: ArrayLike,
    *,
    limits: JointLimits = PANDA_LIMITS,
    margin: float = 0.0,
) -> Array:
    """All arms that bring the flange to a pose with a given last joint, inside the limits.

    Parameters
    ----------
    T_base_flange
        Poses (..., 4, 4) in metres, base frame.
    q7
        Last joint (...) in radians; broadcasts against the poses: ``solve(T[:, None], grid)`` sweeps it.
    limits
        Position limits; solutions outside become NaN.
    margin
        Radians to keep from them.

    Returns
    -------
    NDArray
        Joints (..., 8, 7), branch by branch, NaN rows where a branch does not exist.

    Raises
    ------
    ShapeError
        If the poses are not (..., 4, 4) or the shapes don't broadcast.
    """
    joints, overshoot = branches(T_base_flange, q7)
    outside = np.maximum(limits.lower - joints, joints - limits.upper).max(axis=-1)
    joints[(overshoot > 0) | ~(outside <= -margin)] = np.nan
    return joints


def branches(T_base_flange: ArrayLike, q7: ArrayLike) -> tuple[Array, Array]:
    """Branches (..., 8, 7) without regard to limits, and how far (..., 8) each is from existing.

    Where a triangle can't be closed the nearest flat one is taken and its overshoot (of a cosine beyond 1)
    returned; a small overshoot means that a solution lies close by. Branches that can't be anywhere near the
    limits have an infinite overshoot. Joints are wrapped into the period that holds the limits.
    """
    T = np.asarray(T_base_flange, dtype=np.float64)
    q7 = np.asarray(q7, dtype=np.float64)
    if T.shape[-2:] != (4, 4):
        raise ShapeError(f"inverse kinematics: poses must be (..., 4, 4), got {T.shape}")
    try:
        shape = np.broadcast_shapes(T.shape[:-2], q7.shape)
    except ValueError as error:
        raise ShapeError(
            f"inverse kinematics: poses {T.shape[:-2]} and q7 {q7.shape} don't broadcast"
        ) from error
    count = int(np.prod(shape))
    angle = np.broadcast_to(q7, shape).reshape(count)
    columns = np.moveaxis(np.broadcast_to(T[..., :3, :], (*shape, 3, 4)).reshape(count, 3, 4), 0, -1)
    joints = np.full((count, 2, 4, 7), np.nan)
    overshoot = np.full((count, 2, 4), np.inf)

    wrist, x6, y6 = _wrist(columns, angle)
    index, elbow, gamma, excess = _elbows(wrist)
    arm = _arms(
        wrist[:, index], x6[:, index], y6[:, index], _wrapped(np.where(elbow, -gamma, gamma) - ELBOW_ZERO)
    )
    joints[index, elbow, :, :6] = arm[0]
    joints[index, elbow, :, 6] = angle[index, None]
    overshoot[index, elbow] = np.maximum(arm[1], excess[:, None])
    return joints.reshape(*shape, BRANCHES, 7), overshoot.reshape(*shape, BRANCHES)


def _wrapped(angle: Array) -> Array:
    """Angles in (−π, π]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2 * np.pi))


def _wrist(columns: Array, q7: Array) -> tuple[Array, Array, Array]:
    """W − S and the axes x6, y6, each (3, M), from the columns (3, 4, M) of the flange pose."""
    x, y, z, origin = columns[:, 0], columns[:, 1], columns[:, 2], columns[:, 3]
    x6 = np.cos(q7) * x - np.sin(q7) * y
    wrist = origin - FLANGE_LENGTH * z - WRIST_OFFSET * x6
    wrist[2] -= SHOULDER_HEIGHT
    return wrist, x6, -z


def _elbows(wrist: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Which poses to solve with which elbow: (pose index, elbow, angle γ at E between S and W, overshoot)."""
    square = np.einsum("im,im->m", wrist, wrist)
    cosine = (UPPER_SIDE**2 + LOWER_SIDE**2 - square) / (2 * UPPER_SIDE * LOWER_SIDE)
    excess = np.maximum(np.abs(cosine) - 1.0, 0.0)
    gamma = np.arccos(np.clip(cosine, -1.0, 1.0))
    second = np.flatnonzero(gamma > SECOND_ELBOW)
    index = np.concatenate((np.arange(len(gamma)), second))
    elbow = np.repeat((0, 1), (len(gamma), len(second)))
    return index, elbow, gamma[index], excess[index]


def _arms(wrist: Array, x6: Array, y6: Array, q4: Array) -> tuple[Array, Array]:
    """First six joints (M, 4, 6) and overshoots (M, 4) for both wrists and both shoulders."""
    c4, s4 = np.cos(q4), np.sin(q4)
    # S seen from W, in frame 4: x4 and y4 components (y4 is the forearm's axis z5).
    along_x = ELBOW_OFFSET - c4 * ELBOW_OFFSET - s4 * UPPER_ARM
    along_y = -FOREARM + s4 * ELBOW_OFFSET - c4 * UPPER_ARM
    shoulder = -wrist
    # z5 = sin q6 · x6 + cos q6 · y6 and z5 · WS = along_y.
    sine_part = np.einsum("im,im->m", x6, shoulder)
    cosine_part = np.einsum("im,im->m", y6, shoulder)
    radius = np.maximum(np.hypot(sine_part, cosine_part), 1e-12)
    ratio = along_y / radius
    excess = np.maximum(np.abs(ratio) - 1.0, 0.0)
    spread = np.arccos(np.clip(ratio, -1.0, 1.0))
    q6 = np.arctan2(sine_part, cosine_part) + np.array(((1.0,), (-1.0,))) * spread  # (2, M)
    c6, s6 = np.cos(q6), np.sin(q6)
    x6, y6, shoulder = x6[:, None], y6[:, None], shoulder[:, None]  # (3, 1, M)
    z5 = s6 * x6 + c6 * y6
    x4 = np.copysign(1.0, along_x) * (shoulder - along_y * z5)
    # Flat triangles leave a rest along z5; frame 4 must be orthonormal for the angles to be exact.
    x4 -= np.einsum("iwm,iwm->wm", x4, z5) * z5
    x4 /= np.maximum(np.sqrt(np.einsum("iwm,iwm->wm", x4, x4)), 1e-12)
    z4 = np.cross(x4, z5, axis=0)
    x5 = c6 * x6 - s6 * y6
    q5 = np.arctan2(-np.einsum("iwm,iwm->wm", x5, z4), np.einsum("iwm,iwm->wm", x5, x4))
    q1, q2, q3 = _shoulder(c4 * x4 - s4 * z5, s4 * x4 + c4 * z5)  # (2, 2, M): shoulder, wrist
    joints = np.stack(np.broadcast_arrays(q1, q2, q3, q4, q5, np.mod(q6 + np.pi / 2, 2 * np.pi) - np.pi / 2))
    flat = joints.transpose(3, 2, 1, 0).reshape(len(q4), 4, 6)
    return flat, np.broadcast_to(excess[:, None], (len(q4), 4))


def _shoulder(x3: Array, z3: Array) -> tuple[Array, Array, Array]:
    """Joints 1–3, each (2, W, M), from the axes of frame 3, each (3, W, M)."""
    sign = np.array((1.0, -1.0))[:, None, None]
    q2 = sign * np.arctan2(np.hypot(z3[0], z3[1]), z3[2])
    q1 = np.arctan2(sign * z3[1], sign * z3[0])
    c1, s1, c2, s2 = np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2)
    along_y1 = c1 * x3[1] - s1 * x3[0]
    along_x2 = c2 * (c1 * x3[0] + s1 * x3[1]) - s2 * x3[2]
    return q1, q2, np.arctan2(along_y1, along_x2)


def solve_any(T_base_flange: ArrayLike, *, limits: JointLimits = PANDA_LIMITS, margin: float = 0.0) -> Array:
    """One arm for each pose: of a sweep over q7 the one farthest from its limits, NaN where none was found.

    Where the sweep finds nothing it is refined: the q7 that come closest to a solution are searched
    around, so that solutions that exist for a sliver of q7 only are found too.

    Parameters
    ----------
    T_base_flange
        Poses (..., 4, 4) in metres, base frame.
    limits, margin
        Position limits and the radians to keep from them.

    Returns
    -------
    NDArray
        Joints (..., 7).
    """
    T = np.asarray(T_base_flange, dtype=np.float64)
    if T.shape[-2:] != (4, 4):
        raise ShapeError(f"inverse kinematics: poses must be (..., 4, 4), got {T.shape}")
    poses = T.reshape(-1, 4, 4)
    joints = np.full((len(poses), 7), np.nan)
    for start in range(0, len(poses), SWEEP_BATCH):
        part = slice(start, start + SWEEP_BATCH)
        joints[part] = _swept(poses[part], limits, margin)
    return joints.reshape(*T.shape[:-2], 7)


def _swept(poses: Array, limits: JointLimits, margin: float) -> Array:
    grid = np.linspace(limits.lower[6] + margin, limits.upper[6] - margin, SWEEP)
    step = grid[1] - grid[0]
    joints, miss = _best(poses[:, None], grid, limits)
    best = np.argmin(miss, axis=1)
    found = np.take_along_axis(joints, best[:, None, None], axis=1)[:, 0]
    lacking = np.flatnonzero(~(np.take_along_axis(miss, best[:, None], axis=1)[:, 0] <= -margin))
    found[lacking] = np.nan
    # Centres to search around: the lowest local minima of the miss over q7.
    padded = np.pad(miss[lacking], ((0, 0), (1, 1)), constant_values=np.inf)
    dip = (padded[:, 1:-1] <= padded[:, :-2]) & (padded[:, 1:-1] <= padded[:, 2:])
    order = np.argsort(np.where(dip, padded[:, 1:-1], np.inf), axis=1)[:, :DIPS]
    centres = grid[order]
    for _ in range(ZOOMS):
        if not len(lacking):
            break
        around = np.clip(centres[..., None] + step * np.linspace(-1.0, 1.0, ZOOM_POINTS), grid[0], grid[-1])
        joints, miss = _best(poses[lacking, None, None], around, limits)
        best = np.argmin(miss, axis=2)[..., None]
        centres = np.take_along_axis(around, best, axis=2)[..., 0]
        closest = np.take_along_axis(miss, best, axis=2)[..., 0]
        winner = np.argmin(closest, axis=1)
        rows = np.arange(len(lacking))
        done = closest[rows, winner] <= -margin
        found[lacking[done]] = joints[rows, winner, best[rows, winner, 0]][done]
        lacking, centres = lacking[~done], centres[~done]
        step *= 2.0 / (ZOOM_POINTS - 1)
    return found


def _best(T: Array, q7: Array, limits: JointLimits) -> tuple[Array, Array]:
    """Best branch (..., 7) of each pose and q7, and by how much (...) it misses the limits or existence."""
    joints, overshoot = branches(T, q7)
    outside = np.maximum(limits.lower - joints, joints - limits.upper).max(axis=-1)
    miss = np.where(overshoot > 0, np.maximum(outside, overshoot), outside)
    miss = np.where(np.isnan(miss), np.inf, miss)
    branch = np.argmin(miss, axis=-1)[..., None]
    return (
        np.take_along_axis(joints, branch[..., None], axis=-2)[..., 0, :],
        np.take_along_axis(miss, branch, axis=-1)[..., 0],
    )
