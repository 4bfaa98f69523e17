"""What is written about a harvest: the input of ``harvest.json`` and of the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from punnet.errors import ConfigurationError

__all__ = ["HARVEST_SCHEMA", "HarvestReport", "LeftRecord", "OutcomeName", "PickRecord", "PunnetRecord"]

HARVEST_SCHEMA = "punnet-harvest/1"
OutcomeName = Literal["picked", "failed", "skipped"]


@dataclass(frozen=True)
class PickRecord:
    """One turn to one berry.

    Parameters
    ----------
    id
        Number of the attempt, from 1, in the order of the harvest.
    berry_class
        Class that the detector gave it.
    outcome
        ``picked``, ``failed`` (tried without success) or ``skipped`` (no plan, so not tried).
    reason
        Why it was not picked; None if it was.
    estimate_g, interval_g
        Grams estimated before the pick, and their interval; None where there is no estimate.
    weighed_g, true_g
        Grams that the weigh cell gained, and grams of the simulator's truth; None if unknown.
    punnet
        Number of the punnet that it went to, from 1; None if none.
    seconds_simulated, seconds_computing
        Time on the robot's clock, and on ours.
    notes
        What was not as usual, for a reader.
    images
        PNG or JPEG bytes by caption: what the camera saw before, at the grip, …
    plot
        PNG bytes of the trajectory distribution, None without a plan.

    Raises
    ------
    ConfigurationError
        If a berry that was not picked has no reason, or the outcome is unknown.
    """

    id: int
    berry_class: str
    outcome: OutcomeName
    reason: str | None = None
    estimate_g: float | None = None
    interval_g: tuple[float, float] | None = None
    weighed_g: float | None = None
    true_g: float | None = None
    punnet: int | None = None
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    notes: Sequence[str] = ()
    images: Mapping[str, bytes] = field(default_factory=dict)
    plot: bytes | None = None

    def __post_init__(self) -> None:
        if self.outcome not in ("picked", "failed", "skipped"):
            raise ConfigurationError(
                f"pick {self.id}: outcome '{self.outcome}' is not picked, failed or skipped"
            )
        if (self.outcome == "picked") != (self.reason is None):
            raise ConfigurationError(
                f"pick {self.id}: a berry has a reason if, and only if, it was not picked"
            )

    @property
    def actual_g(self) -> float | None:
        """Grams by the truth, else by the weigh cell; None if neither is known."""
        return self.weighed_g if self.true_g is None else self.true_g

    def to_json(self) -> dict[str, Any]:
        """Plain values, without pictures."""
        return {
            "id": self.id,
            "class": self.berry_class,
            "outcome": self.outcome,
            "reason": self.reason,
            "estimate_g": _plain(self.estimate_g),
            "interval_g": None if self.interval_g is None else [_plain(value) for value in self.interval_g],
            "weighed_g": _plain(self.weighed_g),
            "true_g": _plain(self.true_g),
            "punnet": self.punnet,
            "seconds_simulated": round(self.seconds_simulated, 3),
            "seconds_computing": round(self.seconds_computing, 3),
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class LeftRecord:
    """A berry that stayed on the plant without a try, and why; ``image`` is PNG or JPEG of how it was seen last."""

    id: int
    berry_class: str
    reason: str
    image: bytes | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the picture."""
        return {"id": self.id, "class": self.berry_class, "reason": self.reason}


@dataclass(frozen=True)
class PunnetRecord:
    """A punnet at the end.

    Parameters
    ----------
    number
        From 1.
    grams, nominal_g
        By its weigh cell, and what it should hold.
    berries
        How many are in it.
    estimated_g
        Sum of what its berries were estimated at before they were picked; None if one of them was not.
    full
        Whether it is finished: better closed than given one more berry.
    """

    number: int
    grams: float
    nominal_g: float
    berries: int
    estimated_g: float | None = None
    full: bool = False

    @property
    def giveaway(self) -> float | None:
        """(grams − nominal) / nominal of a full punnet, None of one that is not."""
        return (self.grams - self.nominal_g) / self.nominal_g if self.full else None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "number": self.number,
            "grams": round(self.grams, 2),
            "nominal_g": self.nominal_g,
            "berries": self.berries,
            "estimated_g": _plain(self.estimated_g),
            "full": self.full,
            "giveaway": _plain(self.giveaway, 4),
        }


@dataclass(frozen=True)
class HarvestReport:
    """A harvest as it is told.

    Parameters
    ----------
    ripe
        How many pluckable berries there were to pick: the ``m`` of "picked n of m".
    picks
        Every attempt, in order.
    left
        What stayed on the plant without a try.
    punnets
        At the end.
    seconds_simulated, seconds_computing
        Of the whole run.
    settings
        What fixes the run: seed, detector, planner, …; values are shown as they are.
    versions
        Of Punnet and of what it stands on.
    created
        ISO 8601 date and time.
    title
        Heading of the report.
    first_view
        PNG or JPEG bytes of the first look with what was found in it, None without a camera.
    video
        MP4 bytes (H.264, so that browsers play it), None without.
    interrupted
        Whether it was stopped from outside; the report is of what was done until then.
    stopped
        Why the robot ended it early, None if it did not.
    only
        Number of the attempt that it is of, None if it is of the whole harvest.
    resumed
        Numbers of the attempts with which it went on after a kill or an interruption.
    """

    ripe: int
    picks: Sequence[PickRecord]
    left: Sequence[LeftRecord] = ()
    punnets: Sequence[PunnetRecord] = ()
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    created: str = ""
    title: str = "Strawberry harvest"
    first_view: bytes | None = None
    video: bytes | None = None
    interrupted: bool = False
    stopped: str | None = None
    only: int | None = None
    resumed: Sequence[int] = ()

    @property
    def picked(self) -> list[PickRecord]:
        """The attempts that ended in a punnet."""
        return [pick for pick in self.picks if pick.outcome == "picked"]

    @property
    def grams(self) -> float:
        """Grams in the punnets, by their weigh cells."""
        return float(sum(punnet.grams for punnet in self.punnets))

    @property
    def seconds_a_pick(self) -> float | None:
        """Seconds on the robot's clock for one picked berry, failures included; None if none was picked."""
        return self.seconds_simulated / len(self.picked) if self.picked else None

    @property
    def weight_error(self) -> float | None:
        """Mean relative error of the estimates of picked berries against the truth, else the weigh cell."""
        errors = []
        for pick in self.picked:
            truth = pick.actual_g
            if truth and pick.estimate_g is not None and math.isfinite(pick.estimate_g):
                errors.append(abs(pick.estimate_g - truth) / truth)
        return sum(errors) / len(errors) if errors else None

    def to_json(self) -> dict[str, Any]:
        """``harvest.json``: everything but the pictures."""
        return {
            "schema": HARVEST_SCHEMA,
            "title": self.title,
            "created": self.created,
            "interrupted": self.interrupted,
            "stopped": self.stopped,
            "resumed_with": list(self.resumed),
            "ripe": self.ripe,
            "picked": len(self.picked),
            "grams": round(self.grams, 2),
            "seconds_simulated": round(self.seconds_simulated, 3),
            "seconds_computing": round(self.seconds_computing, 3),
            "seconds_a_pick": _plain(self.seconds_a_pick),
            "mean_relative_weight_error": _plain(self.weight_error, 4),
            "picks": [pick.to_json() for pick in self.picks],
            "left": [berry.to_json() for berry in self.left],
            "punnets": [punnet.to_json() for punnet in self.punnets],
            "settings": dict(self.settings),
            "versions": dict(self.versions),
        }


def _plain(value: float | None, digits: int = 3) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), digits)
