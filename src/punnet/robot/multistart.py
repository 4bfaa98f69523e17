"""Inverse kinematics of any serial arm: Newton's steps from many starts at once.

For arms without a closed form of their own (:mod:`punnet.robot.inverse_kinematics` has the Panda's). Each start ends in one
of the arm's postures or nowhere; the starts are the reference and a fixed, even spread over the joint ranges, so that the same
question has the same answer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from punnet.movement import JointLimits
from punnet.robot.arm import Arm
from punnet.robot.projection import projected

__all__ = ["STARTS", "nearest_turns", "postures"]

Array = NDArray[np.float64]

STARTS = 96
"""Starts besides the reference, unless told otherwise."""
FULL_TURN = 2.0 * np.pi


def postures(arm: Arm, poses: Array, reference: Array, margin: float, starts: int = STARTS) -> Array:
    """Joints (N, S, J) that hold flange poses (N, 4, 4), NaN where a start led nowhere or beyond the limits.

    Joints that may turn more than once are given with the turns that bring them nearest to ``reference`` (J,). The first of
    the S = ``starts`` + 1 is the one reached from the reference itself.
    """
    count = len(poses)
    begin = np.concatenate((reference[None], _spread(arm.limits, starts)))
    joints = projected(
        arm,
        np.broadcast_to(begin, (count, *begin.shape)).reshape(-1, arm.joint_count),
        np.repeat(poses, len(begin), axis=0),
    ).reshape(count, len(begin), arm.joint_count)
    joints = nearest_turns(joints, reference, arm.limits, margin)
    joints[~arm.within_limits(joints, margin)] = np.nan
    return joints


def nearest_turns(joints: Array, reference: Array, limits: JointLimits, margin: float) -> Array:
    """Joints (..., J), each moved by whole turns to where it is nearest to ``reference``, within the limits if it can be."""
    lower, upper = limits.lower + margin, limits.upper - margin
    turns = np.round((reference - joints) / FULL_TURN)
    lowest, highest = np.ceil((lower - joints) / FULL_TURN), np.floor((upper - joints) / FULL_TURN)
    return np.asarray(joints + FULL_TURN * np.clip(turns, lowest, np.maximum(lowest, highest)))


def _spread(limits: JointLimits, count: int) -> Array:
    """(S, J) evenly over the joint ranges, of joints that turn more than once over one turn."""
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    narrow = upper <= lower
    lower, upper = np.where(narrow, limits.lower, lower), np.where(narrow, limits.upper, upper)
    spread = qmc.Halton(len(limits), scramble=False).random(count + 1)[1:]
    return np.asarray(lower + spread * (upper - lower))
