"""The interface of every robot that can pick: simulated, real, or one that only writes files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.movement import JointTrajectory
from punnet.scene import Frame

__all__ = ["NOTHING_HELD", "NOT_ALONE", "TOO_THICK", "CutResult", "GripResult", "MotionResult", "Robot"]

NOTHING_HELD = "nothing between the pads"
"""Reason of a grip whose pads met."""

TOO_THICK = "something thicker than a stem between the pads"
"""Reason of a grip that was not made firm, since a fruit is in it."""

NOT_ALONE = "a leaf or another stem between the pads too"
"""Reason of a firm grip that was opened again, since it does not hold the stem alone."""


@dataclass(frozen=True)
class MotionResult:
    """How a motion ended.

    ``reached`` is whether the arm is at the trajectory's end; ``reason`` says why not. ``peak_force`` is the largest
    contact force in newtons that the tool felt on the way, ``touched`` names what it touched (if the robot can tell).
    """

    reached: bool
    reason: str | None = None
    peak_force: float = 0.0
    touched: tuple[str, ...] = ()


@dataclass(frozen=True)
class GripResult:
    """Whether the grasping fingers hold something, by their own sensing; ``opening`` in metres between them."""

    holding: bool
    opening: float
    reason: str | None = None


@dataclass(frozen=True)
class CutResult:
    """Whether the blade went through; ``reason`` says why not."""

    cut: bool
    reason: str | None = None


@runtime_checkable
class Robot(Protocol):
    """An arm with a picker and a camera on it. Joints in radians, poses in the base frame, seconds of its own clock."""

    @property
    def time(self) -> float:
        """Seconds on the robot's clock."""
        ...

    def joints(self) -> NDArray[np.float64]:
        """Measured joint angles (J,); J = 7 for the Panda."""
        ...

    def look(self) -> Frame:
        """RGB-D frame of the wrist camera with intrinsics and ``T_base_camera``."""
        ...

    def follow(self, trajectory: JointTrajectory, force_limit: float | None = None) -> MotionResult:
        """Execute a joint trajectory that starts where the arm is.

        The robot watches its own limits, structure and whether the arm follows, and stops by itself. With
        ``force_limit`` it also stops where the tool presses on a fruit with more than so many newtons.
        """
        ...

    def separate(self, opening: float) -> None:
        """Set the separation fingers to ``opening`` in [0, 1] (0 closed wedge, 1 fully open)."""
        ...

    def grip(self) -> GripResult:
        """Close the grasping fingers, gently; open again with :data:`TOO_THICK` or :data:`NOT_ALONE` where it can tell."""
        ...

    def cut(self) -> CutResult:
        """Drive the blade once."""
        ...

    def release(self, opening: float = 1.0) -> None:
        """Open the grasping fingers by ``opening`` in [0, 1] (1 fully)."""
        ...

    def weigh_punnet(self, punnet: int) -> float | None:
        """Reading of the weigh cell under a punnet, grams; None if there is no cell."""
        ...
