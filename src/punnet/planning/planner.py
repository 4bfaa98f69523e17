"""The interface of every planner."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.movement import TrajectoryDistribution
from punnet.scene import Frame, Target

__all__ = ["Planner"]


@runtime_checkable
class Planner(Protocol):
    """From what a camera saw and a target berry to a distribution of reaches."""

    @property
    def name(self) -> str:
        """What it is called in results."""
        ...

    def plan(self, frame: Frame, target: Target, start: NDArray[np.float64]) -> TrajectoryDistribution:
        """Distribution of joint-space reaches from joints ``start`` (7,) to the target.

        Raises
        ------
        PlanningError
            If no reach exists; the message gives the reason.
        """
        ...
