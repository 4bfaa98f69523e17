"""One plant of a benchmark: what became of its berries and of every attempt at one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from punnet.errors import FileFormatError
from punnet.harvest.attempts import Outcome
from punnet.harvest.benchmark_watch import Collision
from punnet.harvest.judge import Fate

__all__ = ["AttemptResult", "PlantResult"]

_NAN = float("nan")


@dataclass(frozen=True)
class AttemptResult:
    """One attempt, in grams, metres and simulated seconds; NaN for what is not known.

    ``aimed`` is the index of the berry that it was meant for, ``true_weight`` what it brought off the plant; for the
    errors see :class:`~punnet.harvest.benchmark_watch.AttemptTruth`.
    """

    outcome: str
    phase: str
    reason: str | None = None
    aimed: int | None = None
    estimate: float = _NAN
    interval: tuple[float, float] = (_NAN, _NAN)
    true_weight: float = _NAN
    located_error: float = _NAN
    cut_error: float = _NAN
    seconds: float = _NAN

    @property
    def picked(self) -> bool:
        """Whether the robot found a berry in the punnet."""
        return self.outcome == Outcome.PICKED

    @property
    def kind(self) -> str:
        """Phase and reason without its numbers, for counting."""
        return f"{self.phase}: {(self.reason or 'no reason').partition(':')[0]}"

    def to_json(self) -> dict[str, Any]:
        """Plain values; null for NaN."""
        return {
            "outcome": self.outcome,
            "phase": self.phase,
            "reason": self.reason,
            "aimed": self.aimed,
            "estimate_g": _nullable(self.estimate, 2),
            "interval_g": [_nullable(bound, 2) for bound in self.interval],
            "true_g": _nullable(self.true_weight, 2),
            "located_error_m": _nullable(self.located_error, 5),
            "cut_error_m": _nullable(self.cut_error, 5),
            "seconds": _nullable(self.seconds, 3),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> AttemptResult:
        """Read what :meth:`to_json` wrote."""
        low, high = (_number(bound) for bound in data["interval_g"])
        return cls(
            data["outcome"],
            data["phase"],
            data["reason"],
            data["aimed"],
            _number(data["estimate_g"]),
            (low, high),
            *(_number(data[name]) for name in ("true_g", "located_error_m", "cut_error_m", "seconds")),
        )


@dataclass(frozen=True)
class PlantResult:
    """One plant: its number in the benchmark, its seed, the fates of its berries, the attempts, the collisions.

    ``seconds_computing`` are processor seconds without the simulator's. ``error`` is why it ended early, if it did.
    """

    number: int
    seed: int
    fates: tuple[Fate, ...] = ()
    attempts: tuple[AttemptResult, ...] = ()
    collisions: tuple[Collision, ...] = ()
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    error: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "number": self.number,
            "seed": self.seed,
            "seconds_simulated": round(self.seconds_simulated, 3),
            "seconds_computing": round(self.seconds_computing, 4),
            "error": self.error,
            "berries": [fate.to_json() for fate in self.fates],
            "attempts": [attempt.to_json() for attempt in self.attempts],
            "collisions": [
                {"berry": hit.berry, "attempt": hit.attempt, "during": hit.during} for hit in self.collisions
            ],
        }

    @classmethod
    def from_json(cls, data: Any, where: str) -> PlantResult:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        FileFormatError
            If something is missing or of the wrong kind; ``where`` is named.
        """
        try:
            return cls(
                number=int(data["number"]),
                seed=int(data["seed"]),
                fates=tuple(Fate.from_json(fate) for fate in data["berries"]),
                attempts=tuple(AttemptResult.from_json(attempt) for attempt in data["attempts"]),
                collisions=tuple(Collision(**hit) for hit in data["collisions"]),
                seconds_simulated=float(data["seconds_simulated"]),
                seconds_computing=float(data["seconds_computing"]),
                error=data["error"],
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"{where}: no result of a plant ({error!r}); remove it") from error


def _nullable(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def _number(value: float | None) -> float:
    return _NAN if value is None else float(value)
