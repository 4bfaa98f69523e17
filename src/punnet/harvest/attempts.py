"""What happened to each berry that the loop turned to."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from punnet.movement import TrajectoryDistribution
from punnet.scene import Frame, Strawberries

__all__ = ["Attempt", "HarvestRun", "Outcome", "Phase"]


class Outcome(StrEnum):
    """How an attempt ended."""

    PICKED = "picked"
    FAILED = "failed"
    SKIPPED = "skipped"


class Phase(StrEnum):
    """The steps of one pick, in order; a failure names the one it happened in."""

    LOCATE = "locate"
    PLAN = "plan"
    REACH = "reach"
    SEPARATE = "separate"
    GRIP = "grip"
    CUT = "cut"
    RETREAT = "retreat"
    PLACE = "place"


@dataclass(eq=False)
class Attempt:
    """One turn to one berry, as the robot knows it.

    ``picking_point`` is (3,) metres in the base frame, NaN if depth gave none; ``estimate`` and ``interval`` are grams,
    NaN if unknown; ``meant_for`` is the punnet that was chosen for it before the pick, None if all were full; ``weighed`` is
    what the weigh cell gained, NaN if nothing was placed; ``punnet`` is where it went.
    """

    number: int
    frame: Frame
    berries: Strawberries
    row: int
    picking_point: NDArray[np.float64]
    estimate: float
    interval: tuple[float, float]
    meant_for: int | None
    outcome: Outcome = Outcome.FAILED
    phase: Phase = Phase.LOCATE
    reason: str | None = None
    weighed: float = float("nan")
    punnet: int | None = None
    peak_force: float = 0.0
    touched: tuple[str, ...] = ()
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    distribution: TrajectoryDistribution | None = None

    @property
    def berry(self) -> Strawberries:
        """The berry alone, a container of one."""
        return self.berries[self.row]


@dataclass(eq=False)
class HarvestRun:
    """All attempts of a run, what was seen first and last, the punnets' weights in grams and which of them are full.

    ``interrupted`` is True when the run was stopped from outside (Ctrl-C) and holds what was done until then;
    ``stopped`` is why the robot ended it early, None if it did not.
    """

    attempts: list[Attempt] = field(default_factory=list)
    first_frame: Frame | None = None
    first_berries: Strawberries | None = None
    last_berries: Strawberries | None = None
    punnet_weights: list[float] = field(default_factory=list)
    punnets_full: list[bool] = field(default_factory=list)
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    interrupted: bool = False
    stopped: str | None = None

    @property
    def picked(self) -> list[Attempt]:
        """The attempts that ended with a berry in a punnet, by the weigh cell."""
        return [attempt for attempt in self.attempts if attempt.outcome is Outcome.PICKED]
