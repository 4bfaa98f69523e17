"""The packer beside what is done without it, on the same berries: with weigh cells under the punnets, and without."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.weight.packing.baselines import FillByCount, FirstFit
from punnet.weight.packing.batches import Batch, EstimationErrors, draw_batch
from punnet.weight.packing.look_ahead import LookAhead
from punnet.weight.packing.packer import PackingConfig, PackingPolicy
from punnet.weight.packing.trial import TrialResult, each_batch, run_trial

__all__ = ["BAR", "Comparison", "Setting", "compare"]

BAR = 0.02
"""Giveaway that a packer should stay under while every batch keeps the rule."""

_MOST_MARGIN = 30  # grams above nominal that first-fit's target is tried at


@dataclass(frozen=True, eq=False)
class Setting:
    """Results of all policies with weigh cells (``cell_error`` grams) or without (None); the packer's own comes first."""

    cell_error: float | None
    results: tuple[TrialResult, ...]

    @property
    def name(self) -> str:
        """In words."""
        return "without weigh cells" if self.cell_error is None else "with weigh cells"

    @property
    def meets_bar(self) -> bool:
        """Whether the packer gives away at most :data:`BAR` and every batch keeps the rule."""
        own = self.results[0]
        return own.passed == len(own.batches) and own.giveaway <= BAR


@dataclass(frozen=True, eq=False)
class Comparison:
    """Both settings, and what they were made with."""

    settings: tuple[Setting, ...]
    config: PackingConfig
    places: int
    seed: int

    def to_json(self) -> dict[str, Any]:
        """Every figure of the table."""
        config, population = self.config, self.config.population
        return {
            "nominal_g": config.nominal,
            "rule": config.rule.name,
            "tolerance_g": config.tolerance,
            "most_berries": config.most_berries,
            "places": self.places,
            "aside_places": config.aside_places,
            "population": {
                "mean_g": population.mean,
                "spread_g": population.spread,
                "error": round(population.error, 4),
            },
            "seed": self.seed,
            "bar": BAR,
            "settings": [
                {
                    "name": setting.name,
                    "cell_error_g": setting.cell_error,
                    "meets_bar": setting.meets_bar,
                    "results": [result.to_json() for result in setting.results],
                }
                for setting in self.settings
            ],
        }


def compare(
    errors: EstimationErrors,
    config: PackingConfig | None = None,
    *,
    batches: int = 20,
    berries: int = 1_000,
    places: int = 4,
    seed: int = 0,
    weights: NDArray[np.float64] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Comparison:
    """Pack ``batches`` × ``berries`` by every policy in both settings.

    First-fit and filling by count stand there as they come, and at the target or count that gives away least
    of those with which *these* batches pass: better than anybody who had to choose it beforehand could do.

    Parameters
    ----------
    errors
        What the estimator's estimates were off by.
    config
        What is packed; its ``cell_error`` is that of the setting with weigh cells, and its population's error is replaced
        by that of ``errors``.
    weights
        (M,) measured weights to draw from; the config's population if None.
    progress
        Told of each policy that is done.

    Raises
    ------
    ConfigurationError
        If a number is not positive, or the config has no weigh cells to compare with.
    """
    config = config or PackingConfig()
    if batches < 1 or berries < 1 or seed < 0:
        raise ConfigurationError(
            f"packing: needs batches, berries ≥ 1 and seed ≥ 0, got {batches}, {berries}, {seed}"
        )
    if config.cell_error is None:
        raise ConfigurationError(
            "packing: cell_error is that of the setting with weigh cells, so it can't be None"
        )
    population = config.population
    if weights is not None:
        population = replace(
            population,
            mean=float(weights.mean()),
            spread=float(weights.std()),
            lightest=float(weights.min()),
            heaviest=float(weights.max()),
        )
    population = replace(population, error=errors.typical(population))
    config = replace(config, population=population)
    drawn = [
        draw_batch(np.random.default_rng((seed, number)), berries, errors, population, weights)
        for number in range(batches)
    ]
    settings = []
    for cell_error in (config.cell_error, None):
        trials = _Trials(
            replace(config, cell_error=cell_error), drawn, places, seed, progress or (lambda name: None)
        )
        settings.append(Setting(cell_error, tuple(trials.all())))
    return Comparison(tuple(settings), config, places, seed)


@dataclass(frozen=True, eq=False)
class _Trials:
    """All policies on the same batches."""

    config: PackingConfig
    batches: Sequence[Batch]
    places: int
    seed: int
    progress: Callable[[str], None]

    def all(self) -> Iterable[TrialResult]:
        """The packer's own first."""
        config = self.config
        yield self._run(LookAhead(config), LookAhead.name)
        yield self._run(FirstFit(config), FirstFit.name)
        margins = range(-math.floor(config.tolerance), _MOST_MARGIN + 1)
        targets = [(FirstFit(config, margin), config.nominal + margin) for margin in margins]
        yield from self._first_passing(targets, "first-fit to {:g} g, the best target")
        least = math.ceil(config.nominal / config.population.mean)
        counts = [(FillByCount(config, count), count) for count in range(least, config.most_berries + 1)]
        yield from (self._run(policy, f"{count} berries each") for policy, count in counts[:1])
        yield from self._first_passing(counts[1:], "{:g} berries each, the least that passes")

    def _run(self, policy: PackingPolicy, name: str) -> TrialResult:
        result = run_trial(policy, self.places, self.batches, self.seed)
        self.progress(name)
        return replace(result, name=name)

    def _first_passing(
        self, policies: Iterable[tuple[PackingPolicy, float]], name: str
    ) -> Iterable[TrialResult]:
        """The first of ``policies``, in the order of what they give away, with which every batch passes; else nothing."""
        for policy, parameter in policies:
            if all(
                result.verdict.passes for result in each_batch(policy, self.places, self.batches, self.seed)
            ):
                yield self._run(policy, name.format(parameter))
                return
