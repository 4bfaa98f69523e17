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
from punnet.scene import KEYPOINTS, Frame, Strawberries, Visibility
from punnet.weight import WeightEstimator
from punnet.weight.packing import Packer, WeighedBerry

__all__ = ["Listener", "Parts", "Sighting", "Situation", "Step", "stem_is_hidden", "weighed"]

_PICKING_POINT = KEYPOINTS.index("picking_point")

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


@dataclass(frozen=True, eq=False)
class Sighting:
    """A berry, ``row`` of ``berries``, as a frame showed it; ``from_home`` whether that was taken from home."""

    frame: Frame
    berries: Strawberries
    row: int
    from_home: bool = True


@dataclass(eq=False)
class Situation:
    """What is known at the moment.

    ``frame`` and ``berries`` are of the last look; ``second_view_of`` is the place it was turned to, None if the plant was
    looked at from home; ``attempt`` is the one in hand. ``looks`` counts them, ``in_vain`` those in a row that gave nothing;
    ``side_view`` is the number of the view of the whole plant that comes next or was taken last, 0 from home;
    ``hidden`` are berries of these views whose stems something hides. ``only_refused`` says that besides those no berry is
    left but such as were refused, for what hangs in their way.
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
    hidden: list[Sighting] = field(default_factory=list)
    only_refused: bool = False

    @property
    def seen(self) -> tuple[Frame, Strawberries]:
        """Frame and berries of the last look."""
        assert self.frame is not None
        assert self.berries is not None
        return self.frame, self.berries

    @property
    def from_home(self) -> bool:
        """Whether the last look was from home."""
        return self.second_view_of is None and self.side_view == 0

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


def stem_is_hidden(berries: Strawberries, row: int) -> bool:
    """Whether something else hides where the stem is to be gripped: then the point is guessed, and three times as far off."""
    return berries.visibility is not None and bool(
        berries.visibility[row, _PICKING_POINT] == Visibility.HIDDEN_BY_OTHER
    )


def weighed(attempt_berries: Strawberries, row: int, number: int) -> WeighedBerry:
    """One of the berries as the packer takes it."""
    low, high = attempt_berries.weight_intervals[row]
    return WeighedBerry(number, float(attempt_berries.weights[row]), float(low), float(high))
