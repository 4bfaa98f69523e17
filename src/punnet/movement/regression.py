"""Weights by ridge regression, and a covariance that a handful of demonstrations supports (thesis Eq. 5.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.movement.reduction import ReducedDemonstrations

__all__ = ["Estimator", "Ridge", "WeightEstimate", "per_degree", "shrunk_covariance"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WeightEstimate:
    """What an estimator finds: mean (D, B), covariance (D·B, D·B), noise_std (D,) of the weights' distribution.

    ``log_likelihood`` has the demonstrations' log-likelihood before each iteration, if there were any.
    """

    mean: Array
    covariance: Array
    noise_std: Array
    log_likelihood: tuple[float, ...] = ()


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
        for u, R in enumerate(demonstrations.factors):
            chosen = demonstrations.group == u
            inverse = _ridge_inverse(R.tobytes(), len(R), self.penalty)
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
        squares = demonstrations.rest.sum(axis=0)
        for u, R in enumerate(demonstrations.factors):
            chosen = demonstrations.group == u
            left = demonstrations.projected[chosen] - weights[chosen] @ R.T
            squares += np.einsum("ndb,ndb->d", left, left)
        noise = np.sqrt(squares / demonstrations.lengths.sum())
        return WeightEstimate(weights.mean(axis=0), spread, noise)


@lru_cache(maxsize=64)
def _ridge_inverse(factor: bytes, count: int, penalty: float) -> Array:
    """Matrix (B, B) from ``Qᵀ y`` to ridge weights, for the R (B, B) that the bytes hold."""
    R = np.frombuffer(factor).reshape(count, count)
    # Solved as an augmented least-squares problem: its condition is cond(Φ), not cond(Φ)².
    root = np.sqrt(penalty * np.square(R).sum() / count)
    return np.asarray(np.linalg.pinv(np.concatenate((R, root * np.eye(count))))[:, :count])


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
    centred = samples - samples.mean(axis=0)
    std = np.sqrt(np.einsum("mi,mi->i", centred, centred) / (count - 1))
    standard = np.divide(centred, std, out=np.zeros_like(centred), where=std > 1e-12)
    correlation = standard.T @ standard / (count - 1)
    if shrinkage is None:
        shrinkage = _estimated_shrinkage(standard, correlation)
    variances = correlation.diagonal().copy()
    correlation *= 1.0 - shrinkage
    correlation.flat[:: len(variances) + 1] = variances
    return np.asarray(std[:, None] * correlation * std, dtype=np.float64)


def _estimated_shrinkage(standard: Array, correlation: Array) -> float:
    """Sums over i ≠ j as the sum over all less that of the diagonal."""
    count = len(standard)
    if count < 3:
        return 1.0
    squares = standard * standard
    own = correlation.diagonal()
    strength = float(np.vdot(correlation, correlation) - own @ own)
    if strength <= 0.0:
        return 1.0
    fourth = float(np.square(squares.sum(axis=1)).sum() - np.square(squares).sum())
    variances = count / (count - 1) ** 3 * (fourth - (count - 1) ** 2 / count * strength)
    return float(np.clip(variances / strength, 0.0, 1.0))
