"""Via-points, and conditioning a Gaussian over weights on them in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from punnet.errors import ConfigurationError, FileFormatError, ShapeError

__all__ = ["ViaPoint", "condition_gaussian"]

RELATIVE_RANK = 1e-12
CHOLESKY_PIVOT = 1e-9  # below it the eigenvalues are needed
UNMET_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """A value that trajectories shall pass at a phase.

    Parameters
    ----------
    phase
        Where along the movement, 0 start … 1 end.
    values
        (k,) values in the unit of the degrees of freedom (per unit phase when ``order`` is 1).
    degrees_of_freedom
        The k indices that the values are for; None for all, in order.
    std
        Standard deviation of the values, one number or (k,); 0 asks for the exact value.
    order
        0 for a position, 1 for a velocity and 2 for an acceleration with respect to phase.

    Raises
    ------
    ShapeError
        If the sizes disagree or a number is not finite.
    ConfigurationError
        If an index repeats, a std is negative or the order unknown.
    """

    phase: float
    values: NDArray[np.float64]
    degrees_of_freedom: tuple[int, ...] | None = None
    std: ArrayLike = 0.0
    order: int = 0

    def __post_init__(self) -> None:
        values = np.atleast_1d(np.asarray(self.values, dtype=np.float64))
        if values.ndim != 1 or not np.isfinite(values).all() or not math.isfinite(self.phase):
            raise ShapeError(f"via-point: phase and values (k,) must be finite, got shape {values.shape}")
        std = np.asarray(self.std, dtype=np.float64)
        if std.shape not in ((), values.shape):
            raise ShapeError(f"via-point: std must be one number or {values.shape}, got {std.shape}")
        if not (np.isfinite(std).all() and (std >= 0).all()):
            raise ConfigurationError("via-point: std must be finite and not negative")
        if self.order not in (0, 1, 2):
            raise ConfigurationError(f"via-point: order must be 0, 1 or 2, got {self.order}")
        if self.degrees_of_freedom is not None:
            chosen = tuple(int(index) for index in self.degrees_of_freedom)
            if len(chosen) != len(values):
                raise ShapeError(f"via-point: {len(chosen)} degrees of freedom but {len(values)} values")
            if len(set(chosen)) != len(chosen):
                raise ConfigurationError(f"via-point: a degree of freedom repeats in {chosen}")
            object.__setattr__(self, "degrees_of_freedom", chosen)
        object.__setattr__(self, "phase", float(self.phase))
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "std", np.broadcast_to(std, values.shape).copy())

    def indices(self, dimensions: int) -> NDArray[np.int64]:
        """Give the indices (k,) of its degrees of freedom in a movement with ``dimensions`` of them.

        Raises
        ------
        ShapeError
            If it names a degree of freedom that does not exist, or has too few values for all.
        """
        if self.degrees_of_freedom is None:
            if len(self.values) != dimensions:
                raise ShapeError(f"via-point: {len(self.values)} values for {dimensions} degrees of freedom")
            return np.arange(dimensions)
        if any(not 0 <= index < dimensions for index in self.degrees_of_freedom):
            raise ShapeError(
                f"via-point: degrees of freedom {self.degrees_of_freedom} not all in 0…{dimensions - 1}"
            )
        return np.array(self.degrees_of_freedom, dtype=np.int64)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers."""
        chosen = self.degrees_of_freedom
        return {
            "phase": self.phase,
            "values": self.values.tolist(),
            "degrees_of_freedom": None if chosen is None else list(chosen),
            "std": np.asarray(self.std).tolist(),
            "order": self.order,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ViaPoint:
        """Read what :meth:`to_json` wrote."""
        try:
            chosen = data["degrees_of_freedom"]
            return cls(
                phase=float(data["phase"]),
                values=np.asarray(data["values"], dtype=np.float64),
                degrees_of_freedom=None if chosen is None else tuple(chosen),
                std=np.asarray(data["std"], dtype=np.float64),
                order=int(data["order"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"via-point JSON: field missing or of the wrong kind ({error!r})"
            ) from error


def condition_gaussian(
    mean: NDArray[np.float64],
    covariance: NDArray[np.float64],
    observation: NDArray[np.float64],
    values: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Posterior of ``w ~ N(mean, covariance)`` given ``values = observation @ w + noise``, all rows at once.

    The gain ``K = Σ Aᵀ (A Σ Aᵀ + R)⁻¹`` is computed on rows scaled to unit variance, dropping directions
    without any, so repeated via-points do no harm; the covariance is updated in Joseph's form ``(I − K A) Σ
    (I − K A)ᵀ + K R Kᵀ``, which stays positive semi-definite under rounding.

    Parameters
    ----------
    mean, covariance
        (N,) and (N, N) of the prior.
    observation, values, variances
        Matrix A (M, N), values (M,) and noise variances (M,), the diagonal of R.

    Returns
    -------
    tuple
        Mean (N,) and covariance (N, N) of the posterior.

    Raises
    ------
    ConfigurationError
        If noise-free values can't be met: they contradict each other or the prior has no variance there.
    """
    if len(values) == 0:
        return mean, covariance
    gain = _gain(covariance, observation, variances)
    posterior = mean + gain @ (values - observation @ mean)
    # Rounding in the gain leaves 1e-9 of a large correction; repeating the exact rows removes it.
    exact = variances == 0.0
    if exact.any():
        exact_gain = gain if exact.all() else _gain(covariance, observation[exact], np.zeros(exact.sum()))
        posterior = _polish(posterior, exact_gain, observation[exact], values[exact])
    remaining = np.eye(len(mean)) - gain @ observation
    updated = remaining @ covariance @ remaining.T + (gain * variances) @ gain.T
    return posterior, (updated + updated.T) / 2.0


def _gain(
    covariance: NDArray[np.float64], observation: NDArray[np.float64], variances: NDArray[np.float64]
) -> NDArray[np.float64]:
    cross = covariance @ observation.T
    innovation = observation @ cross + np.diag(variances)
    scale = np.sqrt(np.maximum(np.diag(innovation), 0.0))
    inverse_scale = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
    scaled = inverse_scale[:, None] * innovation * inverse_scale
    scaled = (scaled + scaled.T) / 2.0
    try:
        factor = np.linalg.cholesky(scaled)
        if float(np.diag(factor).min()) ** 2 > CHOLESKY_PIVOT:
            half = solve_triangular(factor, np.diag(inverse_scale), lower=True, check_finite=False)
            return np.asarray((cross @ half.T) @ half, dtype=np.float64)
    except np.linalg.LinAlgError:
        pass  # via-points that depend on each other: the eigenvectors tell which directions to keep
    eigenvalues, vectors = np.linalg.eigh(scaled)
    kept = eigenvalues > RELATIVE_RANK * max(float(eigenvalues[-1]), 0.0)
    vectors = vectors[:, kept] * inverse_scale[:, None]
    return np.asarray((cross @ vectors / eigenvalues[kept]) @ vectors.T, dtype=np.float64)


def _polish(
    posterior: NDArray[np.float64],
    gain: NDArray[np.float64],
    observation: NDArray[np.float64],
    values: NDArray[np.float64],
) -> NDArray[np.float64]:
    for _ in range(2):
        posterior = posterior + gain @ (values - observation @ posterior)
    worst = float(np.abs(values - observation @ posterior).max())
    if worst > UNMET_TOLERANCE * max(1.0, float(np.abs(values).max())):
        raise ConfigurationError(
            f"via-points: exact values are missed by {worst:.2g}; they contradict each other or the "
            "demonstrations never vary there: give a std, fewer via-points, or broaden the distribution"
        )
    return posterior


def stack_via_points(
    via_points: Sequence[ViaPoint], dimensions: int, rows: Sequence[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Observation matrix (M, D·B), values (M,), variances (M,); ``rows[i]`` (B,) is Φ at via-point i."""
    blocks, values, variances = [], [], []
    for via_point, row in zip(via_points, rows, strict=True):
        indices = via_point.indices(dimensions)
        blocks.append(np.kron(np.eye(dimensions)[indices], row))
        values.append(via_point.values)
        variances.append(np.asarray(via_point.std) ** 2)
    return np.concatenate(blocks), np.concatenate(values), np.concatenate(variances)
