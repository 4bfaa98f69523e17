"""Berries go one by one into the punnets where they serve best: the state of a packing place, and who decides.

packer = Packer(LookAhead(), places=4)
punnet = packer.choose(berry)         # before picking; None: set it aside, or leave it on the plant
packer.place(punnet, berry)           # after the drop
packer.observe(punnet, grams)         # with a weigh cell under it
for full in packer.due():
    packer.close(full)                # and a new one opens in its place
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, RobotError
from punnet.weight.packing.berries import BerryPopulation, WeighedBerry
from punnet.weight.packing.rule import AVERAGE_QUANTITY, PackingRule

__all__ = ["Packer", "PackingConfig", "PackingPolicy", "Punnet", "Tally"]

_BELOW_ZERO = 5.0  # grams that a weigh cell may drift below its tare before it is not believed
_TIE = 0.02  # grams of cost that do not count: the fuller punnet is preferred


@dataclass(frozen=True)
class PackingConfig:
    """What is packed, and with what.

    Parameters
    ----------
    nominal
        Grams on the label.
    most_berries
        Berries at which a punnet is full whatever it weighs.
    cell_error
        Standard deviation of a weigh cell's reading, grams; None: there are no weigh cells.
    rule
        What a batch of punnets has to keep.
    population
        The berries of the field.
    aside_places
        Berries that can lie aside at one time.

    Raises
    ------
    ConfigurationError
        If a value is out of its range, or the rule has no tolerance for the nominal weight.
    """

    nominal: float = 250.0
    most_berries: int = 18
    cell_error: float | None = 0.5
    rule: PackingRule = AVERAGE_QUANTITY
    population: BerryPopulation = field(default_factory=BerryPopulation)
    aside_places: int = 6

    def __post_init__(self) -> None:
        if self.most_berries < 1 or self.aside_places < 0:
            raise ConfigurationError(
                f"packing: most_berries must be ≥ 1 and aside_places ≥ 0, got {self.most_berries}, {self.aside_places}"
            )
        if self.cell_error is not None and not 0 <= self.cell_error < math.inf:
            raise ConfigurationError(f"packing: cell_error must be ≥ 0 g or None, got {self.cell_error}")
        self.rule.tolerance(self.nominal)

    @cached_property
    def tolerance(self) -> float:
        """The rule's tolerable negative error, grams."""
        return self.rule.tolerance(self.nominal)


@dataclass
class Punnet:
    """What is believed to be in a punnet: its last reading, and the berries that came since.

    Parameters
    ----------
    number
        Its name.
    berries
        All berries in it.
    reading, reading_variance
        Grams at the last reading of its weigh cell and the variance of that; 0 before the first, when it is empty.
    unread
        Mean and variance of each berry placed since, by its number.
    """

    number: int
    berries: list[WeighedBerry] = field(default_factory=list)
    reading: float = 0.0
    reading_variance: float = 0.0
    unread: dict[int, tuple[float, float]] = field(default_factory=dict)

    @property
    def grams(self) -> float:
        """Expected weight."""
        return self.reading + sum(mean for mean, _ in self.unread.values())

    @property
    def variance(self) -> float:
        """Variance of the weight, grams²."""
        return self.reading_variance + sum(variance for _, variance in self.unread.values())


@dataclass(frozen=True)
class Tally:
    """Punnets closed so far: their number and the sum of their weights, grams, as far as the packer knows."""

    punnets: int = 0
    grams: float = 0.0


class PackingPolicy(Protocol):
    """Decides where a berry goes and when a punnet is full; keeps no state of its own."""

    name: str
    config: PackingConfig
    price_aside: float
    """Cost, grams, above which a berry is rather set aside."""

    def costs(self, berry: WeighedBerry, punnets: Sequence[Punnet], tally: Tally) -> NDArray[np.float64]:
        """(K,) cost in grams of placing ``berry`` in each of ``punnets``, none of which is full."""
        ...

    def is_full(self, punnet: Punnet, tally: Tally) -> bool:
        """Whether a punnet is better closed than given one more berry."""
        ...


