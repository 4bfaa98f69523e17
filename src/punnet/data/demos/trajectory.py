"""Positions over time, and the weights of a movement primitive that stand for many of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import continuous_quaternions

__all__ = ["POSE_NAMES", "Clock", "Space", "Trajectory", "WeightDistribution", "as_poses"]

Space = Literal["joint", "task"]
Clock = Literal["seconds", "phase"]

POSE_NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Metres in the base frame, and a unit quaternion with the scalar last."""

_UNIT_TOLERANCE = 1e-6
_SYMMETRY_TOLERANCE = 1e-9
_PSD_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One movement.

    Parameters
    ----------
    times
        (T,) strictly increasing, T ≥ 2: seconds, or phases from 0 to 1 if ``clock`` says so.
    values
        (T, D): radians in joint space; x, y, z in metres and x, y, z, w of a unit quaternion in task space.
    names
        D names; ``q1`` … ``qD``, or :data:`POSE_NAMES`, if empty.
    space
        ``"joint"`` or ``"task"``.
    clock
        ``"phase"`` where it is not known how long the movement took.

    Raises
    ------
    ShapeError
        If an array has another shape than stated, is not finite, or the times do not increase; in task space
        also if a quaternion is not of unit length or changes its sign from one sample to the next.
    """

    times: NDArray[np.float64]
    values: NDArray[np.float64]
    names: tuple[str, ...] = ()
    space: Space = "joint"
    clock: Clock = "seconds"

    def __post_init__(self) -> None:
        times, values = _array(self.times, "times"), _array(self.values, "values")
        if times.ndim != 1 or times.size < 2:
            raise ShapeError(f"trajectory: times must be (T,) with T ≥ 2, got {times.shape}")
        if values.ndim != 2 or len(values) != len(times) or values.shape[1] < 1:
            raise ShapeError(f"trajectory: values must be ({len(times)}, D), got {values.shape}")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise ShapeError("trajectory: times and values must be finite")
        if (np.diff(times) <= 0).any():
            raise ShapeError("trajectory: times must increase from sample to sample")
        if self.space not in ("joint", "task") or self.clock not in ("seconds", "phase"):
            raise ShapeError(
                f"trajectory: space must be joint or task and clock seconds or phase, "
                f"got {self.space!r} and {self.clock!r}"
            )
        if self.space == "task":
            _check_poses(values)
        names = tuple(self.names) or _default_names(self.space, values.shape[1])
        if len(names) != values.shape[1] or len(set(names)) != len(names):
            raise ShapeError(f"trajectory: {values.shape[1]} different names are needed, got {names}")
        for name, value in (("times", times), ("values", values)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "names", names)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def duration(self) -> float:
        """From the first to the last sample: seconds, or phase."""
        return float(self.times[-1] - self.times[0])

    @property
    def end(self) -> NDArray[np.float64]:
        """(D,) where it ends."""
        return np.asarray(self.values[-1])

    def at(self, times: ArrayLike) -> NDArray[np.float64]:
        """Values (T', D) at other times (T',), straight between samples, the ends held; quaternions stay unit."""
        wanted = np.atleast_1d(np.asarray(times, dtype=np.float64))
        found = np.stack([np.interp(wanted, self.times, column) for column in self.values.T], axis=1)
        if self.space == "task":
            found[:, 3:] /= np.linalg.norm(found[:, 3:], axis=1, keepdims=True)
        return found

    def resampled(self, count: int) -> NDArray[np.float64]:
        """Values (count, D) at times spread evenly from start to end: what a movement primitive is fitted to.

        Raises
        ------
        ConfigurationError
            If ``count`` is below 2.
        """
        if count < 2:
            raise ConfigurationError(f"trajectory: at least 2 samples are needed, got {count}")
        return self.at(np.linspace(self.times[0], self.times[-1], count))

    def lasting(self, seconds: float) -> Trajectory:
        """The same movement stretched to start at 0 and take ``seconds``.

        Raises
        ------
        ConfigurationError
            If that is not positive.
        """
        if not (math.isfinite(seconds) and seconds > 0):
            raise ConfigurationError(f"trajectory: a duration must be positive seconds, got {seconds}")
        return replace(self, times=(self.times - self.times[0]) * (seconds / self.duration), clock="seconds")


@dataclass(frozen=True, eq=False)
class WeightDistribution:
    """Weights of a movement primitive that somebody fitted to several demonstrations and kept in their place.

    The basis is that of the thesis (section 5.2): ``ψ_i(z) = b_i(z) / Σ_j b_j(z)``,
    ``b_i(z) = exp(−(z − c_i)² / (2 h))``, centres evenly on [0, 1]: ``GaussianBasis(count=B, width=h)``. The
    covariance is kept as the file has it; :attr:`smallest_eigenvalues` tells whether it is one.

    Parameters
    ----------
    mean
        (D, B).
    covariance
        (D, B, B), one block a degree of freedom, symmetric.
    width
        h of the basis, positive.
    space
        ``"joint"`` or ``"task"``.

    Raises
    ------
    ShapeError
        If a shape disagrees, a number is not finite, or a block not symmetric.
    """

    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    width: float
    space: Space = "joint"

    def __post_init__(self) -> None:
        mean, covariance = _array(self.mean, "weight mean"), _array(self.covariance, "weight covariance")
        if mean.ndim != 2 or mean.shape[1] < 2 or not np.isfinite(mean).all():
            raise ShapeError(f"weights: mean must be finite (D, B ≥ 2), got {mean.shape}")
        if covariance.shape != (*mean.shape, mean.shape[1]) or not np.isfinite(covariance).all():
            raise ShapeError(
                f"weights: covariance must be finite {(*mean.shape, mean.shape[1])}, got {covariance.shape}"
            )
        scale = np.abs(covariance).max(initial=0.0)
        if np.abs(covariance - covariance.swapaxes(1, 2)).max(initial=0.0) > _SYMMETRY_TOLERANCE * scale:
            raise ShapeError("weights: each block of the covariance must be symmetric")
        if not (math.isfinite(self.width) and self.width > 0):
            raise ShapeError(f"weights: the basis's width must be positive, got {self.width}")
        if self.space == "task" and len(mean) != len(POSE_NAMES):
            raise ShapeError(f"weights: task space has 7 coordinates, got {len(mean)}")
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", covariance)

    @property
    def smallest_eigenvalues(self) -> NDArray[np.float64]:
        """(D,) of each block, over its largest in size; below −1e-9 the block is no covariance."""
        eigenvalues = np.linalg.eigvalsh(self.covariance)
        largest = np.maximum(np.abs(eigenvalues).max(axis=1), np.finfo(np.float64).tiny)
        return np.asarray(eigenvalues[:, 0] / largest)

    @property
    def is_psd(self) -> NDArray[np.bool_]:
        """(D,) whether each block is positive semi-definite, rounding allowed for."""
        return np.asarray(self.smallest_eigenvalues >= -_PSD_TOLERANCE)

    def basis_values(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Values Φ (T, B) of the basis at phases (T,)."""
        offsets = np.asarray(phase, dtype=np.float64)[:, None] - np.linspace(0.0, 1.0, self.mean.shape[1])
        bumps = np.exp(-np.square(offsets) / (2.0 * self.width))
        return np.asarray(bumps / bumps.sum(axis=1, keepdims=True))

    def mean_values(self, phase: ArrayLike) -> NDArray[np.float64]:
        """(T, D) of the mean movement, quaternions as the weights give them: not of unit length."""
        return np.asarray(self.basis_values(phase) @ self.mean.T)

    def std(self, phase: ArrayLike) -> NDArray[np.float64]:
        """(T, D) standard deviation; what a block that is no covariance has below zero counts as zero."""
        phi = self.basis_values(phase)
        return np.asarray(np.sqrt(np.maximum(np.einsum("tb,dbc,tc->td", phi, self.covariance, phi), 0.0)))

    def mean_trajectory(self, samples: int = 150) -> Trajectory:
        """The mean movement over phase; quaternions made unit.

        Raises
        ------
        ShapeError
            If a quaternion vanishes on the way, so that it has no direction.
        """
        phase = np.linspace(0.0, 1.0, samples)
        values = self.mean_values(phase)
        if self.space == "task":
            return as_poses(phase, values, clock="phase")
        return Trajectory(phase, values, clock="phase")


