"""What is known of a berry before it is packed, and of those that are still to come."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

from punnet.errors import ConfigurationError, ShapeError

__all__ = ["BerryPopulation", "WeighedBerry"]


@dataclass(frozen=True)
class WeighedBerry:
    """A berry with the estimate of its weight.

    Parameters
    ----------
    number
        Its name: no two berries that meet in one place share one.
    estimate
        Grams by eye, NaN where there is no estimate.
    low, high
        Bounds of the interval, grams; NaN where there is none.
    coverage
        Share of berries whose weight lies within their bounds.

    Raises
    ------
    ShapeError
        If an estimate is not positive, or the bounds are the wrong way round.
    """

    number: int
    estimate: float
    low: float = float("nan")
    high: float = float("nan")
    coverage: float = 0.9

    def __post_init__(self) -> None:
        if math.isnan(self.estimate):
            return
        if not 0 < self.estimate < math.inf:
            raise ShapeError(f"berry {self.number}: an estimate must be positive, got {self.estimate} g")
        if self.has_interval and self.low > self.high:
            raise ShapeError(
                f"berry {self.number}: its interval {self.low} … {self.high} g is the wrong way round"
            )
        if not 0 < self.coverage < 1:
            raise ShapeError(f"berry {self.number}: coverage must lie in (0, 1), got {self.coverage}")

    @property
    def has_interval(self) -> bool:
        """Whether both bounds are known."""
        return math.isfinite(self.low) and math.isfinite(self.high)


@dataclass(frozen=True)
class BerryPopulation:
    """The berries of a field: what the next one may weigh, and how well it is known before the weigh cell tells.

    The defaults are the measured weights of the thesis' berries and the error that its estimators aim at.

    Parameters
    ----------
    mean, spread
        Mean and standard deviation of the weights, grams.
    lightest, heaviest
        What berries weigh at least and at most, grams.
    error
        Standard deviation of estimate / weight.

    Raises
    ------
    ConfigurationError
        If these can't be.
    """

    mean: float = 18.6
    spread: float = 5.7
    lightest: float = 4.8
    heaviest: float = 38.9
    error: float = 0.09

    def __post_init__(self) -> None:
        if not (
            0 < self.lightest < self.mean < self.heaviest < math.inf and self.spread > 0 < self.error < 1
        ):
            raise ConfigurationError(
                "berry population: needs 0 < lightest < mean < heaviest, a positive spread and an error in (0, 1)"
            )

    def belief(self, berry: WeighedBerry) -> tuple[float, float]:
        """Mean and variance, grams and grams², of what a berry weighs.

        The estimate and its interval, taken as normal, and what berries weigh in this field, by Bayes' rule: an
        estimate that says little (a berry half hidden by a leaf) counts little.
        """
        prior = self.spread**2
        if math.isnan(berry.estimate):
            return self.mean, prior
        variance = (self.error * berry.estimate) ** 2
        if berry.has_interval:
            variance = max(1e-4, ((berry.high - berry.low) / (2.0 * _two_sided(berry.coverage))) ** 2)
        share = prior / (prior + variance)
        return share * berry.estimate + (1.0 - share) * self.mean, share * variance


def _two_sided(coverage: float) -> float:
    """Half-width of the standard normal's central interval."""
    return NormalDist().inv_cdf((1.0 + coverage) / 2.0)
