"""A planned reach carried out before a plant: where the flange really came to, and what it met on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.movement import retime
from punnet.robot import GuardedRobot, MotionGuard, Panda
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.snapshot import restore_snapshot, take_snapshot
from punnet.sim.structure import structure_boxes
from punnet.sim.world import World

__all__ = ["Execution", "ReachExecutor"]

SPEED = 0.5
"""Of what the arm can do."""
RECORDED_EVERY = 0.02
"""Seconds between recorded points of the flange's way."""


@dataclass(frozen=True, eq=False)
class Execution:
    """What became of a reach.

    Parameters
    ----------
    end
        (4, 4) ``T_base_flange`` where the arm stands at last.
    way
        (T, 3) the flange's positions on the way, metres, base frame.
    reason
        Why it is not at the reach's end; None if it is.
    peak_force
        Newtons with which the tool pressed on a berry at most.
    """

    end: NDArray[np.float64]
    way: NDArray[np.float64]
    reason: str | None
    peak_force: float


class ReachExecutor:
    """Carries out one reach after another in the same world, each from home and before the untouched plant.

    The separation fingers are open, as in the thesis' demonstrations. Motions pass the guard like all others: what would leave
    a limit or run into structure is refused, and the arm stays at home.

    Parameters
    ----------
    world
        With the plant; freshly built.
    """

    def __init__(self, world: World) -> None:
        self._arm = Panda()
        self._robot = SimulatedRobot(world, np.random.default_rng(0))
        self._guarded = GuardedRobot(self._robot, MotionGuard(self._arm, structure_boxes(world)))
        self._way: list[NDArray[np.float64]] = []
        self._next = 0.0
        self._robot.separate(1.0)
        self._start = take_snapshot(self._robot)
        self._robot.observers.append(self._record)

    @property
    def start(self) -> NDArray[np.float64]:
        """Joints (7,) from which every reach begins, radians."""
        restore_snapshot(self._robot, self._start)
        return self._robot.joints()

    def execute(self, joints: ArrayLike) -> Execution:
        """Follow joints (T, 7), the first of them the start, as fast as limits at half speed let.

        Raises
        ------
        ShapeError
            If they are not (T ≥ 2, 7) finite numbers.
        """
        path = np.asarray(joints, dtype=np.float64)
        if path.ndim != 2 or path.shape[1] != 7 or len(path) < 2 or not np.isfinite(path).all():
            raise ShapeError(f"reach: joints must be finite (T ≥ 2, 7), got {path.shape}")
        restore_snapshot(self._robot, self._start)
        self._way, self._next = [], self._robot.time
        result = self._guarded.follow(retime(path, self._arm.limits, speed=SPEED))
        end = np.asarray(self._arm.forward_kinematics(self._robot.joints()))
        return Execution(
            end,
            np.array([*self._way, end[:3, 3]]),
            None if result.reached else result.reason,
            result.peak_force,
        )

    def _record(self, world: World) -> None:
        if self._robot.time >= self._next:
            self._next += RECORDED_EVERY
            self._way.append(self._arm.forward_kinematics(self._robot.joints())[:3, 3])
