"""A robot that moves nothing: every motion becomes a file, every tool action a line; for a look at what would be done.

The camera is another robot's, a recording's or a file's; nothing is picked, so what it sees does not change.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import RobotError, ShapeError
from punnet.movement import JointTrajectory
from punnet.outputs import write_text
from punnet.robot.panda import HOME
from punnet.robot.protocol import CutResult, GripResult, MotionResult
from punnet.scene import Frame

__all__ = ["DryRunRobot"]

TOOL_TIME = 0.5
"""Seconds on its clock that a tool action takes."""


class DryRunRobot:
    """Writes ``0001-trajectory.json`` … in the fields of ``trajectory_msgs/JointTrajectory``, and ``actions.jsonl``.

    ``actions.jsonl`` has one line an action, in order: what was done, when on the robot's clock, and the trajectory's file.

    Parameters
    ----------
    folder
        Where the files go; made if need be.
    camera
        Gives a frame when the robot looks; its timestamp is set to the robot's clock.
    joints
        Where the arm is at first, (J,) radians.

    Raises
    ------
    ShapeError
        If the joints are not a list of finite numbers.
    OutputExistsError
        If the folder holds trajectories already.
    """

    def __init__(self, folder: str | Path, camera: Callable[[], Frame], joints: ArrayLike = HOME) -> None:
        self._joints = np.array(joints, dtype=np.float64)
        if self._joints.ndim != 1 or not self._joints.size or not np.isfinite(self._joints).all():
            raise ShapeError(f"dry run: a list of finite joint angles is needed, got {joints!r}")
        self._folder = Path(folder)
        self._camera = camera
        self._time = 0.0
        self._log: list[str] = []
        self._log_path = write_text(self._folder / "actions.jsonl", "")
        self.trajectories: list[Path] = []

    @property
    def time(self) -> float:
        """Seconds that what it was told would have taken until now."""
        return self._time

    def joints(self) -> NDArray[np.float64]:
        """Where the arm would be (J,)."""
        return self._joints.copy()

    def look(self) -> Frame:
        """The camera's frame, as of now."""
        frame = replace(self._camera(), timestamp=self._time)
        self._note("look")
        return frame

    def follow(self, trajectory: JointTrajectory, force_limit: float | None = None) -> MotionResult:
        """Write the trajectory; the arm is believed to be at its end.

        Raises
        ------
        RobotError
            If it has other joints than the arm.
        """
        if trajectory.positions.shape[1] != len(self._joints):
            raise RobotError(
                f"dry run: a trajectory of {len(self._joints)} joints is needed, got {trajectory.positions.shape}"
            )
        path = self._folder / f"{len(self.trajectories) + 1:04d}-trajectory.json"
        write_text(path, json.dumps(trajectory.to_json()) + "\n")
        self.trajectories.append(path)
        self._note("follow", file=path.name, seconds=round(trajectory.duration, 3), force_limit=force_limit)
        self._time += trajectory.duration
        self._joints = trajectory.end.copy()
        return MotionResult(True)

    def separate(self, opening: float) -> None:
        """Note the opening."""
        self._act("separate", opening=opening)

    def grip(self) -> GripResult:
        """Believe that a stem is held."""
        self._act("grip")
        return GripResult(True, 0.0)

    def cut(self) -> CutResult:
        """Believe that it is cut."""
        self._act("cut")
        return CutResult(True)

    def release(self, opening: float = 1.0) -> None:
        """Note the opening."""
        self._act("release", opening=opening)

    def weigh_punnet(self, punnet: int) -> float | None:
        """Nothing lies in it, so there is no reading."""
        return None

    def _act(self, action: str, **fields: float) -> None:
        self._note(action, **fields)
        self._time += TOOL_TIME

    def _note(self, action: str, **fields: str | float | None) -> None:
        self._log.append(json.dumps({"time": round(self._time, 3), "action": action, **fields}))
        write_text(self._log_path, "\n".join(self._log) + "\n", force=True)
