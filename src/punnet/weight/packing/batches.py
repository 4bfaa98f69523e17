"""Batches of berries to try packing on: weights of a field, estimates with the errors that an estimator really makes."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError, ShapeError
from punnet.weight.packing.berries import BerryPopulation, WeighedBerry

__all__ = ["Batch", "EstimationErrors", "draw_batch", "read_errors", "read_weights"]

_NEIGHBOURS = 40
_COLUMNS = ("true_g", "estimate_g", "low_g", "high_g")


@dataclass(frozen=True, eq=False)
class EstimationErrors:
    """True weights (N,) of berries with an estimator's ``estimates`` (N,) and ``intervals`` (N, 2), grams.

    NaN where the estimator gave none.

    Raises
    ------
    ShapeError
        If the shapes differ, there are none, a weight is not positive, or an interval's bounds are out of order.
    """

    true: NDArray[np.float64]
    estimates: NDArray[np.float64]
    intervals: NDArray[np.float64]
    coverage: float = 0.9

    def __post_init__(self) -> None:
        n = len(self.true)
        if (
            n == 0
            or self.true.shape != (n,)
            or self.estimates.shape != (n,)
            or self.intervals.shape != (n, 2)
        ):
            raise ShapeError(
                f"estimation errors: need (N,), (N,) and (N, 2), N ≥ 1, got {self.true.shape}, "
                f"{self.estimates.shape} and {self.intervals.shape}"
            )
        if not ((self.true > 0) & np.isfinite(self.true)).all() or (self.estimates <= 0).any():
            raise ShapeError("estimation errors: weights and estimates must be positive")
        if (self.intervals[:, 0] > self.intervals[:, 1]).any():
            raise ShapeError("estimation errors: an interval is the wrong way round")

    def typical(self, population: BerryPopulation) -> float:
        """Error of what a packer believes, root mean square, as a share of the mean weight."""
        believed = [population.belief(self.berry(row, 0, 1.0))[0] for row in range(len(self.true))]
        return float(np.sqrt(np.mean((np.array(believed) - self.true) ** 2))) / population.mean

    def berry(self, row: int, number: int, factor: float) -> WeighedBerry:
        """A berry ``factor`` times as heavy as that of a row, with the same relative error."""
        low, high = (float(bound) * factor for bound in self.intervals[row])
        return WeighedBerry(number, float(self.estimates[row]) * factor, low, high, self.coverage)


@dataclass(frozen=True, eq=False)
class Batch:
    """Berries in the order in which they come, and their true weights in grams by number."""

    berries: tuple[WeighedBerry, ...]
    true: NDArray[np.float64]


def draw_batch(
    rng: np.random.Generator,
    count: int,
    errors: EstimationErrors,
    population: BerryPopulation,
    weights: NDArray[np.float64] | None = None,
) -> Batch:
    """Draw berries of the field, each with the error of an estimate that was made of a berry about as heavy.

    Parameters
    ----------
    count
        Berries.
    errors
        Real errors; estimate and bounds are scaled with the berry.
    population
        The normal distribution of the weights, cut at the lightest and heaviest.
    weights
        (M,) measured weights to draw from in its place.
    """
    true = _draw_weights(rng, count, population) if weights is None else rng.choice(weights, count)
    order = np.argsort(errors.true)
    at = np.searchsorted(errors.true[order], true) + rng.integers(
        -_NEIGHBOURS // 2, _NEIGHBOURS // 2 + 1, count
    )
    rows = order[np.clip(at, 0, len(order) - 1)]
    factors = true / errors.true[rows]
    berries = (errors.berry(int(rows[number]), number, float(factors[number])) for number in range(count))
    return Batch(tuple(berries), true)


def read_errors(path: str | Path) -> EstimationErrors:
    """Read an estimator's errors: CSV with the columns ``true_g estimate_g low_g high_g``, or JSON with a list of such rows.

    In JSON the list may be the document or its ``rows``, beside the intervals' ``coverage`` if it is not 0.9. An empty cell,
    NaN or null is a berry without an estimate. ``benchmarks/weight_pairs.py`` writes such a CSV for any estimator.

    Raises
    ------
    FileFormatError
        If the file can't be read, a column or all rows are missing, or a value is no number or not possible.
    """
    path = Path(path)
    rows, coverage = _rows(path)
    if not rows:
        raise FileFormatError(f"{path}: has no rows of {', '.join(_COLUMNS)}")
    table = np.array(
        [
            [_number(row, column, f"{path}, row {number}") for column in _COLUMNS]
            for number, row in enumerate(rows, 1)
        ]
    ).reshape(-1, len(_COLUMNS))
    try:
        return EstimationErrors(table[:, 0], table[:, 1], table[:, 2:], coverage)
    except ShapeError as error:
        raise FileFormatError(f"{path}: {error}") from error


def read_weights(path: str | Path) -> NDArray[np.float64]:
    """Read measured weights in grams from the column ``weight`` (or ``true_g``) of a CSV file.

    Raises
    ------
    FileFormatError
        If the file can't be read, or has no positive numbers there.
    """
    path = Path(path)
    rows, _ = _rows(path)
    column = next((name for name in ("weight", "true_g") if rows and name in rows[0]), None)
    if column is None:
        raise FileFormatError(f"{path}: has no column 'weight' with berries' weights in grams")
    weights = np.array([_number(row, column, f"{path}, row {number}") for number, row in enumerate(rows, 1)])
    if not ((weights > 0) & np.isfinite(weights)).all():
        raise FileFormatError(f"{path}: the weights must be positive, in grams")
    return weights


def _rows(path: Path) -> tuple[list[Mapping[str, Any]], float]:
    """Rows by column name, and the intervals' coverage."""
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix.lower() != ".json":
            return list(csv.DictReader(text.splitlines())), 0.9
        document = json.loads(text)
    except OSError as error:
        raise FileFormatError(f"{path}: can't be read as a table of weights: {error.strerror}") from error
    except ValueError as error:
        raise FileFormatError(f"{path}: can't be read as a table of weights: {error}") from error
    rows = document.get("rows") if isinstance(document, dict) else document
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FileFormatError(f"{path}: has no list of rows with {', '.join(_COLUMNS)}")
    coverage = document.get("coverage", 0.9) if isinstance(document, dict) else 0.9
    if not isinstance(coverage, float) or not 0 < coverage < 1:
        raise FileFormatError(f"{path}: coverage must be a share in (0, 1), got {coverage!r}")
    return rows, coverage


def _number(row: Mapping[str, Any], column: str, where: str) -> float:
    if column not in row:
        raise FileFormatError(f"{where}: has no '{column}'; columns are {', '.join(map(str, row))}")
    value = row[column]
    try:
        return math.nan if value in (None, "") else float(value)
    except (TypeError, ValueError):
        raise FileFormatError(f"{where}: '{column}' must be a number, got {value!r}") from None


def _draw_weights(rng: np.random.Generator, count: int, population: BerryPopulation) -> NDArray[np.float64]:
    """A normal distribution cut at both ends."""
    weights = rng.normal(population.mean, population.spread, count)
    while (outside := (weights < population.lightest) | (weights > population.heaviest)).any():
        weights[outside] = rng.normal(population.mean, population.spread, int(outside.sum()))
    return weights
