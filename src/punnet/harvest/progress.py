"""How far a harvest is, for a person who watches it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from punnet.harvest.attempts import HarvestRun, Outcome

__all__ = ["Progress"]


@dataclass(frozen=True)
class Progress:
    """Counts of a harvest that runs.

    ``seen`` and ``pluckable`` are berries of the last look, ``picked`` those in punnets, ``not_picked`` attempts that came to
    nothing, ``grams`` what the weigh cells gained, by punnet; ``seconds`` are on the robot's clock.
    """

    seen: int
    pluckable: int
    picked: int
    not_picked: int
    punnets: tuple[float, ...]
    seconds: float

    @property
    def grams(self) -> float:
        """Grams in all punnets."""
        return sum(self.punnets)

    @classmethod
    def of(cls, run: HarvestRun, punnets: int, seconds: float) -> Progress:
        """Of what has been done until now, with so many punnets."""
        berries = run.last_berries
        grams = [0.0] * punnets
        for attempt in run.picked:
            if attempt.punnet is not None:
                grams[attempt.punnet] += attempt.estimate if math.isnan(attempt.weighed) else attempt.weighed
        ended = [attempt for attempt in run.attempts if attempt.failure is not None]
        return cls(
            seen=0 if berries is None else len(berries),
            pluckable=0 if berries is None else int(berries.pluckable.sum()),
            picked=len(run.picked),
            not_picked=sum(attempt.outcome is not Outcome.PICKED for attempt in ended),
            punnets=tuple(grams),
            seconds=seconds,
        )
