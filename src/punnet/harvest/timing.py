"""A stopwatch on a robot: what a simulated harvest costs in computing, the simulator left out."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from punnet.robot import Robot

__all__ = ["TimedRobot"]


class TimedRobot:
    """Any robot, with the processor seconds that go by inside its calls added up.

    Processor seconds of this process, all its threads: other programs on the machine do not count.

    Attributes
    ----------
    seconds
        Spent in the robot until now.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.seconds = 0.0

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._robot, name)
        return self._timed(value) if callable(value) else value

    def _timed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any, **options: Any) -> Any:
            began = time.process_time()
            try:
                return call(*arguments, **options)
            finally:
                self.seconds += time.process_time() - began

        return timed
