"""The figures of a benchmark: shares with 95% intervals, forces, errors, times, and why berries were missed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from punnet.harvest.benchmark_plants import AttemptResult, PlantResult
from punnet.harvest.judge import Fate
from punnet.weight.packing import LookAhead, PackingConfig, WeighedBerry
from punnet.weight.packing.batches import Batch
from punnet.weight.packing.trial import pack_batch

__all__ = ["NEVER_TRIED", "PICKED_OFF", "figures_of", "missed_berries", "wilson_interval"]

NEVER_TRIED = "look: never recognised as ripe and in reach"
PICKED_OFF = "another berry's pick: came off with it"
PUNNETS_OPEN = 2


def figures_of(plants: Sequence[PlantResult]) -> dict[str, Any]:
    """All figures of some plants, as plain values; null where there is nothing to take a figure of."""
    fates = [fate for plant in plants for fate in plant.fates]
    wanted = [fate for fate in fates if fate.pluckable and fate.reachable]
    detached = [fate for fate in fates if fate.detached]
    unripe = [fate for fate in fates if not fate.pluckable]
    attempts = [attempt for plant in plants for attempt in plant.attempts]
    picks = sum(attempt.picked for attempt in attempts)
    return {
        "clusters": len(plants),
        "berries": len(fates),
        "pluckable": sum(fate.pluckable for fate in fates),
        "reachable_pluckable": len(wanted),
        "attempts": len(attempts),
        "picks": picks,
        "success": _share(sum(fate.success for fate in wanted), len(wanted)),
        "wrong_picks": _share(sum(fate.wrongly_picked for fate in detached), len(detached)),
        "damaged": _share(sum(fate.damaged for fate in detached), len(detached)),
        "unripe_touched": _share(sum(fate.collided for fate in unripe), len(unripe)),
        "unripe_force_n": _spread(fate.tool_force for fate in unripe if fate.collided),
        "collisions_during": _collisions(plants),
        "seconds_a_pick": _ratio(sum(plant.seconds_simulated for plant in plants), picks),
        "computing_seconds_a_pick": _ratio(sum(plant.seconds_computing for plant in plants), picks),
        "computing_seconds_an_attempt": _ratio(
            sum(plant.seconds_computing for plant in plants), len(attempts)
        ),
        "located_error_mm": _spread(1e3 * attempt.located_error for attempt in attempts),
        "cut_error_mm": _spread(1e3 * attempt.cut_error for attempt in attempts),
        "weight": _weights(attempts),
        "packing": _packing(attempts),
        "failed_attempts": dict(Counter(a.kind for a in attempts if not a.picked).most_common()),
        "missed": dict(Counter(missed_berries(plants)).most_common()),
        "errors": {str(plant.seed): plant.error for plant in plants if plant.error},
        "per_cluster": [_plant(plant) for plant in plants],
    }


def wilson_interval(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson score interval of a share; (0, 1) for no trials."""
    if count == 0:
        return 0.0, 1.0
    share = hits / count
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * math.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return max(0.0, centre - half), min(1.0, centre + half)


def missed_berries(plants: Iterable[PlantResult]) -> list[str]:
    """Why, for each reachable ripe berry that does not lie in a punnet: the reason of the last attempt at it."""
    reasons = []
    for plant in plants:
        last = {attempt.aimed: attempt for attempt in plant.attempts}
        for fate in plant.fates:
            if fate.pluckable and fate.reachable and not fate.success:
                reasons.append(_why(fate, last.get(fate.index)))
    return reasons


def _why(fate: Fate, last: AttemptResult | None) -> str:
    if last is None:
        return PICKED_OFF if fate.detached else NEVER_TRIED
    # It went by the weigh cell and is not in the punnet all the same: another berry fell in, or it rolled out.
    return "place: not in the punnet in the end" if last.picked else last.kind


def _collisions(plants: Iterable[PlantResult]) -> dict[str, int]:
    """When unripe berries that stay on the plant were run into for the first time."""
    during: Counter[str] = Counter()
    for plant in plants:
        counted = {fate.index for fate in plant.fates if fate.collided and not fate.pluckable}
        during.update(hit.during for hit in plant.collisions if hit.berry in counted)
    return dict(during.most_common())


def _weights(attempts: Sequence[AttemptResult]) -> dict[str, Any]:
    """Relative errors of the estimates of what was picked: bias, mean size, and the share within a tenth (PCW@.10)."""
    known = [
        (a.estimate, a.true_weight) for a in attempts if a.picked and a.estimate > 0 and a.true_weight > 0
    ]
    errors = np.array([(estimate - true) / true for estimate, true in known])
    if not len(errors):
        return {"berries": 0, "bias": None, "mean_error": None, "within_10_percent": None}
    return {
        "berries": len(errors),
        "bias": round(float(errors.mean()), 4),
        "mean_error": round(float(np.abs(errors).mean()), 4),
        "within_10_percent": _share(int((np.abs(errors) <= 0.10).sum()), len(errors)),
    }


def _packing(attempts: Sequence[AttemptResult]) -> dict[str, Any]:
    """What is given away when all that was picked goes, in order, into punnets that are replaced when full.

    One plant does not fill a punnet. The packer is the loop's, with the estimates that the loop had; its weigh cells
    read the truth.
    """
    picked = [attempt for attempt in attempts if attempt.picked and attempt.true_weight > 0]
    berries = tuple(
        WeighedBerry(number, attempt.estimate if attempt.estimate > 0 else math.nan, *attempt.interval)
        for number, attempt in enumerate(picked)
    )
    config = PackingConfig(cell_error=0.0)
    if not berries:
        return {"nominal_g": config.nominal, "punnets": 0, "giveaway": None, "short": 0}
    batch = Batch(berries, np.array([attempt.true_weight for attempt in picked]))
    packed = pack_batch(LookAhead(config), PUNNETS_OPEN, batch, np.random.default_rng(0))
    return {
        "nominal_g": config.nominal,
        "punnets": len(packed.weights),
        "giveaway": round(packed.giveaway, 4) if len(packed.weights) else None,
        "short": packed.verdict.short,
    }


def _share(hits: int, count: int) -> dict[str, Any]:
    low, high = wilson_interval(hits, count)
    return {
        "hits": hits,
        "of": count,
        "share": round(hits / count, 4) if count else None,
        "interval_95": [round(low, 4), round(high, 4)],
    }


def _spread(values: Iterable[float]) -> dict[str, Any]:
    """Median, 95th percentile and largest of the finite ones."""
    finite = np.array([value for value in values if math.isfinite(value)])
    if not len(finite):
        return {"count": 0, "median": None, "p95": None, "largest": None}
    return {
        "count": len(finite),
        "median": round(float(np.median(finite)), 2),
        "p95": round(float(np.percentile(finite, 95)), 2),
        "largest": round(float(finite.max()), 2),
    }


def _ratio(total: float, count: int) -> float | None:
    return round(total / count, 3) if count else None


def _plant(plant: PlantResult) -> dict[str, Any]:
    wanted = [fate for fate in plant.fates if fate.pluckable and fate.reachable]
    return {
        "number": plant.number,
        "seed": plant.seed,
        "success": sum(fate.success for fate in wanted),
        "of": len(wanted),
        "wrong_picks": sum(fate.wrongly_picked for fate in plant.fates),
        "damaged": sum(fate.damaged and fate.detached for fate in plant.fates),
        "unripe_touched": sum(fate.collided and not fate.pluckable for fate in plant.fates),
        "failed_attempts": [
            {"berry": a.aimed, "phase": a.phase, "reason": a.reason} for a in plant.attempts if not a.picked
        ],
    }
