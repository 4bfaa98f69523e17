"""Weights by ridge regression, and a covariance that a handful of demonstrations supports (thesis Eq. 5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.movement.reduction import ReducedDemonstrations

__all__ = ["Estimator", "Ridge", "WeightEstimate", "per_degree", "shrunk_covariance"]

Array = NDArray[np.float64]

SMALLEST_STD = 1e-12  # of a weight; below it the weight does not vary
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class WeightEstimate:
    """What an estimator finds: mean (D, B), covariance (D·B, D·B), noise_std (D,) of the weights' distribution.

    ``log_likelihood`` has the demonstrations' log-likelihood before each iteration, if there were any. ``sound`` says that
    the covariance is symmetric and positive semi-definite as it was computed, so that nobody needs to look.
    """

    mean: Array
    covariance: Array
    noise_std: Array
    log_likelihood: tuple[float, ...] = ()
    sound: bool = False


class Estimator(Protocol):
    """How the distribution of weights is found."""

    def estimate(self, demonstrations: ReducedDemonstrations, covariance: str) -> WeightEstimate:
        """Estimate with a ``"full"`` covariance or one of ``"per-degree"`` blocks."""
        ...


@dataclass(frozen=True, slots=True)
class Ridge:
    """Weights of each demonstration by ridge regression, then their mean and shrunk covariance.

    Parameters
    ----------
    penalty
        Weight of the ridge penalty relative to the mean diagonal of ΦᵀΦ; it only has to tame rounding.
    shrinkage
        Share by which correlations between weights are drawn to zero, in [0, 1]; None estimates it from the
        data, so that a handful of demonstrations still gives a usable covariance.
    minimum_std
        Standard deviation that every weight keeps at least, in its own unit.

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    penalty: float = 1e-8
    shrinkage: float | None = None
    minimum_std: float = 1e-3

    def __post_init__(self) -> None:
        if not self.penalty >= 0:
            raise ConfigurationError(f"ridge: penalty must be ≥ 0, got {self.penalty}")
        if self.shrinkage is not None and not 0 <= self.shrinkage <= 1:
            raise ConfigurationError(f"ridge: shrinkage must lie in [0, 1], got {self.shrinkage}")
        if not self.minimum_std >= 0:
            raise ConfigurationError(f"ridge: minimum_std must be ≥ 0, got {self.minimum_std}")

    def weights(self, demonstrations: ReducedDemonstrations) -> Array:
        """Weights (N, D, B) of each demonstration."""
        result = np.empty(demonstrations.shape)
        for R, chosen in demonstrations.groups:
            inverse, _ = _ridge_inverse(R.tobytes(), len(R), self.penalty)
            result[chosen] = demonstrations.projected[chosen] @ inverse.T
        return result

    def estimate(self, demonstrations: ReducedDemonstrations, covariance: str) -> WeightEstimate:
        """Estimate with a ``"full"`` covariance or one of ``"per-degree"`` blocks."""
        N, D, _ = demonstrations.shape
        weights = self.weights(demonstrations)
        spread = shrunk_covariance(weights.reshape(N, -1), self.shrinkage)
        if covariance == "per-degree":
            spread = per_degree(spread, D)
        diagonal = np.einsum("ii->i", spread)
        np.maximum(diagonal, self.minimum_std**2, out=diagonal)
        squares = np.add.reduce(demonstrations.rest, axis=0)
        for R, chosen in demonstrations.groups:
            _, missing = _ridge_inverse(R.tobytes(), len(R), self.penalty)
            left = demonstrations.projected[chosen] @ missing.T
            squares += np.einsum("ndb,ndb->d", left, left)
        noise = np.sqrt(squares / np.add.reduce(demonstrations.lengths))
        return WeightEstimate(np.add.reduce(weights, axis=0) / N, spread, noise, sound=True)


@lru_cache(maxsize=64)
def _ridge_inverse(factor: bytes, count: int, penalty: float) -> tuple[Array, Array]:
    """Matrices (B, B) from ``Qᵀ y`` to ridge weights and to what these miss of it, for the R (B, B) that the bytes hold."""
    R = np.frombuffer(factor).reshape(count, count)
    # Solved as an augmented least-squares problem: its condition is cond(Φ), not cond(Φ)².
    root = np.sqrt(penalty * np.square(R).sum() / count)
    inverse = np.asarray(np.linalg.pinv(np.concatenate((R, root * np.eye(count))))[:, :count])
    return inverse, np.eye(count) - R @ inverse


def per_degree(covariance: Array, dimensions: int) -> Array:
    """Set the covariances (D·B, D·B) between different degrees of freedom to zero."""
    B = len(covariance) // dimensions
    kept = np.eye(dimensions)[:, None, :, None]
    return np.asarray((covariance.reshape(dimensions, B, dimensions, B) * kept).reshape(covariance.shape))


def shrunk_covariance(samples: Array, shrinkage: float | None = None) -> Array:
    """Covariance (N, N) of samples (M, N) with correlations shrunk towards zero, variances kept.

    ``shrinkage`` None uses Schäfer and Strimmer's (2005) estimate ``λ = Σ Var(r_ij) / Σ r_ij²`` over i ≠ j,
    which goes to 0 with many samples and to 1 with few. One sample gives zeros.
    """
    count = len(samples)
    if count < 2:
        return np.zeros((samples.shape[1], samples.shape[1]))
    centred = samples - np.add.reduce(samples, axis=0) / count
    variances = np.einsum("mi,mi->i", centred, centred) / (count - 1)
    if shrinkage is None:
        shrinkage = _estimated_shrinkage(centred, variances)
    root = math.sqrt((1.0 - shrinkage) / (count - 1)) * centred
    covariance = root.T @ root  # of one and the same array: symmetric to the last bit
    covariance.flat[:: len(variances) + 1] = variances
    return np.asarray(covariance, dtype=np.float64)


def _estimated_shrinkage(centred: Array, variances: Array) -> float:
    """Sums over i ≠ j as the sum over all less that of the diagonal."""
    count = len(centred)
    if count < 3:
        return 1.0
    varies = variances > SMALLEST_STD**2
    standard = centred * np.divide(1.0, np.sqrt(variances), out=np.zeros_like(variances), where=varies)
    # The products of the weights and those of the samples have the same sum of squares: the fewer are made.
    products = standard @ standard.T if count < len(variances) else standard.T @ standard
    strength = float(np.vdot(products, products)) / (count - 1) ** 2 - int(np.count_nonzero(varies))
    # Of fewer than two weights that vary, rounding is left.
    if strength <= ROUNDING * len(variances):
        return 1.0
    squares = standard * standard
    lengths = np.add.reduce(squares, axis=1)
    fourth = float(np.vdot(lengths, lengths) - np.vdot(squares, squares))
    noise = count / (count - 1) ** 3 * (fourth - (count - 1) ** 2 / count * strength)
    return min(max(noise / strength, 0.0), 1.0)
