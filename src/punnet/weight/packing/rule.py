"""Rules that punnets of a nominal weight have to keep: what may be short, by how much, and how often."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from punnet.errors import ConfigurationError, ShapeError

__all__ = ["AVERAGE_QUANTITY", "MINIMUM_QUANTITY", "PackingRule", "RuleVerdict", "ToleranceBand"]

_ROUNDING = 1e-6  # grams; what a sum of floats may be off


@dataclass(frozen=True)
class ToleranceBand:
    """Tolerable negative error for nominal weights up to ``up_to`` grams: ``share`` of the nominal, plus ``grams``."""

    up_to: float
    share: float = 0.0
    grams: float = 0.0


@dataclass(frozen=True)
class RuleVerdict:
    """What a rule says of a batch.

    Parameters
    ----------
    count
        Packs judged.
    mean
        Their mean, grams; NaN of none.
    short, far_short
        Packs that are short of the nominal by more than the tolerable negative error, and by more than twice that.
    faults
        Why the batch fails, in words; empty if it passes.
    """

    count: int
    mean: float
    short: int
    far_short: int
    faults: tuple[str, ...]

    @property
    def passes(self) -> bool:
        """Whether the batch may be sold as it is."""
        return not self.faults


@dataclass(frozen=True)
class PackingRule:
    """A rule for packs of equal nominal weight; another country's or customer's is another instance.

    Parameters
    ----------
    name, source
        What it is called and where it is written.
    bands
        Tolerable negative error by nominal weight, in ascending order; a nominal above the last band is refused.
    most_short
        Share of a batch that may be short by more than the tolerable negative error.
    mean_counts
        Whether the batch's mean must reach the nominal; if not, only single packs count.

    Raises
    ------
    ConfigurationError
        If bands are missing or out of order, or ``most_short`` is no share.
    """

    name: str
    source: str
    bands: tuple[ToleranceBand, ...]
    most_short: float
    mean_counts: bool = True

    def __post_init__(self) -> None:
        limits = [band.up_to for band in self.bands]
        if not limits or limits != sorted(set(limits)) or not 0 <= self.most_short < 1:
            raise ConfigurationError(
                f"packing rule '{self.name}': needs bands in ascending order and a share in [0, 1) of short packs"
            )

    def tolerance(self, nominal: float) -> float:
        """Tolerable negative error in grams; one that is a share is rounded up to the next tenth of a gram.

        Raises
        ------
        ConfigurationError
            If the rule has no band for ``nominal``.
        """
        if math.isfinite(nominal) and nominal > 0:
            for band in self.bands:
                if nominal <= band.up_to:
                    return math.ceil(round(10 * band.share * nominal, 6)) / 10 + band.grams
        raise ConfigurationError(
            f"packing rule '{self.name}': has no tolerance for a nominal weight of {nominal:g} g; "
            f"it goes up to {self.bands[-1].up_to:g} g"
        )

    def most_short_of(self, count: int) -> int:
        """How many of ``count`` packs may be short by more than the tolerance."""
        return math.floor(self.most_short * count + 1e-9)

    def judge(self, grams: ArrayLike, nominal: float) -> RuleVerdict:
        """Judge a batch by the true net weights (N,) of its packs; a batch of none passes.

        Raises
        ------
        ShapeError
            If the weights are no list of finite numbers.
        """
        weights = np.asarray(grams, dtype=np.float64)
        if weights.ndim != 1 or not np.isfinite(weights).all():
            raise ShapeError(f"packing rule: needs a list of finite weights, got shape {weights.shape}")
        tolerance, count = self.tolerance(nominal), len(weights)
        short = int((weights < nominal - tolerance - _ROUNDING).sum())
        far_short = int((weights < nominal - 2 * tolerance - _ROUNDING).sum())
        mean = float(weights.mean()) if count else float("nan")
        faults = []
        if short > self.most_short_of(count):
            faults.append(
                f"{short} of {count} are more than {tolerance:g} g short, {self.most_short_of(count)} may be"
            )
        if far_short:
            faults.append(f"{far_short} of {count} are more than {2 * tolerance:g} g short, none may be")
        if self.mean_counts and mean < nominal - _ROUNDING:
            faults.append(f"their mean is {mean:.2f} g, less than {nominal:g} g")
        return RuleVerdict(count, mean, short, far_short, tuple(faults))


AVERAGE_QUANTITY = PackingRule(
    name="average quantity",
    source="Directive 76/211/EEC, Annex I; The Weights and Measures (Packaged Goods) Regulations 2006 (UK), Schedule 3",
    bands=(
        ToleranceBand(50, share=0.09),
        ToleranceBand(100, grams=4.5),
        ToleranceBand(200, share=0.045),
        ToleranceBand(300, grams=9.0),
        ToleranceBand(500, share=0.03),
        ToleranceBand(1_000, grams=15.0),
        ToleranceBand(10_000, share=0.015),
    ),
    most_short=0.025,
)
"""The ℮ rules for pre-packs: 5 g to 10 kg; mean not below nominal, 2.5% may be short by more than the tolerance."""

MINIMUM_QUANTITY = PackingRule(
    name="minimum quantity",
    source="no pack below its label, as some customers ask for",
    bands=(ToleranceBand(math.inf),),
    most_short=0.0,
)
"""Not one pack below nominal."""
