"""What the steps of a harvest work with: the parts, and the situation that goes from step to step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from punnet.harvest.attempts import Attempt, HarvestRun, Phase
from punnet.harvest.config import HarvestConfig
from punnet.harvest.eyes import Eyes
from punnet.harvest.memory import Memory, Place
from punnet.harvest.motions import Motions
from punnet.planning import Planner
from punnet.robot import GuardedRobot
from punnet.scene import Frame, Strawberries
from punnet.weight import WeightEstimator
from punnet.weight.packing import Packer, WeighedBerry

__all__ = ["Listener", "Parts", "Situation", "Step", "weighed"]

Listener = Callable[[str, Attempt | None], None]
"""Told of each step: a line for a person, and the attempt it belongs to."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What a harvest is done with; the same from beginning to end."""

    robot: GuardedRobot
    eyes: Eyes
    scale: WeightEstimator
    planner: Planner
    motions: Motions
    packer: Packer
    config: HarvestConfig
    tell: Listener


@dataclass(eq=False)
class Situation:
    """What is known at the moment.

    ``frame`` and ``berries`` are of the last look; ``second_view_of`` is the place it was turned to, None if the plant was
    looked at from home; ``attempt`` is the one in hand. ``looks`` counts them, ``in_vain`` those in a row that gave nothing;
    ``side_view`` is the number of the view of the whole plant that comes next or was taken last, 0 from home.
    """

    memory: Memory
    run: HarvestRun = field(default_factory=HarvestRun)
    frame: Frame | None = None
    berries: Strawberries | None = None
    second_view_of: Place | None = None
    attempt: Attempt | None = None
    looks: int = 0
    in_vain: int = 0
    side_view: int = 0

    @property
    def seen(self) -> tuple[Frame, Strawberries]:
        """Frame and berries of the last look."""
        assert self.frame is not None
        assert self.berries is not None
        return self.frame, self.berries

    @property
    def in_hand(self) -> Attempt:
        """The attempt in hand."""
        assert self.attempt is not None
        return self.attempt


class Step(Protocol):
    """One step of a harvest, with one job."""

    phase: Phase

    def do(self, situation: Situation) -> Phase | None:
        """Do it; the phase to go on with, None when the harvest is done.

        Raises
        ------
        StepFailed
            If it does not work out.
        """


def weighed(attempt_berries: Strawberries, row: int, number: int) -> WeighedBerry:
    """One of the berries as the packer takes it."""
    low, high = attempt_berries.weight_intervals[row]
    return WeighedBerry(number, float(attempt_berries.weights[row]), float(low), float(high))
