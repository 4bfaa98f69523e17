"""Fitting by expectation–maximisation with priors: weights are hidden, not computed.

The model is ``w_n ~ N(μ, Σ)`` and ``y_n = Φ_n w_n + ε`` with one noise variance a degree of freedom (Lazaric and
Ghavamzadeh, 2010; Gomez-Gonzalez et al., 2020). Ridge regression first makes weights of every demonstration
and takes them for known; here a short, noisy or partial demonstration counts for what it says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.reduction import ReducedDemonstrations
from punnet.movement.regression import Ridge, WeightEstimate, per_degree

__all__ = ["ExpectationMaximisation"]

Array = NDArray[np.float64]

SMALLEST_NOISE_SHARE = 1e-13


@dataclass(frozen=True)
class ExpectationMaximisation:
    """Most likely mean, covariance and noise, given the demonstrations and what was believed before.

    Parameters
    ----------
    prior
        Distribution over the same weights that is believed before (as from simulation, or another person's
        demonstrations). Without it the covariance leans on the shrunk one of ridge regression and the mean
        on nothing.
    covariance_strength
        Demonstrations that the prior covariance counts for, ≥ 0: ``Σ = (s Σ₀ + Σ_n E[…]) / (s + N)``, the mode
        under an inverse Wishart. With little of it and few demonstrations the covariance collapses; the default
        makes unseen reaches likely from 10 demonstrations to 100 (seven joints, eight weights each).
    mean_strength
        Demonstrations that the prior mean counts for, ≥ 0; needs a ``prior``.
    noise_std
        Noise believed before, in the degrees' units, and ``noise_strength``, the samples that it counts for.
    noise_strength
        See ``noise_std``.
    iterations
        Most iterations.
    tolerance
        Stop when mean, covariance and noise change by less than this share in one iteration.

    Raises
    ------
    ConfigurationError
        If a number is out of range, or ``mean_strength`` comes without a ``prior``.
    """

    prior: TrajectoryDistribution | None = None
    covariance_strength: float = 30.0
    mean_strength: float = 0.0
    noise_std: float = 1e-4
    noise_strength: float = 1.0
    iterations: int = 200
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("covariance_strength", "mean_strength", "noise_strength", "noise_std"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ConfigurationError(f"expectation-maximisation: {name} must be ≥ 0, got {value}")
        if self.mean_strength > 0 and self.prior is None:
            raise ConfigurationError("expectation-maximisation: mean_strength needs a prior to lean on")
        if self.iterations < 1 or not self.tolerance > 0:
            raise ConfigurationError(
                "expectation-maximisation: iterations must be at least 1 and tolerance positive, "
                f"got {self.iterations} and {self.tolerance}"
            )

    def estimate(self, demonstrations: ReducedDemonstrations, covariance: str) -> WeightEstimate:
        """Estimate with a ``"full"`` covariance or one of ``"per-degree"`` blocks."""
        D, B = demonstrations.shape[1:]
        start = Ridge().estimate(demonstrations, covariance)
        prior_mean, prior_covariance = start.mean, start.covariance
        if self.prior is not None:
            if self.prior.weight_mean.shape != (D, B):
                raise ShapeError(
                    f"expectation-maximisation: the prior has weights {self.prior.weight_mean.shape}, "
                    f"the demonstrations {(D, B)}"
                )
            prior_mean, prior_covariance = self.prior.weight_mean, self.prior.weight_covariance
            if covariance == "per-degree":
                prior_covariance = per_degree(prior_covariance, D)
        model = _Model(demonstrations, self, prior_mean.ravel(), prior_covariance, covariance)
        noise = np.maximum(start.noise_std**2, max(self.noise_std, 1e-6) ** 2)
        current = (start.mean.ravel(), start.covariance, noise)
        likelihoods = []
        for _ in range(self.iterations):
            updated, likelihood = model.iterate(*current)
            likelihoods.append(likelihood)
            change = max(_change(new, old) for new, old in zip(updated, current, strict=True))
            current = updated
            if change < self.tolerance:
                break
        mean, spread, noise = current
        return WeightEstimate(mean.reshape(D, B), spread, np.sqrt(noise), tuple(likelihoods))


def _change(new: Array, old: Array) -> float:
    return float(np.linalg.norm(new - old)) / max(float(np.linalg.norm(old)), 1e-12)


@dataclass(frozen=True, eq=False)
class _Model:
    data: ReducedDemonstrations
    settings: ExpectationMaximisation
    prior_mean: Array
    prior_covariance: Array
    covariance: str

    def iterate(self, mean: Array, spread: Array, noise: Array) -> tuple[tuple[Array, Array, Array], float]:
        """Mean (D·B,), covariance and noise variances (D,) after a step; the log-likelihood before it."""
        data = self.data
        N, D, B = data.shape
        weights, uncertainty, squares = np.empty((N, D * B)), np.zeros_like(spread), data.rest.sum(axis=0)
        likelihood = 0.0
        for u, R in enumerate(data.factors):
            chosen = data.group == u
            observed = data.projected[chosen]
            count = len(observed)
            cross = np.matmul(R, spread.reshape(D, B, D * B)).reshape(D * B, D * B)  # (I ⊗ R) Σ
            total = np.matmul(cross.reshape(D * B, D, B), R.T).reshape(D * B, D * B)
            total.flat[:: D * B + 1] += np.repeat(noise, B)
            factor = np.linalg.cholesky(total)
            residual = (observed - mean.reshape(D, B) @ R.T).reshape(count, -1)
            white = np.linalg.solve(factor, np.concatenate((cross, residual.T), axis=1))
            root, innovation = white[:, :-count], white[:, -count:]
            weights[chosen] = mean + (root.T @ innovation).T
            posterior = spread - root.T @ root
            uncertainty += count * posterior
            left = observed - weights[chosen].reshape(count, D, B) @ R.T
            own = np.einsum("dbdc->dbc", posterior.reshape(D, B, D, B))
            squares = (
                squares + np.square(left).sum(axis=(0, 2)) + count * np.einsum("dbc,bc->d", own, R.T @ R)
            )
            likelihood -= 0.5 * float(np.vdot(innovation, innovation)) + count * float(
                np.log(factor.diagonal()).sum()
            )
        samples = float(data.lengths.sum())
        others = samples - N * B
        likelihood -= 0.5 * float((data.rest.sum(axis=0) / noise + others * np.log(noise)).sum())
        likelihood -= 0.5 * samples * D * math.log(2.0 * math.pi)
        return self._maximise(weights, uncertainty, squares, samples), likelihood

    def _maximise(
        self, weights: Array, uncertainty: Array, squares: Array, samples: float
    ) -> tuple[Array, Array, Array]:
        settings, N = self.settings, len(weights)
        kappa, strength = settings.mean_strength, settings.covariance_strength
        mean = (weights.sum(axis=0) + kappa * self.prior_mean) / (N + kappa)
        centred = weights - mean
        scatter = centred.T @ centred + uncertainty + strength * self.prior_covariance
        if kappa:
            pulled = mean - self.prior_mean
            scatter += kappa * np.outer(pulled, pulled)
        spread = scatter / (N + strength)
        if self.covariance == "per-degree":
            spread = per_degree(spread, self.data.shape[1])
        known, weight = settings.noise_std**2, settings.noise_strength
        noise = (squares + weight * known) / (samples + weight)
        # With less noise than that the innovation could not be factored.
        least = SMALLEST_NOISE_SHARE * float(spread.diagonal().max())
        return mean, (spread + spread.T) / 2.0, np.maximum(noise, max(least, 1e-18))
