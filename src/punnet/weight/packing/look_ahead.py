"""The packer's own policy: each berry where the expected end of the punnets is best, with the rule's risk in the target."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, ndtri

from punnet.errors import ConfigurationError
from punnet.weight.packing.berries import WeighedBerry
from punnet.weight.packing.end_value import EndValue, error_nodes
from punnet.weight.packing.packer import PackingConfig, Punnet, Tally
from punnet.weight.packing.rule import PackingRule

__all__ = ["LookAhead", "RiskLimits"]


@dataclass(frozen=True)
class RiskLimits:
    """How many standard deviations a punnet's expected weight must lie above each limit of a rule.

    So that a batch of ``punnets`` passes with ``confidence`` on each count: ``short`` above nominal − tolerance,
    ``far_short`` above nominal − twice the tolerance, ``mean`` above nominal for the mean of all.
    """

    short: float
    far_short: float
    mean: float

    @classmethod
    def of(cls, rule: PackingRule, punnets: int, confidence: float) -> RiskLimits:
        """From the binomial distribution of short packs among ``punnets``."""
        allowed = rule.most_short_of(punnets)
        share = betaincinv(allowed + 1, punnets - allowed, 1.0 - confidence)
        none = 1.0 - confidence ** (1.0 / punnets)
        return cls(
            -float(ndtri(share)), -float(ndtri(none)), float(ndtri(confidence)) if rule.mean_counts else 0.0
        )


class LookAhead:
    """Places each berry where it lowers most what the punnets are expected to cost in the end.

    :class:`~punnet.weight.packing.end_value.EndValue` tells what a punnet that lacks r grams is expected to cost; a
    berry's cost in a punnet is by how much that rises, averaged over what the berry may weigh. The target that r counts from
    lies above nominal by the least margin with which a batch passes the rule
    (:class:`RiskLimits`), and moves by what the punnets closed before were above or below theirs.

    Parameters
    ----------
    config
        What is packed.
    batch
        Punnets that the rule judges together.
    confidence
        Of passing each limit of the rule.
    decline
        Grams that it costs a punnet to let a berry pass; less with more punnets open.
    price_aside
        Grams of cost above which a berry is set aside.
    steering
        Punnets over which what was over or under before is made up for.

    Raises
    ------
    ConfigurationError
        If a value is out of its range.
    """

    name = "look-ahead"

    def __init__(
        self,
        config: PackingConfig | None = None,
        *,
        batch: int = 70,
        confidence: float = 0.998,
        decline: float = 0.1,
        price_aside: float = 2.0,
        steering: float = 5.0,
    ) -> None:
        self.config = config or PackingConfig()
        if batch < 1 or not 0.5 < confidence < 1 or decline <= 0 or price_aside < 0 or steering < 1:
            raise ConfigurationError(
                "packing: batch and steering must be ≥ 1, confidence in (0.5, 1), decline > 0, price_aside ≥ 0"
            )
        self.price_aside = price_aside
        self._batch, self._steering = batch, steering
        self._limits = RiskLimits.of(self.config.rule, batch, confidence)
        population = self.config.population
        self._cells = self.config.cell_error is not None
        self._value = EndValue.solve(
            self.config.nominal,
            self.config.most_berries,
            population,
            decline,
            population.error if self._cells else 0.0,
        )
        whole = float(self._value.waits(self.config.most_berries, self.config.nominal))
        self._end_variance = whole * self._value.scale
        self._nodes = error_nodes() if self._cells else np.zeros(1)
        self._usual_target = self.config.nominal + self._margin(Punnet(-1))

    def costs(self, berry: WeighedBerry, punnets: Sequence[Punnet], tally: Tally) -> NDArray[np.float64]:
        """(K,) grams by which the expected end of each punnet gets worse with ``berry`` in it; negative: better."""
        mean, variance = self.config.population.belief(berry)
        weights = np.maximum(0.0, mean + math.sqrt(variance) * self._nodes)
        return np.array([self._cost(punnet, weights, tally) for punnet in punnets])

    def is_full(self, punnet: Punnet, tally: Tally) -> bool:
        """Whether closing it now costs less than waiting for more."""
        left = self.config.most_berries - len(punnet.berries)
        lacking = self.target(punnet, tally) - punnet.grams
        return bool(punnet.berries) and self._value.closes(lacking) <= self._value.waits(left, lacking)

    def target(self, punnet: Punnet, tally: Tally) -> float:
        """Grams that a punnet is filled to, as well as can be foretold from what is in it."""
        return self.config.nominal + self._margin(punnet) - self._made_up(tally)

    def _cost(self, punnet: Punnet, weights: NDArray[np.float64], tally: Tally) -> float:
        left = self.config.most_berries - len(punnet.berries)
        lacking = self.target(punnet, tally) - punnet.grams
        after = self._value.ends(left - 1, lacking - weights)
        return float(after.sum() / len(after)) - self._value.waits(left, lacking)

    def _margin(self, punnet: Punnet) -> float:
        """Grams above nominal for what will not be known of the punnet's weight when it is closed."""
        if self.config.cell_error is not None:
            return self._margin_of(self.config.cell_error**2)
        population = self.config.population
        to_come = max(0.0, self.config.nominal - punnet.grams) / population.mean
        return self._margin_of(punnet.variance + to_come * (population.error * population.mean) ** 2)

    def _margin_of(self, unknown: float) -> float:
        """The same by the variance of what will not be known, grams²."""
        limits, tolerance = self._limits, self.config.tolerance
        spread = math.sqrt(unknown + self._end_variance)
        # What is over or under by choice is made up for by the next few; what is not known is not.
        mean = math.sqrt(unknown / self._batch + 2 * self._steering * self._end_variance / self._batch**2)
        return max(
            0.0,
            limits.short * spread - tolerance,
            limits.far_short * spread - 2 * tolerance,
            limits.mean * mean,
        )

    def _made_up(self, tally: Tally) -> float:
        """Grams to take off the target for what was packed above it before."""
        surplus = tally.grams - tally.punnets * self._usual_target
        most = self.config.nominal / 100.0
        return min(most, max(-most, surplus / self._steering))
