"""What packers do without looking ahead: first-fit by estimate, and filling by count."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.weight.packing.berries import WeighedBerry
from punnet.weight.packing.packer import PackingConfig, Punnet, Tally

__all__ = ["FillByCount", "FirstFit"]


class FirstFit:
    """Into the first punnet that the berry does not fill above the target, else where it goes above it least.

    A punnet is full when its weight, read or summed from estimates, has reached the target: nominal + ``margin`` grams.
    """

    name = "first-fit"
    price_aside = math.inf

    def __init__(self, config: PackingConfig | None = None, margin: float = 0.0) -> None:
        self.config = config or PackingConfig()
        self._target = self.config.nominal + margin

    def costs(self, berry: WeighedBerry, punnets: Sequence[Punnet], tally: Tally) -> NDArray[np.float64]:
        """(K,) grams above the target, and for those below it their place in the row, before all others."""
        mean, _ = self.config.population.belief(berry)
        above = np.array([punnet.grams + mean - self._target for punnet in punnets])
        return np.where(above > 0, above, np.arange(len(punnets)) - float(len(punnets)))

    def is_full(self, punnet: Punnet, tally: Tally) -> bool:
        """Whether the target is reached."""
        return punnet.grams >= self._target


class FillByCount:
    """So many berries in each punnet, one punnet after the other, whatever they weigh.

    Raises
    ------
    ConfigurationError
        If ``berries`` is not 1 … the most a punnet may hold.
    """

    name = "by count"
    price_aside = math.inf

    def __init__(self, config: PackingConfig | None = None, berries: int | None = None) -> None:
        self.config = config or PackingConfig()
        self.berries = berries or math.ceil(self.config.nominal / self.config.population.mean)
        if not 1 <= self.berries <= self.config.most_berries:
            raise ConfigurationError(
                f"packing by count: {self.berries} berries, but a punnet holds 1 … {self.config.most_berries}"
            )

    def costs(self, berry: WeighedBerry, punnets: Sequence[Punnet], tally: Tally) -> NDArray[np.float64]:
        """(K,) their place in the row."""
        return np.arange(len(punnets), dtype=np.float64)

    def is_full(self, punnet: Punnet, tally: Tally) -> bool:
        """Whether the count is reached."""
        return len(punnet.berries) >= self.berries