def as_poses(times: ArrayLike, values: ArrayLike, *, clock: Clock = "seconds") -> Trajectory:
    """Task-space trajectory from poses (T, 7) whose quaternions are of any length and sign.

    Raises
    ------
    ShapeError
        As :class:`Trajectory`, and if a quaternion is zero.
    """
    poses = _array(values, "poses")
    if poses.ndim != 2 or poses.shape[1] != len(POSE_NAMES):
        raise ShapeError(f"poses: must be (T, 7), got {poses.shape}")
    lengths = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    if not (lengths > _UNIT_TOLERANCE).all():
        raise ShapeError("poses: a quaternion is zero or not a number, and gives no orientation")
    poses[:, 3:] = continuous_quaternions(poses[:, 3:] / lengths)
    return Trajectory(np.asarray(times, dtype=np.float64), poses, space="task", clock=clock)


def _check_poses(values: NDArray[np.float64]) -> None:
    if values.shape[1] != len(POSE_NAMES):
        raise ShapeError(
            f"trajectory: task space has 7 coordinates (x y z qx qy qz qw), got {values.shape[1]}"
        )
    quaternions = values[:, 3:]
    if np.abs(np.linalg.norm(quaternions, axis=1) - 1.0).max() > _UNIT_TOLERANCE:
        raise ShapeError("trajectory: quaternions must be of unit length; see as_poses")
    if (np.einsum("ti,ti->t", quaternions[1:], quaternions[:-1]) < 0).any():
        raise ShapeError("trajectory: quaternions must not change sign between samples; see as_poses")


def _default_names(space: Space, count: int) -> tuple[str, ...]:
    return POSE_NAMES if space == "task" else tuple(f"q{number + 1}" for number in range(count))


def _array(value: ArrayLike, what: str) -> NDArray[np.float64]:
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ShapeError(f"{what}: numbers in a rectangular array are needed") from error
