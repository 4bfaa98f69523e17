"""The motions of a pick, each within the arm's limits: home, second view, reach, retreat, carry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.errors import KinematicsError
from punnet.geometry import invert_transform, make_transform
from punnet.harvest.config import HarvestConfig
from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.punnets import slot_offset
from punnet.movement import TrajectoryDistribution, retime
from punnet.planning.approach import angles_of_approach, approach_rotation
from punnet.robot import (
    T_FLANGE_CAMERA,
    Arm,
    GuardedRobot,
    MotionResult,
    follow_path,
    nearest_solution,
)
from punnet.robot.projection import projected

__all__ = ["Motions"]

_PATH_POINTS = 150
_STRAIGHT_STEP = 0.009  # metres between the points of a straight way
_PLACE_YAW, _PLACE_PITCH = np.deg2rad(35.0), np.deg2rad(-35.0)
_ABOVE_WALL = 0.150  # metres of the grip point over the punnet's floor while it comes in over the wall
_RELEASE_HEIGHT = 0.070  # and where it lets go: the fruit then hangs 5 to 20 mm above the floor
_SET_DOWN_SPEED = 0.5  # of the careful one: a fruit that swings against the wall faster is bruised
_SET_DOWN_FORCE = 4.0  # newtons of the tool on what it lowers, which hangs against it with less
_OFF_AGAIN = 0.008  # metres up from where it met something
_GRIP_TO_FRUIT = 0.018  # from the grip to over the fruit's middle, along the stem, which tilts with the tool
_LAYER_HEIGHT = 0.030
_BERRIES_A_LAYER = 6
_VIEW_DISTANCE = 0.38  # metres from the camera to the berry for a second view
_BELOW_POINT = 0.02  # metres below the picking point that it looks at: the berry's middle


class Motions:
    """Moves a robot through the parts of a pick.

    Parameters
    ----------
    robot
        What moves.
    arm
        Its kinematics and limits.
    punnet_places
        (P, 3) centre of each punnet's floor, metres, base frame.
    config
        Speeds and distances.
    """

    def __init__(
        self, robot: GuardedRobot, arm: Arm, punnet_places: NDArray[np.float64], config: HarvestConfig
    ) -> None:
        self._robot = robot
        self._arm = arm
        self._punnets = punnet_places
        self._config = config
        self._outside = self._inside = np.empty((0, arm.joint_count))
        self._over_punnet: NDArray[np.float64] | None = None

    def go_home(self) -> MotionResult:
        """Tool closed and empty, arm to the pose that the plant is looked at from."""
        self._robot.separate(0.0)
        self._robot.release(self._config.opening)
        return self._through(np.stack((self._robot.joints(), self._arm.home)), self._config.speed)

    def require_home(self) -> None:
        """Home.

        Raises
        ------
        StepFailed
            If the arm does not get there: from anywhere else the plant is not seen as it should be.
        """
        home = self.go_home()
        if not home.reached:
            raise StepFailed(Failure.NOT_HOME, home.reason or "")

    def look_along(self, point: NDArray[np.float64], direction: NDArray[np.float64]) -> MotionResult:
        """Bring the camera to where it looks at the berry under ``point`` (3,) along ``direction`` (3,).

        Raises
        ------
        KinematicsError
            If the arm can't hold it there.
        """
        rotation = approach_rotation(*angles_of_approach(direction))
        T_tool_camera = invert_transform(self._arm.T_flange_tool) @ T_FLANGE_CAMERA
        eye = point - np.array([0.0, 0.0, _BELOW_POINT]) - _VIEW_DISTANCE * direction
        tool = eye - rotation @ T_tool_camera[:3, 3]
        pose = self._arm.flange_pose(make_transform(rotation, tool))
        joints = nearest_solution(pose, self._arm.home, arm=self._arm)
        return self._through(np.stack((self._robot.joints(), joints)), self._config.speed)

    def prepare(self, distribution: TrajectoryDistribution) -> NDArray[np.float64]:
        """Take the mean reach of ``distribution`` from where the arm is; the direction (3,) along which the tool comes in.

        Raises
        ------
        KinematicsError
            If it leaves the joint limits.
        StepFailed
            If the robot's guard would refuse it.
        """
        path = distribution.mean(np.linspace(0.0, 1.0, _PATH_POINTS))
        path[0] = self._robot.joints()
        refusal = self._robot.refusal(retime(path, self._arm.limits, speed=self._config.careful_speed))
        if refusal is not None:
            raise StepFailed(Failure.UNSAFE, refusal)
        tool = self._arm.forward_kinematics_tool(path)
        near = np.linalg.norm(tool[:, :3, 3] - tool[-1, :3, 3], axis=1) < self._config.look_on_the_way
        self._outside, self._inside = np.split(path, [int(np.argmax(near))])
        return np.asarray(tool[-1, :3, 2])

    def to_the_plant(self) -> MotionResult:
        """The first part of the prepared reach, to where the berry is looked at once more."""
        if len(self._outside) < 2:
            return MotionResult(True)
        return self._through(self._outside, self._config.speed)

    def go_in(self, shift: NDArray[np.float64]) -> MotionResult:
        """The rest, to an end that lies ``shift`` (3,) metres beside the prepared one; broken off if a fruit is pushed."""
        path = np.concatenate((self._robot.joints()[None], self._inside))
        path[1:] = self._shifted(path[1:], shift)
        trajectory = retime(path, self._arm.limits, speed=self._config.careful_speed)
        return self._robot.follow(trajectory, self._config.reach_force)

    def _shifted(self, path: NDArray[np.float64], shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joints (T, 7) of the path moved aside, little by little over its first half; as it is if the arm can't."""
        if not shift.any():
            return path
        poses = self._arm.forward_kinematics(path)
        share = np.clip(np.linspace(0.0, 2.0, len(path)), 0.0, 1.0)
        poses[:, :3, 3] += (share * share * (3.0 - 2.0 * share))[:, None] * shift
        moved = projected(self._arm, path, poses)
        return moved if self._arm.within_limits(moved).all() else path

    def raise_tool(self, height: float) -> MotionResult:
        """Straight up by ``height`` metres, the tool as it is.

        Raises
        ------
        KinematicsError
            If the arm can't.
        """
        return self._through(self._straight(np.array([0.0, 0.0, height])), self._config.careful_speed)

    def go_deeper(self, distance: float) -> MotionResult:
        """On along the tool's axis by ``distance`` metres; broken off if a fruit is pushed.

        Raises
        ------
        KinematicsError
            If the arm can't.
        """
        path = self._straight(distance * self._ahead())
        return self._through(path, self._config.careful_speed, self._config.reach_force)

    def _straight(self, way: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joints (P, J) along ``way`` (3,) metres, the tool as it is."""
        start = self._robot.joints()
        share = np.linspace(0.0, 1.0, max(8, round(float(np.linalg.norm(way)) / _STRAIGHT_STEP)))
        poses = np.tile(self._arm.forward_kinematics(start), (len(share), 1, 1))
        poses[:, :3, 3] += share[:, None] * way
        return follow_path(poses, start, arm=self._arm)

    def _ahead(self) -> NDArray[np.float64]:
        """The tool's axis (3,) in the base frame."""
        return np.asarray(self._arm.forward_kinematics_tool(self._robot.joints())[:3, 2])

    def from_tool(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N, 3) of the base frame in the tool's frame as it is now: z is ahead."""
        T = self._arm.forward_kinematics_tool(self._robot.joints())
        return np.asarray((points - T[:3, 3]) @ T[:3, :3])

    def retreat(self) -> MotionResult:
        """Straight back out along the tool's axis."""
        try:
            path = self._straight(-self._config.retreat * self._ahead())
        except KinematicsError:
            # No straight way back from here: the way home leads out as well.
            path = np.stack((self._robot.joints(), self._arm.home))
        return self._through(path, self._config.careful_speed)

    def back_off(self) -> MotionResult:
        """Let go of whatever is held and leave the plant, all fingers open: no fruit may stick between two of them."""
        self._robot.release()
        moved = self.retreat()
        self._robot.separate(0.0)
        return moved

    def carry(self, punnet: int, count: int) -> MotionResult:
        """Take what hangs in the grip to the place of berry number ``count`` in a punnet, and lower it.

        Broken off if a fruit is pushed: out of the plant, that is one whose stem the fingers drag along. What they hold
        is lost by then; going on would tear at the plant.
        """
        offset = slot_offset(count)
        layer = _LAYER_HEIGHT * (count // _BERRIES_A_LAYER)
        floor = self._punnets[punnet] + np.array([offset[0], offset[1], layer])
        rotation = approach_rotation(_PLACE_YAW, _PLACE_PITCH)
        aside = _GRIP_TO_FRUIT * rotation[:2, 0]
        above, release = (
            make_transform(rotation, floor + np.array([*aside, height]))
            @ invert_transform(self._arm.T_flange_tool)
            for height in (_ABOVE_WALL, _RELEASE_HEIGHT)
        )
        over = self._over_punnet = nearest_solution(above, self._arm.home, arm=self._arm)
        path = np.stack((self._robot.joints(), self._arm.home, over))
        moved = self._through(path, self._config.speed, self._config.reach_force)
        if not moved.reached:
            return moved
        down = nearest_solution(release, over, arm=self._arm)
        path = np.stack((self._robot.joints(), down))
        lowered = self._through(path, _SET_DOWN_SPEED * self._config.careful_speed, _SET_DOWN_FORCE)
        # What is pressed on the way down has met the wall, the floor or other fruit. It is let go a little higher, for
        # opening fingers would press it too.
        if Failure.from_reason(lowered.reason or "", Failure.NOT_ARRIVED) is not Failure.PUSHED_FRUIT:
            return lowered
        return self.raise_tool(_OFF_AGAIN)

    def leave_punnet(self) -> MotionResult:
        """Let go, and straight up again, so that the way home does not lead through the punnet's walls."""
        self._robot.release(self._config.opening)
        if self._over_punnet is None:
            return MotionResult(True)
        return self._through(np.stack((self._robot.joints(), self._over_punnet)), self._config.careful_speed)

    def _through(
        self, path: NDArray[np.float64], speed: float, force_limit: float | None = None
    ) -> MotionResult:
        if np.abs(path - path[0]).max() < 1e-3:
            return MotionResult(True)
        return self._robot.follow(retime(path, self._arm.limits, speed=speed), force_limit)
