"""Two movements into one: blended along the way, or combined into what both allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement.conditioning import condition_gaussian
from punnet.movement.covariance import covariance_factor
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.pushforward import in_basis, in_chart

__all__ = ["blend", "combine"]

Array = NDArray[np.float64]
SAMPLES = 200
ENDS = 1e3  # weight of the start and the end in the projection: both are kept


def blend(
    first: TrajectoryDistribution, second: TrajectoryDistribution, *, phase: float = 0.5, width: float = 0.4
) -> TrajectoryDistribution:
    """Movement that begins as ``first`` and ends as ``second``.

    A trajectory of the blend is ``(1 − α) y₁ + α y₂`` with α rising smoothly from 0 to 1 around ``phase``, where
    y₁ and y₂ are the trajectories of both movements that belong together by optimal transport (the pairing with
    the least mean squared difference of the weights). So blending a movement with itself changes nothing, the
    result is positive semi-definite, and its samples are smooth; were y₁ and y₂ drawn on their own, the spread
    would shrink by up to √2 where they meet.

    Parameters
    ----------
    first, second
        Over the same degrees of freedom; basis, chart and names are those of ``first``.
    phase, width
        Middle and extent of the change, in phase; the change lies within [0, 1].

    Raises
    ------
    ShapeError
        If they have other degrees of freedom.
    ConfigurationError
        If the change does not lie within [0, 1], or they are of different spaces.
    """
    if not (width > 0 and phase - width / 2 >= -1e-12 and phase + width / 2 <= 1 + 1e-12):
        raise ConfigurationError(
            f"blend: phase ± width / 2 must lie in [0, 1] and width be positive, got {phase} and {width}"
        )
    second = _alike(first, second, "blend")
    z = np.linspace(0.0, 1.0, SAMPLES)
    share = np.clip((z - phase) / width + 0.5, 0.0, 1.0)
    alpha = (share**3 * (10.0 - 15.0 * share + 6.0 * share**2))[:, None]
    phi = first.basis.phi(z)
    importance = np.ones((SAMPLES, 1))
    importance[[0, -1]] = ENDS
    projection = np.linalg.pinv(importance * phi) * importance.T
    keep, take = projection @ ((1.0 - alpha) * phi), projection @ (alpha * phi)
    D, B = first.weight_mean.shape
    root_first, root_second = _paired_roots(first.weight_covariance, second.weight_covariance)
    root = keep @ root_first.reshape(D, B, -1) + take @ root_second.reshape(D, B, -1)
    root = root.reshape(D * B, -1)
    noise = np.maximum(np.asarray(first.observation_std), np.asarray(second.observation_std))
    return replace(
        first,
        weight_mean=first.weight_mean @ keep.T + second.weight_mean @ take.T,
        weight_covariance=root @ root.T,
        duration=(1.0 - phase) * second.duration + phase * first.duration,
        observation_std=noise,
        via_points=(),
    )


def combine(
    distributions: Sequence[TrajectoryDistribution], weights: Sequence[float] | None = None
) -> TrajectoryDistribution:
    """Product of the densities, each to the power of its weight: trajectories that all of them allow.

    ``Σ⁻¹ = Σ_i α_i Σ_i⁻¹``, ``Σ⁻¹ μ = Σ_i α_i Σ_i⁻¹ μ_i`` (Paraschos et al., 2013), computed without inverting
    a covariance, so those without full rank do no harm.

    Parameters
    ----------
    distributions
        At least one, over the same degrees of freedom; basis, chart, duration, names and noise are those of the
        first.
    weights
        Positive powers α_i; one each if not given.

    Raises
    ------
    ShapeError
        If there is none, or the degrees of freedom or the number of weights differ.
    ConfigurationError
        If a weight is not positive, spaces differ, or there is no trajectory that all of them allow.
    """
    if not distributions:
        raise ShapeError("combine: no distribution")
    powers = [1.0] * len(distributions) if weights is None else [float(weight) for weight in weights]
    if len(powers) != len(distributions):
        raise ShapeError(f"combine: {len(powers)} weights for {len(distributions)} distributions")
    if not all(np.isfinite(power) and power > 0 for power in powers):
        raise ConfigurationError(f"combine: weights must be positive, got {powers}")
    first = distributions[0]
    mean, covariance = first.weight_mean.ravel(), first.weight_covariance / powers[0]
    identity = np.eye(len(mean))
    for other, power in zip(distributions[1:], powers[1:], strict=True):
        alike = _alike(first, other, "combine")
        # The other density is an observation of all weights, with its covariance as noise.
        mean, covariance = condition_gaussian(
            mean, covariance, identity, alike.weight_mean.ravel(), alike.weight_covariance / power
        )
    return replace(
        first,
        weight_mean=mean.reshape(first.weight_mean.shape),
        weight_covariance=covariance,
        via_points=(),
    )


def _alike(first: TrajectoryDistribution, other: TrajectoryDistribution, what: str) -> TrajectoryDistribution:
    """The other distribution, in the chart and the basis of the first."""
    if first.space != other.space:
        raise ConfigurationError(f"{what}: {first.space} space and {other.space} space don't go together")
    if first.dimensions != other.dimensions:
        raise ShapeError(f"{what}: {first.dimensions} degrees of freedom and {other.dimensions}")
    if first.chart is not None and not first.chart.same_as(other.chart):
        other = in_chart(other, first.chart)
    return other if other.basis == first.basis else in_basis(other, first.basis)


def _paired_roots(first: Array, second: Array) -> tuple[Array, Array]:
    """Roots A, B (N, N) with AAᵀ and BBᵀ the covariances, and the largest tr(A Bᵀ) there can be."""
    root_first, root_second = covariance_factor(first), covariance_factor(second)
    P, _, Qt = np.linalg.svd(root_second.T @ root_first)
    return root_first, root_second @ P @ Qt
