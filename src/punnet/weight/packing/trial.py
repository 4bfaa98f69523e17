"""Packing tried on batches of berries with an estimator's real errors: giveaway, the rule, what was handled again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.weight.packing.batches import Batch
from punnet.weight.packing.berries import WeighedBerry
from punnet.weight.packing.packer import Packer, PackingPolicy
from punnet.weight.packing.rule import RuleVerdict

__all__ = ["BatchResult", "TrialResult", "each_batch", "pack_batch", "run_trial"]


@dataclass(frozen=True, eq=False)
class BatchResult:
    """How a batch was packed.

    Parameters
    ----------
    weights
        (P,) true grams of the packed punnets.
    nominal
        Grams on their label.
    verdict
        Of the rule.
    berries, packed, rejected, aside
        Berries that came; in packed punnets; in rejected punnets; left aside at the end. The rest lie in open punnets.
    handled_again
        How often a berry was taken up from aside.
    """

    weights: NDArray[np.float64]
    nominal: float
    verdict: RuleVerdict
    berries: int
    packed: int
    rejected: int
    aside: int
    handled_again: int

    @property
    def giveaway(self) -> float:
        """Mean of (weight − nominal) / nominal over the packed punnets; NaN of none."""
        return float(np.mean(self.weights / self.nominal - 1.0)) if len(self.weights) else float("nan")


@dataclass(frozen=True, eq=False)
class TrialResult:
    """All batches of one policy."""

    name: str
    batches: tuple[BatchResult, ...]

    @property
    def weights(self) -> NDArray[np.float64]:
        """(P,) true grams of all packed punnets."""
        return np.concatenate([batch.weights for batch in self.batches])

    @property
    def giveaway(self) -> float:
        """Over all packed punnets; NaN of none."""
        nominal = self.batches[0].nominal
        return float(np.mean(self.weights / nominal - 1.0)) if len(self.weights) else float("nan")

    @property
    def passed(self) -> int:
        """Batches that keep the rule."""
        return sum(batch.verdict.passes for batch in self.batches)

    def to_json(self) -> dict[str, Any]:
        """The figures of a table's row: shares of 1, grams."""
        berries = sum(batch.berries for batch in self.batches)
        giveaways = [batch.giveaway for batch in self.batches if len(batch.weights)]
        return {
            "policy": self.name,
            "giveaway": _rounded(self.giveaway),
            "giveaway_of_worst_batch": _rounded(max(giveaways, default=float("nan"))),
            "standard_deviation_g": _rounded(
                float(np.std(self.weights)) if len(self.weights) else math.nan, 2
            ),
            "batches": len(self.batches),
            "batches_passed": self.passed,
            "punnets": len(self.weights),
            "punnets_short": sum(batch.verdict.short for batch in self.batches),
            "berries": berries,
            "packed": _rounded(sum(batch.packed for batch in self.batches) / berries),
            "rejected": _rounded(sum(batch.rejected + batch.aside for batch in self.batches) / berries),
            "handled_again": _rounded(sum(batch.handled_again for batch in self.batches) / berries),
        }


def pack_batch(policy: PackingPolicy, places: int, batch: Batch, rng: np.random.Generator) -> BatchResult:
    """Pack a batch on a line where each full punnet is replaced by an empty one.

    Weigh cells, where the policy's settings have them, read the true weight with their error.
    """
    line = _Line(Packer(policy, places), batch.true, rng)
    for berry in batch.berries:
        line.take(berry)
    packer, config = line.packer, policy.config
    weights = np.array([line.content(punnet.berries) for punnet in packer.packed])
    return BatchResult(
        weights=weights,
        nominal=config.nominal,
        verdict=config.rule.judge(weights, config.nominal),
        berries=len(batch.berries),
        packed=sum(len(punnet.berries) for punnet in packer.packed),
        rejected=sum(len(punnet.berries) for punnet in packer.rejected),
        aside=len(packer.aside),
        handled_again=packer.handled_again,
    )


def each_batch(
    policy: PackingPolicy, places: int, batches: Sequence[Batch], seed: int
) -> Iterator[BatchResult]:
    """Pack one batch after the other; the same seed gives the same readings of the weigh cells."""
    for number, batch in enumerate(batches):
        yield pack_batch(policy, places, batch, np.random.default_rng((seed, number)))


def run_trial(policy: PackingPolicy, places: int, batches: Sequence[Batch], seed: int) -> TrialResult:
    """Pack each batch by itself, as :func:`each_batch` does.

    Raises
    ------
    ConfigurationError
        If there is no batch, or one without berries.
    """
    if not batches or not all(batch.berries for batch in batches):
        raise ConfigurationError("packing trial: needs at least one batch, and berries in each")
    return TrialResult(policy.name, tuple(each_batch(policy, places, batches, seed)))


def _rounded(value: float, digits: int = 6) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None


class _Line:
    """A packing line: drops, weigh cells, and a new punnet for each full one."""

    def __init__(self, packer: Packer, true: NDArray[np.float64], rng: np.random.Generator) -> None:
        self.packer = packer
        self._true, self._rng = true, rng

    def content(self, berries: Sequence[WeighedBerry]) -> float:
        """True grams of some berries."""
        return float(sum(self._true[berry.number] for berry in berries))

    def take(self, berry: WeighedBerry) -> None:
        """A berry arrives; afterwards those aside may serve."""
        packer = self.packer
        number = packer.choose(berry)
        if number is None and len(packer.aside) < packer.config.aside_places:
            packer.put_aside(berry)
            return
        if number is None:
            found = packer.best(berry)
            assert found is not None  # a full punnet was replaced at once
            number = found[0]
        self._drop(number, berry)
        while (again := packer.take_back()) is not None:
            self._drop(again[1], again[0])

    def _drop(self, number: int, berry: WeighedBerry) -> None:
        packer, error = self.packer, self.packer.config.cell_error
        packer.place(number, berry)
        if error is not None:
            truth = self.content(packer.punnets[number].berries)
            packer.observe(number, truth + float(self._rng.normal(0.0, error)))
        for full in packer.due():
            packer.close(full)
            packer.open()