class Packer:
    """Keeps what is known of open punnets and of every berry, and asks the policy.

    Every berry that was placed is in exactly one of: an open punnet, a packed one, a rejected one, a missing one, aside,
    lost.

    Parameters
    ----------
    policy
        Who decides.
    places
        Punnets that stand open at a time; they are numbered from 0.

    Raises
    ------
    ConfigurationError
        If there is no place.
    """

    def __init__(self, policy: PackingPolicy, places: int = 4) -> None:
        if places < 1:
            raise ConfigurationError(f"packing: needs at least one place for a punnet, got {places}")
        self.policy = policy
        self.config = policy.config
        self.punnets: dict[int, Punnet] = {number: Punnet(number) for number in range(places)}
        self.packed: list[Punnet] = []
        self.rejected: list[Punnet] = []
        self.missing_punnets: list[Punnet] = []
        self.aside: list[WeighedBerry] = []
        self.lost_berries: list[WeighedBerry] = []
        self.handled_again = 0
        self.tally = Tally()
        self._opened = places

    def best(self, berry: WeighedBerry) -> tuple[int, float] | None:
        """The punnet where ``berry`` costs least, and that cost in grams; None if all are full."""
        candidates = [punnet for punnet in self.punnets.values() if not self._is_full(punnet)]
        if not candidates:
            return None
        costs = self.policy.costs(berry, candidates, self.tally)
        as_good = [
            punnet for punnet, cost in zip(candidates, costs, strict=True) if cost <= costs.min() + _TIE
        ]
        fullest = max(as_good, key=lambda punnet: (punnet.grams, len(punnet.berries)))
        return fullest.number, float(costs.min())

    def choose(self, berry: WeighedBerry) -> int | None:
        """The punnet where ``berry`` serves best; None if it is better set aside or all are full."""
        found = self.best(berry)
        return None if found is None or found[1] > self.policy.price_aside else found[0]

    def place(self, number: int, berry: WeighedBerry) -> None:
        """Note that ``berry`` was dropped into a punnet.

        Raises
        ------
        RobotError
            If the punnet is not there, holds as many berries as it may, or the berry lies in one already.
        """
        punnet = self._open(number)
        if len(punnet.berries) >= self.config.most_berries:
            raise RobotError(f"punnet {number}: holds {len(punnet.berries)} berries, no more may go in")
        if any(berry.number == other.number for held in self.punnets.values() for other in held.berries):
            raise RobotError(f"berry {berry.number}: lies in a punnet already")
        punnet.berries.append(berry)
        punnet.unread[berry.number] = self.config.population.belief(berry)

    def observe(self, number: int, grams: float) -> float:
        """Take in a weigh-cell reading of a punnet; grams that came in since the last.

        Raises
        ------
        RobotError
            If the punnet is not there, or the reading is no number or far below zero.
        """
        punnet = self._open(number)
        if not math.isfinite(grams) or grams < -_BELOW_ZERO:
            raise RobotError(f"punnet {number}: the weigh cell reads {grams:g} g; check and tare it")
        gained = grams - punnet.reading
        punnet.reading = float(grams)
        punnet.reading_variance = (self.config.cell_error or 0.0) ** 2
        punnet.unread.clear()
        return gained

    def lost(self, number: int, berry: WeighedBerry) -> None:
        """Note that a berry that was placed is not in the punnet after all; its last reading, if any, stays true.

        Raises
        ------
        RobotError
            If the berry was not placed there.
        """
        punnet = self._open(number)
        kept = [other for other in punnet.berries if other.number != berry.number]
        if len(kept) == len(punnet.berries):
            raise RobotError(
                f"berry {berry.number}: was not placed in punnet {number}, so it can't be lost from it"
            )
        punnet.berries = kept
        punnet.unread.pop(berry.number, None)
        self.lost_berries.append(berry)

    def missing(self, number: int) -> Punnet:
        """Note that a punnet was taken away with all that is in it; its place stays empty until :meth:`open`."""
        punnet = self._open(number)
        self.missing_punnets.append(self.punnets.pop(number))
        return punnet

    def open(self) -> int:
        """Stand an empty punnet ready; its number."""
        number = self._opened
        self._opened += 1
        self.punnets[number] = Punnet(number)
        return number

    def due(self) -> list[int]:
        """The open punnets that are full."""
        return [punnet.number for punnet in self.punnets.values() if self._is_full(punnet)]

    def close(self, number: int) -> Punnet:
        """Take a punnet away: packed, or rejected if it is likely to be short by more than the rule tolerates."""
        punnet = self._open(number)
        del self.punnets[number]
        if punnet.grams < self.config.nominal - self.config.tolerance:
            self.rejected.append(punnet)
        else:
            self.packed.append(punnet)
            self.tally = Tally(self.tally.punnets + 1, self.tally.grams + punnet.grams)
        return punnet

    def put_aside(self, berry: WeighedBerry) -> None:
        """Note that a berry lies aside until a punnet needs it.

        Raises
        ------
        RobotError
            If no place is free there.
        """
        if len(self.aside) >= self.config.aside_places:
            raise RobotError(
                f"berry {berry.number}: {len(self.aside)} berries lie aside, there is no more room"
            )
        self.aside.append(berry)

    def take_back(self) -> tuple[WeighedBerry, int] | None:
        """Take the berry from aside that serves best by now, if one serves; it and its punnet."""
        options = [(found, berry) for berry in self.aside if (found := self.best(berry)) is not None]
        if not options:
            return None
        (number, cost), berry = min(options, key=lambda option: option[0][1])
        if cost > 0:
            return None
        self.aside.remove(berry)
        self.handled_again += 1
        return berry, number

    def _open(self, number: int) -> Punnet:
        if number not in self.punnets:
            raise RobotError(f"punnet {number}: is not there; open ones are {sorted(self.punnets)}")
        return self.punnets[number]

    def _is_full(self, punnet: Punnet) -> bool:
        return len(punnet.berries) >= self.config.most_berries or self.policy.is_full(punnet, self.tally)
