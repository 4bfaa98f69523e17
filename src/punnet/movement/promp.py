"""Fitting a probabilistic movement primitive to demonstrations (thesis section 5.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement.basis import GaussianBasis
from punnet.movement.distribution import Space, TrajectoryDistribution

__all__ = ["ProMP", "shrunk_covariance"]


@dataclass(frozen=True, slots=True)
class ProMP:
    """How demonstrations become a :class:`~punnet.movement.TrajectoryDistribution`.

    Each demonstration is reduced to weights by ridge regression (Eq. 5.2); the weights of all degrees of
    freedom together are then described by their mean and full covariance.

    Parameters
    ----------
    basis
        Basis functions.
    ridge
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

    basis: GaussianBasis = field(default_factory=GaussianBasis)
    ridge: float = 1e-8
    shrinkage: float | None = None
    minimum_std: float = 1e-3

    def __post_init__(self) -> None:
        if not self.ridge >= 0:
            raise ConfigurationError(f"ProMP: ridge must be ≥ 0, got {self.ridge}")
        if self.shrinkage is not None and not 0 <= self.shrinkage <= 1:
            raise ConfigurationError(f"ProMP: shrinkage must lie in [0, 1], got {self.shrinkage}")
        if not self.minimum_std >= 0:
            raise ConfigurationError(f"ProMP: minimum_std must be ≥ 0, got {self.minimum_std}")

    def weights(self, demonstration: ArrayLike) -> NDArray[np.float64]:
        """Weights (D, B) of one demonstration (T, D) sampled evenly from start to end.

        Raises
        ------
        ShapeError
            If it is not a finite (T, D) array with T ≥ 2.
        """
        values = np.asarray(demonstration, dtype=np.float64)
        if values.ndim != 2 or values.shape[0] < 2 or values.shape[1] < 1 or not np.isfinite(values).all():
            raise ShapeError(f"ProMP: a demonstration must be finite (T ≥ 2, D), got {values.shape}")
        phi = self.basis.phi(np.linspace(0.0, 1.0, len(values)))
        # Solved as an augmented least-squares problem: its condition is cond(Φ), not cond(Φ)².
        penalty = np.sqrt(self.ridge * np.square(phi).sum() / self.basis.count)
        lhs = np.vstack((phi, penalty * np.eye(self.basis.count)))
        rhs = np.vstack((values, np.zeros((self.basis.count, values.shape[1]))))
        return np.asarray(np.linalg.lstsq(lhs, rhs, rcond=None)[0].T, dtype=np.float64)

    def fit(
        self,
        demonstrations: Sequence[ArrayLike],
        *,
        durations: Sequence[float] | None = None,
        names: Sequence[str] = (),
        space: Space = "joint",
    ) -> TrajectoryDistribution:
        """Distribution of trajectories like the demonstrations.

        Parameters
        ----------
        demonstrations
            N ≥ 1 arrays (T_n, D); lengths may differ.
        durations
            (N,) seconds each took; the mean is kept. One second if not given.
        names, space
            Passed on.

        Raises
        ------
        ShapeError
            If there is no demonstration or they disagree in D.
        """
        if len(demonstrations) == 0:
            raise ShapeError("ProMP: no demonstrations to fit")
        arrays = [np.asarray(demonstration, dtype=np.float64) for demonstration in demonstrations]
        weights = [self.weights(array) for array in arrays]
        if len({w.shape for w in weights}) != 1:
            raise ShapeError(f"ProMP: demonstrations disagree in D: {sorted({w.shape[0] for w in weights})}")
        if durations is not None and len(durations) != len(arrays):
            raise ShapeError(f"ProMP: {len(durations)} durations for {len(arrays)} demonstrations")
        stacked = np.stack(weights)
        covariance = shrunk_covariance(stacked.reshape(len(stacked), -1), self.shrinkage)
        variances = np.maximum(self.minimum_std**2 - np.diag(covariance), 0.0)
        return TrajectoryDistribution(
            basis=self.basis,
            weight_mean=stacked.mean(axis=0),
            weight_covariance=covariance + np.diag(variances),
            duration=1.0 if durations is None else float(np.mean(durations)),
            names=tuple(names),
            space=space,
            observation_std=self._residual_std(arrays, weights),
        )

    def _residual_std(
        self, arrays: Sequence[NDArray[np.float64]], weights: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        squares, count = np.zeros(weights[0].shape[0]), 0
        for values, w in zip(arrays, weights, strict=True):
            residual = values - self.basis.phi(np.linspace(0.0, 1.0, len(values))) @ w.T
            squares += np.square(residual).sum(axis=0)
            count += len(values)
        return np.sqrt(squares / count)


def shrunk_covariance(samples: NDArray[np.float64], shrinkage: float | None = None) -> NDArray[np.float64]:
    """Covariance (N, N) of samples (M, N) with correlations shrunk towards zero, variances kept.

    ``shrinkage`` None uses Schäfer and Strimmer's (2005) estimate ``λ = Σ Var(r_ij) / Σ r_ij²`` over i ≠ j,
    which goes to 0 with many samples and to 1 with few. One sample gives zeros.
    """
    count = len(samples)
    centred = samples - samples.mean(axis=0)
    if count < 2:
        return np.zeros((samples.shape[1], samples.shape[1]))
    std = centred.std(axis=0, ddof=1)
    standard = np.divide(centred, std, out=np.zeros_like(centred), where=std > 1e-12)
    correlation = standard.T @ standard / (count - 1)
    if shrinkage is None:
        shrinkage = _estimated_shrinkage(standard, correlation)
    shrunk = (1.0 - shrinkage) * correlation
    np.fill_diagonal(shrunk, np.diag(correlation))
    covariance = std[:, None] * shrunk * std
    return np.asarray((covariance + covariance.T) / 2.0, dtype=np.float64)


def _estimated_shrinkage(standard: NDArray[np.float64], correlation: NDArray[np.float64]) -> float:
    count = len(standard)
    if count < 3:
        return 1.0
    mean_products = correlation * (count - 1) / count
    squares = (standard**2).T @ (standard**2)
    variances = count / (count - 1) ** 3 * (squares - count * mean_products**2)
    off_diagonal = ~np.eye(len(correlation), dtype=bool)
    strength = float(np.square(correlation[off_diagonal]).sum())
    if strength == 0.0:
        return 1.0
    return float(np.clip(variances[off_diagonal].sum() / strength, 0.0, 1.0))
