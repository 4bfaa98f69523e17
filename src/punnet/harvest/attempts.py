"""What happened to each berry that the loop turned to."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.harvest.failures import Failure, Recovery
from punnet.movement import TrajectoryDistribution
from punnet.scene import Frame, Strawberries

__all__ = ["Attempt", "HarvestRun", "History", "Journal", "Outcome", "Phase"]


class Outcome(StrEnum):
    """How an attempt ended."""

    PICKED = "picked"
    FAILED = "failed"
    SKIPPED = "skipped"


class Phase(StrEnum):
    """The steps of a harvest, in order; a failure names the one it happened in."""

    LOOK = "look"
    PERCEIVE = "perceive"
    WEIGH = "weigh"
    ORDER = "order"
    PLAN = "plan"
    CHECK = "check"
    REACH = "reach"
    SEPARATE = "separate"
    GRIP = "grip"
    CUT = "cut"
    PLACE = "place"
    VERIFY = "verify"


@dataclass(eq=False)
class Attempt:
    """One turn to one berry, as the robot knows it.

    ``picking_point`` is (3,) metres in the base frame, NaN if depth gave none; ``estimate`` and ``interval`` are grams,
    NaN if unknown; ``meant_for`` is the punnet that was chosen for it before the pick, None if all were full; ``weighed`` is
    what the weigh cell gained, NaN if nothing was placed; ``punnet`` is where it went; ``reading`` is the weigh cell of
    ``meant_for`` after the attempt, NaN if it was not read. ``failure`` is the name of the reason why it was not
    picked, ``reason`` tells more. ``approach`` (3,) is the direction along which the tool came in, None if it did not;
    ``second_view`` whether the frame was not taken from home; ``shift`` (3,) metres how far the tool went beside the planned
    point, by a look on the way; ``confirmed`` False if that look did not show the berry; ``carried`` what went wrong with
    the berry in the grip.
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
    phase: Phase = Phase.ORDER
    failure: Failure | None = None
    reason: str | None = None
    approach: NDArray[np.float64] | None = None
    second_view: bool = False
    shift: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    confirmed: bool = True
    carried: str | None = None
    weighed: float = float("nan")
    punnet: int | None = None
    reading: float = float("nan")
    peak_force: float = 0.0
    touched: tuple[str, ...] = ()
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    distribution: TrajectoryDistribution | None = None

    @property
    def berry(self) -> Strawberries:
        """The berry alone, a container of one."""
        return self.berries[self.row]

    @property
    def refused(self) -> bool:
        """Whether it was not begun for what hung in the way."""
        return self.failure is Failure.NOT_FREE

    def to_json(self) -> dict[str, Any]:
        """Plain values; frame, berries and distribution are kept apart."""
        return {
            "number": self.number,
            "row": self.row,
            "outcome": str(self.outcome),
            "phase": str(self.phase),
            "failure": None if self.failure is None else self.failure.name.lower(),
            "reason": self.reason,
            "approach": None if self.approach is None else self.approach.tolist(),
            "second_view": self.second_view,
            "shift": self.shift.tolist(),
            "confirmed": self.confirmed,
            "picking_point": [_nullable(value) for value in self.picking_point],
            "estimate_g": _nullable(self.estimate),
            "interval_g": [_nullable(value) for value in self.interval],
            "meant_for": self.meant_for,
            "weighed_g": _nullable(self.weighed),
            "punnet": self.punnet,
            "reading_g": _nullable(self.reading),
            "peak_force_n": self.peak_force,
            "touched": list(self.touched),
            "seconds_simulated": self.seconds_simulated,
            "seconds_computing": self.seconds_computing,
        }

    @classmethod
    def from_json(
        cls,
        data: dict[str, Any],
        frame: Frame,
        berries: Strawberries,
        distribution: TrajectoryDistribution | None,
    ) -> Attempt:
        """From what :meth:`to_json` wrote and what was kept apart.

        Raises
        ------
        FileFormatError
            If a value is missing or of the wrong kind.
        """
        try:
            low, high = (_number(value) for value in data["interval_g"])
            return cls(
                number=int(data["number"]),
                frame=frame,
                berries=berries,
                row=int(data["row"]),
                picking_point=np.array([_number(value) for value in data["picking_point"]]),
                estimate=_number(data["estimate_g"]),
                interval=(low, high),
                meant_for=data["meant_for"],
                outcome=Outcome(data["outcome"]),
                phase=Phase(data["phase"]),
                failure=None if data["failure"] is None else Failure[data["failure"].upper()],
                reason=data["reason"],
                approach=None if data["approach"] is None else np.array(data["approach"], dtype=np.float64),
                second_view=bool(data["second_view"]),
                shift=np.array(data["shift"], dtype=np.float64),
                confirmed=bool(data["confirmed"]),
                weighed=_number(data["weighed_g"]),
                punnet=data["punnet"],
                reading=_number(data["reading_g"]),
                peak_force=float(data["peak_force_n"]),
                touched=tuple(data["touched"]),
                seconds_simulated=float(data["seconds_simulated"]),
                seconds_computing=float(data["seconds_computing"]),
                distribution=distribution,
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"attempt: not as it was written ({error!r})") from error


@dataclass(eq=False)
class HarvestRun:
    """All attempts of a run, what was seen first and last, the punnets' weights in grams and which of them are full.

    ``interrupted`` is True when the run was stopped from outside (Ctrl-C) and holds what was done until then;
    ``stopped`` is why the robot ended it early, None if it did not, and ``home`` whether the arm got home after that.
    """

    attempts: list[Attempt] = field(default_factory=list)
    first_frame: Frame | None = None
    first_berries: Strawberries | None = None
    last_frame: Frame | None = None
    last_berries: Strawberries | None = None
    punnet_weights: list[float] = field(default_factory=list)
    punnets_full: list[bool] = field(default_factory=list)
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    interrupted: bool = False
    stopped: str | None = None
    home: bool = True

    @property
    def picked(self) -> list[Attempt]:
        """The attempts that ended with a berry in a punnet, by the weigh cell."""
        return [attempt for attempt in self.attempts if attempt.outcome is Outcome.PICKED]


@dataclass
class History:
    """What a run had done before it was killed.

    ``attempts`` are those that ended, ``places`` what was remembered after the last of them, ``seconds`` on the robot's
    clock and of computing until then; ``resumed`` are the numbers of the attempts with which the run went on, this time
    included; ``lost`` was in flight when it was killed.
    """

    attempts: list[Attempt] = field(default_factory=list)
    places: list[dict[str, Any]] = field(default_factory=list)
    seconds: tuple[float, float] = (0.0, 0.0)
    resumed: list[int] = field(default_factory=list)
    lost: int | None = None


class Journal(Protocol):
    """Told of each attempt before the arm moves and after it is back; writes it down before it returns."""

    def begin(self, attempt: Attempt) -> None:
        """An attempt is about to begin."""

    def end(self, attempt: Attempt) -> None:
        """It has ended, the arm is home."""

    def failed(self, phase: Phase, failure: Failure, reason: str, recovery: Recovery) -> None:
        """A step has failed, and what is done about it."""


def _nullable(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
