"""The planner that needs no network: demonstrated reaches conditioned on where depth says the berry hangs.

1. The demonstrated distribution is conditioned on the joints that the arm starts from.
2. For a small fan of approach directions the most likely joints at the grip pose are found
   (:mod:`punnet.planning.likely_joints`) and ranked by likelihood, distance from limits and singularities.
3. For the best, joints are found on the straight line in, and the distribution is conditioned on all of them
   jointly. The next one is tried if the mean does not come in straight or leaves the limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.bundle import load_bundle
from punnet.errors import ConfigurationError, PlanningError
from punnet.movement import TrajectoryDistribution, ViaPoint
from punnet.planning.approach import (
    angles_of_approach,
    approach_poses,
    approach_rotation,
    comfortable_angles,
)
from punnet.planning.likely_joints import likely_joints
from punnet.planning.retargeting import for_arm
from punnet.robot import Arm
from punnet.scene import Frame, Target

__all__ = ["APPROACH_DISTANCE", "APPROACH_PHASE", "ProMPDepthPlanner"]

APPROACH_DISTANCE = 0.09
"""Metres before the grip point from where the tool comes in on a straight line."""
APPROACH_PHASE = 0.7
"""Phase at which it is there; from then on it slows down evenly until it stops at phase 1."""

VIA_PHASES = np.array([0.7, 0.8, 0.9, 1.0])
YAW_FAN = np.deg2rad([0.0, -12.0, 12.0])
PITCH_FAN = np.deg2rad([0.0, 7.0, -4.0, 16.0])
CHECKED_DISTANCE = 0.07
LARGEST_DEVIATION = 0.004
CHECKED_PHASES = np.linspace(0.0, 1.0, 101)
# Costs that match a squared Mahalanobis distance of about one at this many radians and this manipulability.
LOW_MARGIN = 0.15
LOW_MANIPULABILITY = 0.012
SMALLEST_MARGIN = 0.02


@dataclass(eq=False)
class ProMPDepthPlanner:
    """Plans reaches by conditioning demonstrated ones on the picking point.

    Parameters
    ----------
    promp
        Joint-space distribution of the demonstrated reaches, over the arm's joints; from phase
        :data:`APPROACH_PHASE` on a straight approach.
    arm
        The arm with its tool.
    broadening
        Radians of standard deviation added to every weight, so that starts and berries that no demonstration
        had are reached too.
    name
        Name of the planner.

    Raises
    ------
    ConfigurationError
        If the distribution is not one over the arm's joints.
    """

    promp: TrajectoryDistribution
    arm: Arm
    broadening: float = 0.05
    name: str = "promp-depth"

    def __post_init__(self) -> None:
        if self.promp.space != "joint" or self.promp.dimensions != self.arm.joint_count:
            raise ConfigurationError(
                f"{self.name}: a joint-space distribution over {self.arm.joint_count} joints is needed, "
                f"got {self.promp.space} space with {self.promp.dimensions}"
            )
        self._prior = self.promp.broadened(self.broadening)

    @classmethod
    def from_bundle(
        cls, bundle: str | Path = "promp-reach-sim", *, arm: Arm | None = None
    ) -> ProMPDepthPlanner:
        """Planner with the distribution of a bundle of kind ``promp``, by default the one that comes along.

        For an arm other than the Panda it is :func:`~punnet.planning.retargeting.retargeted`.

        Raises
        ------
        BundleError
            If the bundle is damaged or of another kind.
        FileFormatError
            If its ``promp.json`` is not a trajectory distribution.
        PlanningError
            If the arm can't follow the demonstrations.
        """
        data = load_bundle(bundle, kind="promp").read_json("promp.json")
        return cls(*for_arm(TrajectoryDistribution.from_json(data), arm))

    def plan(self, frame: Frame, target: Target, start: ArrayLike) -> TrajectoryDistribution:
        """Plan a distribution of joint-space reaches from ``start`` to the target's picking point.

        The mean's tool comes in along a straight line (within 4 mm over the last 70 mm), along
        ``target.approach`` if that is given, and ends at the picking point.

        Parameters
        ----------
        frame
            What the camera saw; only ``target.picking_point``, which comes from its depth, is used.
        target
            The berry.
        start
            Joints (J,) that the arm is at, radians.

        Raises
        ------
        PlanningError
            ``no depth: …`` without a picking point, ``out of reach: …`` if no posture brings the tool there,
            and ``no straight approach: …`` if none of those can be entered on a straight line.
        """
        q_start = np.asarray(start, dtype=np.float64)
        if q_start.shape != (self.arm.joint_count,) or not np.isfinite(q_start).all():
            raise PlanningError(
                f"start: {self.arm.joint_count} joint angles are needed, got {q_start.shape} {start!r}"
            )
        point = target.picking_point
        if point is None:
            raise PlanningError(
                f"no depth: berry {target.berry_id} has no picking point in space; look again from elsewhere"
            )
        prior = self._prior
        via_start = ViaPoint(0.0, q_start)
        started = prior.condition([via_start])
        reasons = []
        for end, rotation in self._ranked_ends(started, target, point):
            via_points = self._approach(started, point, end, rotation)
            if via_points is None:
                reasons.append("the arm can't follow the line in")
                continue
            planned = prior.condition([via_start, *via_points])
            deviation = self._deviation(planned, point, rotation)
            if deviation > LARGEST_DEVIATION:
                reasons.append(f"the tool would leave the line in by {1e3 * deviation:.0f} mm")
            elif not self.arm.within_limits(planned.mean(CHECKED_PHASES), SMALLEST_MARGIN).all():
                reasons.append("a joint would come to its limit")
            else:
                return planned
        raise PlanningError(
            f"no straight approach: berry {target.berry_id} at {_metres(point)}: "
            f"{'; '.join(dict.fromkeys(reasons))}"
        )

    def _ranked_ends(
        self, started: TrajectoryDistribution, target: Target, point: NDArray[np.float64]
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Joints at the grip pose and its rotation, for each direction that is reachable, best first."""
        rotations = _fan(target, point)
        poses = approach_poses(point, rotations, [0.0])[:, 0]
        joints, distance = likely_joints(
            self.arm, poses, started.mean([1.0])[0], started.covariance([1.0])[0]
        )
        reached = np.isfinite(distance)
        if not reached.any():
            raise PlanningError(
                f"out of reach: no posture of the arm brings the tool to berry {target.berry_id} "
                f"at {_metres(point)}"
            )
        joints, rotations, distance = joints[reached], rotations[reached], distance[reached]
        margin = np.maximum(self.arm.limit_margin(joints), 1e-3)
        dexterity = np.maximum(self.arm.manipulability(joints), 1e-4)
        cost = distance + (LOW_MARGIN / margin) ** 2 + (LOW_MANIPULABILITY / dexterity) ** 2
        for index in np.argsort(cost):
            yield joints[index], rotations[index]

    def _approach(
        self,
        started: TrajectoryDistribution,
        grip_point: NDArray[np.float64],
        end: NDArray[np.float64],
        rotation: NDArray[np.float64],
    ) -> list[ViaPoint] | None:
        """Via-points on the line in, the last at ``end``; None if the arm can't be on the line."""
        to_end = started.condition([ViaPoint(1.0, end)])
        phases = VIA_PHASES[:-1]
        share_left = (1.0 - phases) / (1.0 - APPROACH_PHASE)
        poses = approach_poses(grip_point, rotation, APPROACH_DISTANCE * share_left**2)
        joints, _ = likely_joints(self.arm, poses, to_end.mean(phases), to_end.covariance(phases))
        if not np.isfinite(joints).all():
            return None
        return [ViaPoint(phase, q) for phase, q in zip(VIA_PHASES, (*joints, end), strict=True)]

    def _deviation(
        self, planned: TrajectoryDistribution, grip_point: NDArray[np.float64], rotation: NDArray[np.float64]
    ) -> float:
        """Largest distance (metres) of the mean's tool from the last :data:`CHECKED_DISTANCE` of the line."""
        last = CHECKED_PHASES[CHECKED_PHASES >= APPROACH_PHASE]
        points = self.arm.forward_kinematics_tool(planned.mean(last))[:, :3, 3] - grip_point
        along = points @ rotation[:, 2]
        aside = np.linalg.norm(points - along[:, None] * rotation[:, 2], axis=1)
        overshoot = max(float(along.max()), 0.0)
        return max(float(aside[along >= -CHECKED_DISTANCE].max()), overshoot)


def _fan(target: Target, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tool rotations (C, 3, 3) to try: the asked one, or a fan around the comfortable one, that one first."""
    if target.approach is not None:
        try:
            return approach_rotation(*angles_of_approach(target.approach))[None]
        except ConfigurationError as error:
            raise PlanningError(f"approach of berry {target.berry_id}: {error}") from error
    yaw, pitch = comfortable_angles(point)
    yaws, pitches = np.meshgrid(yaw + YAW_FAN, pitch + PITCH_FAN)
    return approach_rotation(yaws.ravel(), pitches.ravel())


def _metres(point: NDArray[np.float64]) -> str:
    return "({:.3f}, {:.3f}, {:.3f}) m".format(*point)
