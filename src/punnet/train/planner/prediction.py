"""What all learned planners and baselines have in common."""

from __future__ import annotations

from typing import Protocol

from punnet.movement.distribution import Space
from punnet.planning.reaches import Movements, Reaches

__all__ = ["Prediction"]


class Prediction(Protocol):
    """Something trained that tells movements from photographs."""

    @property
    def name(self) -> str:
        """What it is called in tables."""
        ...

    @property
    def space(self) -> Space:
        """Joint or task."""
        ...

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph; of ``reaches`` no movement, end or point is looked at."""
        ...
