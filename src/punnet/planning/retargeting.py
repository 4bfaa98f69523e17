"""Demonstrations of one arm for another: what is natural is where the flange goes, and each arm has its own joints for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.errors import PlanningError
from punnet.movement import ProMP, TrajectoryDistribution
from punnet.robot import Arm, Panda
from punnet.robot.projection import projected

__all__ = ["for_arm", "retargeted"]

Array = NDArray[np.float64]

REACHES = 200
PHASES = 75
FEWEST = 0.5
"""Share of the drawn reaches that the other arm has to be able to follow."""
LIMIT_MARGIN = 0.02
"""Radians from the joint limits that followed reaches keep."""


def for_arm(demonstrated: TrajectoryDistribution, arm: Arm | None) -> tuple[TrajectoryDistribution, Arm]:
    """The Panda's demonstrations for ``arm``, a Panda if None: as they are, or :func:`retargeted` if it is another."""
    if arm is None:
        arm = Panda()
    return (demonstrated if isinstance(arm, Panda) else retargeted(demonstrated, Panda(), arm)), arm


def retargeted(
    demonstrated: TrajectoryDistribution, source: Arm, arm: Arm, *, rng: np.random.Generator | None = None
) -> TrajectoryDistribution:
    """Distribution over the joints of ``arm`` whose flange moves as that of ``source`` does in ``demonstrated``.

    Reaches are drawn, their flange poses followed from the arm's home by the shortest way from pose to pose, and a distribution
    in the same basis is fitted to those joints.

    Parameters
    ----------
    demonstrated
        Over the joints of ``source``; its reaches begin near that arm's home.
    source, arm
        Whose homes hold the flange in the same pose.
    rng
        Draws the reaches; always the same ones if not given.

    Raises
    ------
    PlanningError
        If ``demonstrated`` is not over the joints of ``source``, or the arm can't follow half of the reaches; the message says
        where the first one was lost.
    """
    if demonstrated.space != "joint" or demonstrated.dimensions != source.joint_count:
        raise PlanningError(
            f"retargeting: a distribution over {source.joint_count} joints is needed, got {demonstrated.space} space with "
            f"{demonstrated.dimensions}"
        )
    phases = np.linspace(0.0, 1.0, PHASES)
    drawn = demonstrated.sample(np.random.default_rng(0) if rng is None else rng, REACHES, phases)
    poses = source.forward_kinematics(drawn)
    joints = np.full((REACHES, PHASES, arm.joint_count), np.nan)
    before = np.tile(arm.home, (REACHES, 1))
    for instant in range(PHASES):
        before = joints[:, instant] = projected(arm, before, poses[:, instant])
    followed = arm.within_limits(joints, LIMIT_MARGIN).all(axis=1)
    if followed.mean() < FEWEST:
        lost = int(np.argmin(followed))
        instant = int(np.argmin(arm.within_limits(joints[lost], LIMIT_MARGIN)))
        raise PlanningError(
            f"retargeting: the arm can follow {followed.sum()} of {REACHES} demonstrated reaches; the first is lost with the "
            f"flange at {np.round(poses[lost, instant, :3, 3], 3).tolist()} m. Mount it nearer, or give another home"
        )
    count = int(followed.sum())
    return ProMP(demonstrated.basis).fit(
        list(joints[followed]), durations=[demonstrated.duration] * count, names=arm.limits.joint_names
    )
