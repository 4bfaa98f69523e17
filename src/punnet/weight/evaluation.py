"""How good weight estimates are, over all berries of a set, by what hides them and by how far away they are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.weight.ellipsoid import EllipsoidEstimator
from punnet.weight.estimator import WeightEstimates, WeightEstimator, gather_estimates
from punnet.weight.metrics import PCW_TOLERANCES, WeightErrors, percent_correct_weight, weight_errors
from punnet.weight.observation import BerryObservation
from punnet.weight.samples import WeightSamples

__all__ = [
    "DISTANCES",
    "OCCLUDED_FROM",
    "Coverage",
    "EvaluatedPart",
    "IntervalWeigher",
    "Weigher",
    "WeightEvaluation",
    "evaluate_weights",
    "weigh_samples",
]

OCCLUDED_FROM = 0.1
"""Share of a fruit's outline that something else hides, from which it counts as occluded."""

DISTANCES = {"near": (0.0, 0.32), "middle": (0.32, 0.45), "far": (0.45, math.inf)}
"""Metres from the camera to the berry's surface."""

WEIGHT_BANDS = (0.0, 12.0, 16.0, 20.0, 24.0, math.inf)
"""Grams between which coverage is told apart, by true weight."""


_NO_COVERAGE = 0.9  # of intervals that are not there


@runtime_checkable
class Weigher(Protocol):
    """A trained model that says grams."""

    def predict(self, observations: Sequence[BerryObservation]) -> NDArray[np.float64]:
        """Grams, (N,)."""
        ...


@runtime_checkable
class IntervalWeigher(Protocol):
    """A trained model that says grams and an interval, or the estimator of a bundle."""

    def weigh(self, observations: list[Any]) -> WeightEstimates:
        """Grams with intervals of N observations."""
        ...


@dataclass(frozen=True)
class Coverage:
    """How often intervals hold the true weight.

    Parameters
    ----------
    berries
        With an interval.
    inside
        Percentage of them whose interval holds the weight; NaN for none.
    width
        Median width of the interval, per cent of the estimate; NaN for none.
    """

    berries: int
    inside: float
    width: float


@dataclass(frozen=True)
class EvaluatedPart:
    """Measures over some of the berries.

    Parameters
    ----------
    name
        Which: ``all``, ``free``, ``occluded``, ``near``, ``middle``, ``far``.
    pcw
        Percentage of correct weights by tolerance, of all berries: one without an estimate counts as wrong.
    pcw_weighed
        The same of those that have an estimate; NaN for none.
    errors
        Over the berries that have an estimate.
    coverage
        Of the intervals, None if there are none.
    """

    name: str
    pcw: dict[float, float]
    pcw_weighed: dict[float, float]
    errors: WeightErrors
    coverage: Coverage | None


