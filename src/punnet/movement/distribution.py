"""A distribution over trajectories: a Gaussian over the weights of a movement primitive (Eq. 5.6, 5.7).

The weights of D degrees of freedom with B basis functions are stacked degree by degree,
``(θ_11 … θ_1B, θ_21 … θ_DB)``: entry ``d·B + b`` belongs to degree d and function b. The covariance is full,
so correlations between joints are kept (the thesis decouples the joints).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement.basis import GaussianBasis
from punnet.movement.conditioning import condition_on_via_points
from punnet.movement.covariance import covariance_factor, require_semi_definite
from punnet.movement.distribution_json import distribution_to_json, fields_from_json
from punnet.movement.joint_trajectory import JointTrajectory
from punnet.movement.pose_chart import COORDINATE_NAMES, PoseChart
from punnet.movement.reduction import marginal_log_likelihood, reduce_demonstrations
from punnet.movement.retiming import JointLimits, retime
from punnet.movement.via_point import ViaPoint
from punnet.outputs import write_text

__all__ = ["Space", "TrajectoryDistribution"]

Array = NDArray[np.float64]
PATH_POINTS = 150
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
        (D, B) mean weights: radians in joint space; metres and radians of a rotation vector in task space.
    weight_covariance
        (D·B, D·B) covariance of the weights stacked degree by degree; symmetric, positive semi-definite.
    duration
        Seconds that the movement takes at the demonstrated pace; ``duration · phase`` is the time.
    names
        Names of the degrees of freedom; ``q1 … qD``, in task space ``x y z rx ry rz``, if not given.
    space
        ``"joint"``, or ``"task"``: the six coordinates of a ``chart``.
    observation_std
        (D,) standard deviation of the noise ε of Eq. 5.3 around the weighted basis; zeros if not given.
    via_points
        What it has been conditioned on so far, in order.
    chart
        In task space what the coordinates mean as poses; around the base's own axes if not given.

    Raises
    ------
    ShapeError
        If a shape disagrees or a number is not finite.
    ConfigurationError
        If the covariance is not symmetric positive semi-definite, the duration not positive, the space unknown or
        a chart given for joints.
    """

    basis: GaussianBasis
    weight_mean: NDArray[np.float64]
    weight_covariance: NDArray[np.float64]
    duration: float = 1.0
    names: tuple[str, ...] = ()
    space: Space = "joint"
    observation_std: NDArray[np.float64] | None = None
    via_points: tuple[ViaPoint, ...] = ()
    chart: PoseChart | None = None

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
        _require_finite(mean, covariance)
        require_semi_definite(covariance)
        self._complete(mean, (covariance + covariance.T) / 2.0)

    @classmethod
    def of_sound_covariance(
        cls, basis: GaussianBasis, weight_mean: Array, weight_covariance: Array, **fields: Any
    ) -> TrajectoryDistribution:
        """As the constructor, of arrays whose covariance is symmetric and positive semi-definite as it was computed.

        Raises
        ------
        ShapeError, ConfigurationError
            As the constructor, which also looks at the covariance and the shapes of both.
        """
        made = object.__new__(cls)
        made.__dict__.update(basis=basis, **fields)
        _require_finite(weight_mean, weight_covariance)
        made._complete(weight_mean, weight_covariance)
        return made

    def _complete(self, mean: Array, covariance: Array) -> None:
        """Set all fields but the basis, checked."""
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise ConfigurationError(
                f"trajectory distribution: duration must be positive, got {self.duration}"
            )
        self._require_space(len(mean))
        default = COORDINATE_NAMES if self.space == "task" else tuple(f"q{i + 1}" for i in range(len(mean)))
        names = tuple(self.names) or default
        if len(names) != len(mean):
            raise ShapeError(
                f"trajectory distribution: {len(names)} names for {len(mean)} degrees of freedom"
            )
        noise = (
            np.zeros(len(mean)) if self.observation_std is None else np.asarray(self.observation_std, float)
        )
        if noise.shape != (len(mean),) or not all(0.0 <= std < math.inf for std in noise.tolist()):
            raise ShapeError(f"trajectory distribution: observation_std must be ({len(mean)},) and ≥ 0")
        self.__dict__.update(
            weight_mean=mean,
            weight_covariance=covariance,
            duration=float(self.duration),
            names=names,
            space=self.space,
            observation_std=noise,
            via_points=tuple(self.via_points),
            chart=PoseChart() if self.space == "task" and self.chart is None else self.chart,
        )

    def _require_space(self, dimensions: int) -> None:
        if self.space not in SPACES:
            raise ConfigurationError(
                f"trajectory distribution: space must be one of {SPACES}, got {self.space!r}"
            )
        if self.space == "task" and dimensions != len(COORDINATE_NAMES):
            raise ShapeError(
                f"trajectory distribution: task space has the six coordinates of a pose chart, got {dimensions}; "
                "quaternions become rotation vectors by PoseChart.coordinates"
            )
        if self.space == "joint" and self.chart is not None:
            raise ConfigurationError("trajectory distribution: a chart belongs to task space, not to joints")

    def _with_weights(
        self, mean: NDArray[np.float64], covariance: NDArray[np.float64], **changes: Any
    ) -> TrajectoryDistribution:
        """Copy with weights that are right by construction, without the checks of the constructor."""
        copy = object.__new__(TrajectoryDistribution)
        copy.__dict__.update(self.__dict__)
        copy.__dict__.update(weight_mean=mean, weight_covariance=covariance, **changes)
        return copy

    @property
    def dimensions(self) -> int:
        """Number of degrees of freedom D."""
        return int(self.weight_mean.shape[0])

    def mean(self, phase: ArrayLike, order: int = 0) -> NDArray[np.float64]:
        """Mean trajectory (T, D) at phases (T,): Eq. 5.7.

        ``order`` 1 and 2 give its derivatives by phase; divide by ``duration**order`` for those by time.
        """
        return self.basis.derivative(phase, order) @ self.weight_mean.T

    def covariance(self, phase: ArrayLike, order: int = 0) -> NDArray[np.float64]:
        """Covariance (T, D, D) between the degrees of freedom at each phase, without observation noise."""
        phi, D, B = self.basis.derivative(phase, order), self.dimensions, self.basis.count
        half = np.tensordot(phi, self.weight_covariance.reshape(D, B, D, B), axes=(1, 3))
        return np.asarray(np.einsum("tdbe,tb->tde", half, phi), dtype=np.float64)

    def std(self, phase: ArrayLike, order: int = 0) -> NDArray[np.float64]:
        """Give the standard deviation (T, D) at phases (T,), without observation noise: Eq. 5.7."""
        phi, D, B = self.basis.derivative(phase, order), self.dimensions, self.basis.count
        blocks = np.einsum("dbdc->dbc", self.weight_covariance.reshape(D, B, D, B))
        variances = np.einsum("dtc,tc->td", phi @ blocks, phi)
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)), dtype=np.float64)

    def sample(
        self, rng: np.random.Generator, n: int, phase: ArrayLike, order: int = 0
    ) -> NDArray[np.float64]:
        """``n`` smooth trajectories (n, T, D), drawn without observation noise.

        Raises
        ------
        ConfigurationError
            If n is negative.
        """
        if n < 0:
            raise ConfigurationError(f"trajectory distribution: can't draw {n} samples")
        phi, D, B = self.basis.derivative(phase, order), self.dimensions, self.basis.count
        factor = covariance_factor(self.weight_covariance)
        weights = self.weight_mean.ravel() + rng.standard_normal((n, D * B)) @ factor.T
        curves = weights.reshape(n * D, B) @ phi.T
        return np.asarray(curves.reshape(n, D, len(phi)).transpose(0, 2, 1), dtype=np.float64)

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

    def log_likelihood(self, trajectory: ArrayLike, phase: ArrayLike | None = None) -> float:
        """Log-likelihood in nats of a whole observed trajectory (T, D), Eq. 5.5 with the weights integrated out.

        Sampled evenly from start to end, or at phases (T,). The observation noise counts as at least 1e-9.

        Raises
        ------
        ShapeError
            If it is not a finite (T, D) array or the phases are not T.
        """
        values = np.asarray(trajectory, dtype=np.float64)
        if (
            values.ndim != 2
            or values.shape[1] != self.dimensions
            or not np.isfinite(values).all()
            or not len(values)
        ):
            raise ShapeError(
                f"trajectory distribution: trajectory must be finite (T, {self.dimensions}), got {values.shape}"
            )
        phases = None if phase is None else [np.asarray(phase, dtype=np.float64)]
        if phases is not None and phases[0].shape != (len(values),):
            raise ShapeError(f"trajectory distribution: {len(values)} samples but phases {phases[0].shape}")
        reduced = reduce_demonstrations(self.basis, [values], phases)
        noise = np.square(np.asarray(self.observation_std))
        return float(marginal_log_likelihood(reduced, self.weight_mean, self.weight_covariance, noise)[0])

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
        mean, covariance = condition_on_via_points(
            self.weight_mean, self.weight_covariance, self.basis, via_points
        )
        return self._with_weights(mean, covariance, via_points=self.via_points + via_points)

    def broadened(self, std: ArrayLike) -> TrajectoryDistribution:
        """Add independent variance ``std``² (one number or (D,)) to every weight; the mean stays.

        Lets conditioning leave the demonstrations, as from a start that none of them had. Via-points are no longer held to,
        and so :attr:`via_points` is empty.
        """
        per_degree = np.broadcast_to(np.asarray(std, dtype=np.float64), (self.dimensions,))
        added = np.diag(np.repeat(per_degree**2, self.basis.count))
        return replace(self, weight_covariance=self.weight_covariance + added, via_points=())

    def retimed(self, duration: float) -> TrajectoryDistribution:
        """Keep the path and take ``duration`` seconds for it.

        Raises
        ------
        ConfigurationError
            If it is not positive.
        """
        return replace(self, duration=duration)

    def to_joint_trajectory(
        self,
        limits: JointLimits,
        *,
        speed: float = 1.0,
        time_step: float = 0.01,
        at_least: float = 0.0,
        samples: int = PATH_POINTS,
    ) -> JointTrajectory:
        """Time the mean path as an arm may execute it: rest to rest, within its limits (:func:`retime`).

        Parameters
        ----------
        limits
            Of the arm.
        speed
            In (0, 1]: share of its speed to use.
        time_step
            Seconds between the samples.
        at_least
            Seconds to take at least; ``distribution.duration`` keeps the demonstrated pace where the arm can.
        samples
            Points of the path.

        Raises
        ------
        ConfigurationError
            In task space, whose poses need inverse kinematics first (``punnet.planning.task_reach``).
        KinematicsError
            If the mean leaves the joint limits.
        """
        if self.space != "joint":
            raise ConfigurationError(
                "trajectory distribution: poses are no joint trajectory; chart.poses(mean(phase)) are the poses, "
                "punnet.planning.task_reach.joints_along finds the joints"
            )
        path = self.mean(np.linspace(0.0, 1.0, samples))
        return retime(path, limits, speed=speed, time_step=time_step, at_least=at_least)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return distribution_to_json(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> TrajectoryDistribution:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        FileFormatError
            If the schema is unknown, a field is missing or the arrays do not fit.
        """
        fields = fields_from_json(data)
        try:
            return cls(**fields)
        except ValueError as error:
            raise FileFormatError(f"trajectory distribution JSON: {error}") from error

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write a JSON file, whole or not at all.

        Raises
        ------
        OutputError
            If the file exists and ``force`` is not set, or can't be written.
        """
        return write_text(path, json.dumps(self.to_json()) + "\n", force=force)

    @classmethod
    def load(cls, path: str | Path) -> TrajectoryDistribution:
        """Read what :meth:`save` wrote.

        Raises
        ------
        FileFormatError
            If the file is missing or not a trajectory distribution.
        """
        try:
            return cls.from_json(json.loads(Path(path).read_text(encoding="utf-8")))
        except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise FileFormatError(f"{path}: can't be read as JSON ({error})") from error
        except FileFormatError as error:
            raise FileFormatError(f"{path}: {error}") from error


def _require_finite(mean: Array, covariance: Array) -> None:
    # The sum of squares of finite numbers is finite (short of 1e154), and quicker than asking each.
    if not (math.isfinite(np.vdot(mean, mean)) and math.isfinite(np.vdot(covariance, covariance))):
        raise ShapeError("trajectory distribution: weights must be finite")
