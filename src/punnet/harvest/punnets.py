"""Filling punnets by weight as berries come in."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError

__all__ = ["PunnetFiller", "slot_offset"]

_SLOTS = (2, 3)
_SLOT_PITCH = (0.046, 0.048)


def slot_offset(count: int) -> NDArray[np.float64]:
    """Where in a punnet the berry number ``count`` goes: (2,) metres from its middle, row by row, then again on top."""
    column, row = count % _SLOTS[0], (count // _SLOTS[0]) % _SLOTS[1]
    return np.array(
        [(column - (_SLOTS[0] - 1) / 2) * _SLOT_PITCH[0], ((_SLOTS[1] - 1) / 2 - row) * _SLOT_PITCH[1]]
    )


@dataclass
class PunnetFiller:
    """Fills one punnet after the other to its nominal weight.

    Parameters
    ----------
    punnets
        How many stand ready.
    nominal
        Grams at which a punnet is full.
    most
        Berries at which it is full whatever it weighs.
    """

    punnets: int
    nominal: float = 250.0
    most: int = 18
    weights: list[float] = field(default_factory=list)
    counts: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.punnets < 1 or self.nominal <= 0 or self.most < 1:
            raise ConfigurationError(
                "punnets: need at least one, of positive nominal weight and count, "
                f"got {self.punnets}, {self.nominal}, {self.most}"
            )
        self.weights = [0.0] * self.punnets
        self.counts = [0] * self.punnets

    def choose(self) -> int | None:
        """The punnet for the next berry; None when all are full."""
        for punnet in range(self.punnets):
            if self.weights[punnet] < self.nominal and self.counts[punnet] < self.most:
                return punnet
        return None

    def observe(self, punnet: int, grams: float) -> float:
        """Take in a weigh-cell reading after a drop; the grams that came in."""
        gained = grams - self.weights[punnet]
        self.weights[punnet] = grams
        self.counts[punnet] += 1
        return gained
