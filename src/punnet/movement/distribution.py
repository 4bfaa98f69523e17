"""A distribution over trajectories: a Gaussian over the weights of a movement primitive (Eq. 5.6, 5.7).

The weights of D degrees of freedom with B basis functions are stacked degree by degree,
``(θ_11 … θ_1B, θ_21 … θ_DB)``: entry ``d·B + b`` belongs to degree d and function b. The covariance is full,
so correlations between joints are kept (the thesis decouples the joints).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement.basis import GaussianBasis
from punnet.movement.conditioning import ViaPoint, condition_gaussian, stack_via_points

__all__ = ["Space", "TrajectoryDistribution"]

DISTRIBUTION_SCHEMA = "punnet-trajectory-distribution/1"
Space = Literal["joint", "task"]
SPACES: tuple[Space, ...] = ("joint", "task")


@dataclass(frozen=True, eq=False)
class TrajectoryDistribution:
    """Gaussian over trajectories of D degrees of freedom.

    Parameters
    ----------
    basis
        The B basis functions.
    weight_mean
        (D, B) mean weights, radians in joint space, metres and quaternion entries in task space.
    weight_covariance
        (D·B, D·B) covariance of the weights stacked degree by degree; symmetric, positive semi-definite.
    duration
        Seconds that the movement takes at the demonstrated pace.
    names
        Names of the degrees of freedom; ``q1 … qD`` if not given.
    space
        ``"joint"`` or ``"task"``.
    observation_std
        (D,) standard deviation of the noise ε of Eq. 5.3 around the weighted basis; zeros if not given.
    via_points
        What it has been conditioned on so far, in order.

    Raises
    ------
    ShapeError
        If a shape disagrees or a number is not finite.
    ConfigurationError
        If the covariance is not symmetric positive semi-definite, the duration not positive or the space
        unknown.
    """

    basis: GaussianBasis
    weight_mean: NDArray[np.float64]
    weight_covariance: NDArray[np.float64]
    duration: float = 1.0
    names: tuple[str, ...] = ()
    space: Space = "joint"
    observation_std: NDArray[np.float64] | None = None
    via_points: tuple[ViaPoint, ...] = ()

    def __post_init__(self) -> None:
        mean = np.asarray(self.weight_mean, dtype=np.float64)
        if mean.ndim != 2 or mean.shape[0] < 1 or mean.shape[1] != self.basis.count:
            raise ShapeError(
                f"trajectory distribution: weight_mean must be (D, {self.basis.count}), got {mean.shape}"
            )
        covariance = np.asarray(self.weight_covariance, dtype=np.float64)
        if covariance.shape != (mean.size, mean.size):
            raise ShapeError(
                f"trajectory distribution: weight_covariance must be {(mean.size, mean.size)}, "
                f"got {covariance.shape}"
            )
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            raise ShapeError("trajectory distribution: weights must be finite")
        _require_semi_definite(covariance)
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise ConfigurationError(
                f"trajectory distribution: duration must be positive, got {self.duration}"
            )
        if self.space not in SPACES:
            raise ConfigurationError(
                f"trajectory distribution: space must be one of {SPACES}, got {self.space!r}"
            )
        names = tuple(self.names) or tuple(f"q{i + 1}" for i in range(len(mean)))
        if len(names) != len(mean):
            raise ShapeError(
                f"trajectory distribution: {len(names)} names for {len(mean)} degrees of freedom"
            )
        noise = (
            np.zeros(len(mean)) if self.observation_std is None else np.asarray(self.observation_std, float)
        )
        if noise.shape != (len(mean),) or not np.isfinite(noise).all() or (noise < 0).any():
            raise ShapeError(f"trajectory distribution: observation_std must be ({len(mean)},) and ≥ 0")
        for field, value in (
            ("weight_mean", mean),
            ("weight_covariance", (covariance + covariance.T) / 2.0),
            ("duration", float(self.duration)),
            ("names", names),
            ("observation_std", noise),
            ("via_points", tuple(self.via_points)),
        ):
            object.__setattr__(self, field, value)

    @property
    def dimensions(self) -> int:
        """Number of degrees of freedom D."""
        return int(self.weight_mean.shape[0])

    def mean(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Mean trajectory (T, D) at phases (T,): Eq. 5.7."""
        return self.basis.phi(phase) @ self.weight_mean.T

    def mean_derivative(self, phase: ArrayLike, order: int = 1) -> NDArray[np.float64]:
        """Differentiate the mean with respect to phase, (T, D); divide by ``duration**order`` for time."""
        return self.basis.derivative(phase, order) @ self.weight_mean.T

    def covariance(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Covariance (T, D, D) between the degrees of freedom at each phase, without observation noise."""
        phi, D, B = self.basis.phi(phase), self.dimensions, self.basis.count
        half = np.tensordot(phi, self.weight_covariance.reshape(D, B, D, B), axes=(1, 3))
        return np.asarray(np.einsum("tdbe,tb->tde", half, phi), dtype=np.float64)

    def std(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Give the standard deviation (T, D) at phases (T,), without observation noise: Eq. 5.7."""
        phi, D, B = self.basis.phi(phase), self.dimensions, self.basis.count
        blocks = np.einsum("dbdc->dbc", self.weight_covariance.reshape(D, B, D, B))
        variances = np.einsum("dtc,tc->td", phi @ blocks, phi)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)), dtype=np.float64)

    def sample(self, rng: np.random.Generator, n: int, phase: ArrayLike) -> NDArray[np.float64]:
        """``n`` smooth trajectories (n, T, D), drawn without observation noise.

        Raises
        ------
        ConfigurationError
            If n is negative.
        """
        if n < 0:
            raise ConfigurationError(f"trajectory distribution: can't draw {n} samples")
        eigenvalues, vectors = np.linalg.eigh(self.weight_covariance)
        factor = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
        weights = self.weight_mean.ravel() + rng.standard_normal((n, self.weight_mean.size)) @ factor.T
        by_degree = weights.reshape(n, self.dimensions, self.basis.count)
        return np.asarray(self.basis.phi(phase) @ by_degree.transpose(0, 2, 1), dtype=np.float64)

    def log_density(self, phase: float, values: ArrayLike, *, std: float = 0.0) -> float:
        """Log of Eq. 5.6 for all degrees of freedom together at one phase, in nats.

        ``std`` is added to the observation noise of every degree; directions without any variance are given
        1e-9.
        """
        residual = np.asarray(values, dtype=np.float64) - self.mean([phase])[0]
        if residual.shape != (self.dimensions,):
            raise ShapeError(
                f"trajectory distribution: values must be ({self.dimensions},), got {residual.shape}"
            )
        noise = np.asarray(self.observation_std) ** 2 + std**2
        eigenvalues, vectors = np.linalg.eigh(self.covariance([phase])[0] + np.diag(noise))
        variances = np.maximum(eigenvalues, 1e-18)
        projected = vectors.T @ residual
        return float(-0.5 * (projected**2 / variances + np.log(2.0 * np.pi * variances)).sum())

    def condition(self, via_points: Sequence[ViaPoint]) -> TrajectoryDistribution:
        """Distribution of the trajectories that pass all ``via_points``, taken jointly.

        The closed Gaussian form of :func:`~punnet.movement.conditioning.condition_gaussian`; a via-point with
        zero std is met exactly, one with a positive std is weighed against the prior.

        Raises
        ------
        ShapeError
            If a via-point does not fit the degrees of freedom.
        ConfigurationError
            If exact via-points contradict each other or lie where the prior has no variance.
        """
        via_points = tuple(via_points)
        if not via_points:
            return self
        rows = [self.basis.derivative([point.phase], point.order)[0] for point in via_points]
        observation, values, variances = stack_via_points(via_points, self.dimensions, rows)
        mean, covariance = condition_gaussian(
            self.weight_mean.ravel(), self.weight_covariance, observation, values, variances
        )
        return replace(
            self,
            weight_mean=mean.reshape(self.weight_mean.shape),
            weight_covariance=covariance,
            via_points=self.via_points + via_points,
        )

    def broadened(self, std: ArrayLike) -> TrajectoryDistribution:
        """Add independent variance ``std``² (one number or (D,)) to every weight; the mean stays.

        Lets conditioning leave the demonstrations, as from a start that none of them had.
        """
        per_degree = np.broadcast_to(np.asarray(std, dtype=np.float64), (self.dimensions,))
        added = np.diag(np.repeat(per_degree**2, self.basis.count))
        return replace(self, weight_covariance=self.weight_covariance + added)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "schema": DISTRIBUTION_SCHEMA,
            "space": self.space,
            "names": list(self.names),
            "duration": self.duration,
            "basis": self.basis.to_json(),
            "weight_mean": self.weight_mean.tolist(),
            "weight_covariance": self.weight_covariance.tolist(),
            "observation_std": np.asarray(self.observation_std).tolist(),
            "via_points": [point.to_json() for point in self.via_points],
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> TrajectoryDistribution:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        FileFormatError
            If the schema is unknown, a field is missing or the arrays do not fit.
        """
        if not isinstance(data, dict) or data.get("schema") != DISTRIBUTION_SCHEMA:
            found = data.get("schema") if isinstance(data, dict) else type(data).__name__
            raise FileFormatError(
                f"trajectory distribution JSON: schema must be '{DISTRIBUTION_SCHEMA}', got {found!r}"
            )
        try:
            return cls(
                basis=GaussianBasis.from_json(data["basis"]),
                weight_mean=np.asarray(data["weight_mean"], dtype=np.float64),
                weight_covariance=np.asarray(data["weight_covariance"], dtype=np.float64),
                duration=float(data["duration"]),
                names=tuple(str(name) for name in data["names"]),
                space=data["space"],
                observation_std=np.asarray(data["observation_std"], dtype=np.float64),
                via_points=tuple(ViaPoint.from_json(point) for point in data["via_points"]),
            )
        except FileFormatError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"trajectory distribution JSON: {error}") from error


def _require_semi_definite(covariance: NDArray[np.float64]) -> None:
    largest = float(np.abs(covariance).max())
    if not np.allclose(covariance, covariance.T, rtol=0.0, atol=1e-8 * largest):
        raise ConfigurationError("trajectory distribution: weight_covariance is not symmetric")
    allowed = 1e-8 * largest
    try:
        # A factor of the slightly raised matrix exists unless an eigenvalue is below −allowed; that is ten
        # times quicker than the eigenvalues, which only the message needs.
        np.linalg.cholesky(covariance + (allowed + np.finfo(np.float64).tiny) * np.eye(len(covariance)))
    except np.linalg.LinAlgError as error:
        smallest = float(np.linalg.eigvalsh(covariance)[0])
        raise ConfigurationError(
            f"trajectory distribution: weight_covariance has a negative eigenvalue, {smallest:.3g}"
        ) from error