@dataclass(frozen=True)
class WeightEvaluation:
    """Every measure of an estimator on a set of berries.

    Parameters
    ----------
    estimator, data, masks
        Names: who weighed, what, and whose masks were weighed.
    parts
        The whole first.
    coverage_by_weight
        Of the intervals by bands of true weight; empty without intervals.
    refused
        Berries that could not be observed, by reason.
    nominal
        Coverage that the intervals promise, None without intervals.
    """

    estimator: str
    data: str
    masks: str
    parts: tuple[EvaluatedPart, ...]
    coverage_by_weight: dict[str, Coverage]
    refused: dict[str, int]
    nominal: float | None

    @property
    def whole(self) -> EvaluatedPart:
        """Over all berries."""
        return self.parts[0]

    def part(self, name: str) -> EvaluatedPart | None:
        """The part of that name, None if it has no berries."""
        return next((part for part in self.parts if part.name == name), None)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON; tolerances as text, what is not known as null."""
        return {
            "estimator": self.estimator,
            "data": self.data,
            "masks": self.masks,
            "parts": {part.name: _part_json(part) for part in self.parts},
            "coverage_by_weight": {band: _plain(asdict(c)) for band, c in self.coverage_by_weight.items()},
            "refused": self.refused,
            "nominal_coverage": self.nominal,
        }


def evaluate_weights(
    samples: WeightSamples, estimates: WeightEstimates, *, estimator: str, data: str, masks: str = "truth"
) -> WeightEvaluation:
    """Measure what was said of ``samples``; berries that could not be observed count as berries without an estimate.

    Parameters
    ----------
    samples
        What was weighed.
    estimates
        Of each of them; intervals are all NaN if there are none.
    estimator, data, masks
        For the report.

    Raises
    ------
    ShapeError
        If there are no samples, or not one estimate for each.
    """
    if len(estimates.grams) != len(samples) or not len(samples):
        raise ShapeError(
            f"evaluation: {len(estimates.grams)} estimates for {len(samples)} berries; need one each, at least one"
        )
    missed = samples.missed
    nowhere = np.full(len(missed), np.nan)
    true = np.concatenate([samples.grams, [berry.grams for berry in missed]])
    told = np.concatenate([estimates.grams, nowhere])
    intervals = np.concatenate([estimates.intervals, np.full((len(missed), 2), np.nan)])
    occlusion = np.concatenate([samples.occlusion, [berry.occlusion for berry in missed]])
    distance = np.concatenate([samples.distance, nowhere])
    has_intervals = bool(np.isfinite(estimates.intervals).any())
    parts = tuple(
        EvaluatedPart(
            name=name,
            pcw=percent_correct_weight(true[chosen], told[chosen]),
            pcw_weighed=_pcw_weighed(true[chosen], told[chosen]),
            errors=weight_errors(true[chosen], told[chosen]),
            coverage=_coverage(true[chosen], told[chosen], intervals[chosen]) if has_intervals else None,
        )
        for name, chosen in _parts(occlusion, distance)
        if chosen.any()
    )
    bands = {_band(low, high): (true >= low) & (true < high) for low, high in pairwise(WEIGHT_BANDS)}
    return WeightEvaluation(
        estimator=estimator,
        data=data,
        masks=masks,
        parts=parts,
        coverage_by_weight={
            name: _coverage(true[chosen], told[chosen], intervals[chosen])
            for name, chosen in bands.items()
            if has_intervals and chosen.any()
        },
        refused=samples.refused,
        nominal=estimates.coverage if has_intervals else None,
    )


def weigh_samples(
    weigher: WeightEstimator | Weigher | IntervalWeigher, samples: WeightSamples
) -> WeightEstimates:
    """What an estimator, or a model that was just trained, says of observed berries.

    A model that has only ``predict`` gives no intervals: NaN.

    Raises
    ------
    ConfigurationError
        If it weighs whole frames only.
    """
    seen = list(samples.observations)
    if isinstance(weigher, EllipsoidEstimator):
        return gather_estimates([weigher.weigh(berry) for berry in seen], weigher.config.coverage)
    if isinstance(weigher, IntervalWeigher):
        return weigher.weigh(seen)
    if isinstance(weigher, Weigher):
        grams = weigher.predict(seen)
        return gather_estimates([(gram, math.nan, math.nan) for gram in grams.tolist()], _NO_COVERAGE)
    raise ConfigurationError(f"{weigher.name}: weighs whole frames only; it can't be evaluated on samples")


def _parts(
    occlusion: NDArray[np.float64], distance: NDArray[np.float64]
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    yield "all", np.ones(len(occlusion), dtype=np.bool_)
    yield "free", np.asarray(occlusion < OCCLUDED_FROM)
    yield "occluded", np.asarray(occlusion >= OCCLUDED_FROM)
    for name, (near, far) in DISTANCES.items():
        yield name, np.asarray((distance >= near) & (distance < far))


def _pcw_weighed(true: NDArray[np.float64], told: NDArray[np.float64]) -> dict[float, float]:
    known = np.isfinite(told)
    if not known.any():
        return dict.fromkeys(PCW_TOLERANCES, math.nan)
    return percent_correct_weight(true[known], told[known])


def _coverage(
    true: NDArray[np.float64], told: NDArray[np.float64], intervals: NDArray[np.float64]
) -> Coverage:
    known = np.isfinite(intervals).all(axis=1)
    if not known.any():
        return Coverage(0, math.nan, math.nan)
    low, high = intervals[known].T
    inside = (low <= true[known]) & (true[known] <= high)
    return Coverage(
        int(known.sum()),
        100.0 * float(inside.mean()),
        100.0 * float(np.median((high - low) / told[known])),
    )


def _band(low: float, high: float) -> str:
    if low == 0.0:
        return f"under {high:g} g"
    return f"{low:g} g and more" if math.isinf(high) else f"{low:g} to {high:g} g"


def _part_json(part: EvaluatedPart) -> dict[str, Any]:
    return _plain(
        {
            "pcw": _pcw_json(part.pcw),
            "pcw_weighed": _pcw_json(part.pcw_weighed),
            "mape": part.errors.mean_percentage,
            "rmse_g": part.errors.root_mean_square,
            "bias_g": part.errors.bias,
            "berries": part.errors.count + part.errors.missing,
            "without_estimate": part.errors.missing,
            "interval": None if part.coverage is None else _plain(asdict(part.coverage)),
        }
    )


def _pcw_json(pcw: dict[float, float]) -> dict[str, Any]:
    return _plain({f"{tolerance:.2f}": value for tolerance, value in pcw.items()})


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in values.items()
    }
