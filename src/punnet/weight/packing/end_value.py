"""What an unfinished punnet is worth: the expected cost of its end, by grams and berries that still go in."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from punnet.weight.packing.berries import BerryPopulation

__all__ = ["EndValue", "error_nodes", "likely_berries"]

_STEP = 0.5  # grams
_OVERFULL = 60.0  # grams above the target that the table reaches
_BERRIES, _ERRORS = 40, 7


def error_nodes(count: int = _ERRORS) -> NDArray[np.float64]:
    """(count,) equally likely values of a standard normal, with its variance."""
    nodes = ndtri((np.arange(count) + 0.5) / count)
    return np.asarray(nodes / np.sqrt(np.mean(nodes**2)))


@dataclass(frozen=True, eq=False)
class EndValue:
    r"""Solution of the packing problem of one punnet.

    A punnet that lacks :math:`r` grams of its target and takes :math:`s` berries more is closed at a cost of
    :math:`r^2 / \sigma` grams, with :math:`\sigma` the spread of the berries' weights, or waits for a berry. Each that comes
    it may take, or decline for :math:`c` grams:

    .. math:: v_s(r) = E_x[\min(h_{s-1}(r - x),\; v_s(r) + c)], \quad h_s(r) = \min(r^2/\sigma, v_s(r))

    where :math:`h_{s-1}(r - x)` is itself the mean over what a berry of estimate x may weigh, if a weigh cell
    will tell. With the mean of the :math:`k` least costs :math:`\bar H_k` of :math:`n` equally likely berries,
    :math:`v_s = \min_k (c\,n/k + \bar H_k) - c`: it waits for the :math:`k` best of them.

    Parameters
    ----------
    grid
        (R,) grams lacking, ascending.
    waiting
        (S + 1, R) :math:`v_s`; infinite for s = 0.
    scale
        :math:`\sigma`, grams.
    """

    grid: NDArray[np.float64]
    waiting: NDArray[np.float64]
    scale: float

    @classmethod
    def solve(
        cls, target: float, most_berries: int, population: BerryPopulation, decline: float, error: float
    ) -> EndValue:
        """Solve it for a target weight in grams.

        Parameters
        ----------
        decline
            Grams that it costs a punnet to let a berry pass.
        error
            Standard deviation of weight / estimate that a weigh cell will reveal after the drop; 0 without one.
        """
        grid = np.arange(-_OVERFULL, target + 2 * _OVERFULL, _STEP)
        solution = cls(grid, np.full((most_berries + 1, len(grid)), np.inf), population.spread)
        berries = likely_berries(population)
        nodes = error_nodes() if error else np.zeros(1)
        for left in range(1, most_berries + 1):
            costs = np.mean(
                [solution.ends(left - 1, grid[:, None] - berries * (1 + error * node)) for node in nodes],
                axis=0,
            )
            costs.sort(axis=1)
            taken = np.arange(1, len(berries) + 1)
            waits = (decline * len(berries) + np.cumsum(costs, axis=1)) / taken
            solution.waiting[left] = waits.min(axis=1) - decline
        return solution

    def closes(self, lacking: float) -> float:
        """Cost in grams of closing it as it is."""
        return lacking * lacking / self.scale

    def waits(self, left: int, lacking: float) -> float:
        """Expected cost in grams of waiting for more, ``left`` berries at most; infinite for none."""
        return float(np.interp(lacking, self.grid, self.waiting[left])) if left > 0 else math.inf

    def ends(self, left: int, lacking: NDArray[np.float64]) -> NDArray[np.float64]:
        """Expected cost in grams of going on as is best, element by element."""
        closes = np.square(lacking) / self.scale
        if left < 1:
            return np.asarray(closes)
        return np.asarray(np.minimum(closes, np.interp(lacking, self.grid, self.waiting[left])))


def likely_berries(population: BerryPopulation) -> NDArray[np.float64]:
    """(B,) equally likely weights."""
    weights = population.mean + population.spread * error_nodes(_BERRIES)
    return np.clip(weights, population.lightest, population.heaviest)
