"""What a motion may do, checked on the very trajectory that is sent to the arm; and a robot that refuses all others.

A :class:`MotionGuard` looks at a trajectory between its samples too: where the arm is at its start, rest at both ends,
position, velocity, acceleration and jerk, the arm's distance from itself and from structure. :class:`GuardedRobot` stands
before a robot and hands on only what passes; what happens on the way (contact forces, an arm that does not follow) is
the robot's own to watch, within the ``force_limit`` that it is told.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.movement import JointTrajectory
from punnet.robot.arm import Arm
from punnet.robot.arm_shape import Boxes, self_clearance, structure_clearance
from punnet.robot.panda import Panda
from punnet.robot.protocol import CutResult, GripResult, MotionResult, Robot
from punnet.scene import Frame

__all__ = ["GuardedRobot", "MotionGuard", "Refusal"]

START_TOLERANCE = 0.05
"""Radians between where the arm is and where a trajectory begins."""
AT_REST = 1e-3
"""Radians per second that count as standing still."""
ROUNDING = 1.001
"""Factor on limits for what is lost in sampling."""
POSITION_ROUNDING = 1e-6
SUBSAMPLES = 4
CHECKED_STEP = 0.04
"""Radians that a joint may move between two postures that are checked for collisions."""
_DERIVATIVES = ((1, "velocity", "rad/s"), (2, "acceleration", "rad/s²"), (3, "jerk", "rad/s³"))


class Refusal(str):
    """Why a trajectory is not executed, as a line for the log."""


@dataclass(frozen=True, eq=False)
class MotionGuard:
    """Says why a trajectory must not be executed.

    Parameters
    ----------
    arm
        With its limits.
    structure
        What must not be run into; see :class:`~punnet.robot.arm_shape.Boxes`. Punnets are not among it: the tool
        reaches into them, and the force limit guards that.
    clearance
        Metres that arm and picker keep from themselves and from structure, by cautious spheres.

    Raises
    ------
    ConfigurationError
        If the clearance is no length.
    """

    arm: Arm = field(default_factory=Panda)
    structure: Boxes = field(default_factory=Boxes.none)
    clearance: float = 0.015

    def __post_init__(self) -> None:
        if not 0 <= self.clearance < 1:
            raise ConfigurationError(f"guard: clearance must be metres in [0, 1), got {self.clearance}")

    def refusal(self, trajectory: JointTrajectory, joints: NDArray[np.float64]) -> Refusal | None:
        """Why ``trajectory`` must not be executed by an arm that is at ``joints`` (J,); None if it may.

        What already is too near at the start may be left, but not come nearer.
        """
        if trajectory.positions.shape[1] != len(self.arm.limits):
            return Refusal(f"{trajectory.positions.shape[1]} joints, the arm has {len(self.arm.limits)}")
        if not np.isfinite(joints).all():
            return Refusal(f"the arm does not know where it is: joints {joints}")
        away = float(np.abs(trajectory.start - joints).max())
        if away > START_TOLERANCE:
            return Refusal(f"begins {away:.3f} rad from where the arm is; plan from robot.joints()")
        return self._beyond_limits(trajectory) or self._collision(trajectory)

    def _beyond_limits(self, trajectory: JointTrajectory) -> Refusal | None:
        if trajectory.velocities is None or trajectory.accelerations is None:
            return Refusal("has no velocities and accelerations, so the arm would jerk; retime the path")
        limits = self.arm.limits
        substeps = np.linspace(0.0, 1.0, SUBSAMPLES, endpoint=False)
        times = (trajectory.times[:-1, None] + substeps * np.diff(trajectory.times)[:, None]).ravel()
        times = np.append(times, trajectory.times[-1])
        positions = trajectory.sample(times)
        beyond = np.maximum(limits.lower - positions, positions - limits.upper).max(axis=0)
        joint = int(np.argmax(beyond))
        if not beyond[joint] <= POSITION_ROUNDING:
            return Refusal(f"joint {joint + 1} would go {beyond[joint]:.3f} rad beyond its limit")
        for moving in (trajectory.velocities[0], trajectory.velocities[-1]):
            if np.abs(moving).max() > AT_REST:
                return Refusal("does not begin and end at rest")
        for order, name, unit in _DERIVATIVES:
            values = np.abs(trajectory.sample(times[:-1], derivative=order))
            share = (values / getattr(limits, name)).max(axis=0)
            joint = int(np.argmax(share))
            if not share[joint] <= ROUNDING:
                value = values[:, joint].max()
                return Refusal(
                    f"{name} of joint {joint + 1} would be {value:.3g} {unit}, {share[joint]:.0%} of its limit"
                )
        return None

    def _collision(self, trajectory: JointTrajectory) -> Refusal | None:
        postures = _spread(trajectory.positions)
        for what, distance in (
            ("itself", self_clearance(self.arm, postures)),
            ("structure", structure_clearance(self.arm, postures, self.structure)),
        ):
            nearest = int(np.argmin(distance))
            if distance[nearest] < min(self.clearance, float(distance[0]) - 1e-6):
                share = nearest / max(1, len(postures) - 1)
                return Refusal(
                    f"the arm would come within {1000 * distance[nearest]:.0f} mm of {what}, {share:.0%} of the way"
                )
        return None


def _spread(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of positions (T, J) those that lie :data:`CHECKED_STEP` apart, first and last always."""
    steps = np.abs(np.diff(positions, axis=0)).max(axis=1)
    travelled = np.concatenate(([0.0], np.cumsum(steps)))
    wanted = np.arange(0.0, travelled[-1], CHECKED_STEP)
    rows = np.unique(np.concatenate((np.searchsorted(travelled, wanted), [len(positions) - 1])))
    return np.asarray(positions[rows])


class GuardedRobot:
    """A robot that executes only what a guard lets pass; a trajectory that it refuses moves nothing.

    Parameters
    ----------
    robot
        What moves.
    guard
        What it may do.
    """

    def __init__(self, robot: Robot, guard: MotionGuard) -> None:
        self.guard = guard
        self._robot = robot

    @property
    def time(self) -> float:
        """Seconds on the robot's clock."""
        return self._robot.time

    def joints(self) -> NDArray[np.float64]:
        """Measured joint angles (J,)."""
        return self._robot.joints()

    def look(self) -> Frame:
        """RGB-D frame of the wrist camera."""
        return self._robot.look()

    def refusal(self, trajectory: JointTrajectory) -> Refusal | None:
        """Why :meth:`follow` would refuse a trajectory from where the arm is now; None if it would not."""
        return self.guard.refusal(trajectory, self._robot.joints())

    def follow(self, trajectory: JointTrajectory, force_limit: float | None = None) -> MotionResult:
        """Execute a trajectory that passes; else say why not, ``unsafe: …``, and stay."""
        refusal = self.refusal(trajectory)
        if refusal is not None:
            return MotionResult(False, f"unsafe: {refusal}")
        return self._robot.follow(trajectory, force_limit)

    def separate(self, opening: float) -> None:
        """Set the separation fingers."""
        self._robot.separate(opening)

    def grip(self) -> GripResult:
        """Close the grasping fingers."""
        return self._robot.grip()

    def cut(self) -> CutResult:
        """Drive the blade once."""
        return self._robot.cut()

    def release(self, opening: float = 1.0) -> None:
        """Open the grasping fingers."""
        self._robot.release(opening)

    def weigh_punnet(self, punnet: int) -> float | None:
        """Reading of the weigh cell under a punnet, grams."""
        return self._robot.weigh_punnet(punnet)
