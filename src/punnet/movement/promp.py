"""Fitting a probabilistic movement primitive to demonstrations (thesis section 5.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement.basis import GaussianBasis
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.pose_chart import PoseChart
from punnet.movement.reduction import reduce_demonstrations
from punnet.movement.regression import Estimator, Ridge, WeightEstimate

__all__ = ["Covariance", "ProMP", "checked_demonstrations"]

Covariance = Literal["full", "per-degree"]
COVARIANCES: tuple[Covariance, ...] = ("full", "per-degree")


@dataclass(frozen=True, slots=True)
class ProMP:
    """How demonstrations become a :class:`~punnet.movement.TrajectoryDistribution`.

    Parameters
    ----------
    basis
        Basis functions.
    estimator
        :class:`~punnet.movement.Ridge` (Eq. 5.2: quick, the default) or
        :class:`~punnet.movement.ExpectationMaximisation` (for noisy, short or partial demonstrations, and priors).
    covariance
        ``"full"`` over all degrees of freedom together, or ``"per-degree"`` blocks, as the thesis has it.

    Raises
    ------
    ConfigurationError
        If the covariance is of an unknown kind.
    """

    basis: GaussianBasis = field(default_factory=GaussianBasis)
    estimator: Estimator = field(default_factory=Ridge)
    covariance: Covariance = "full"

    def __post_init__(self) -> None:
        if self.covariance not in COVARIANCES:
            raise ConfigurationError(
                f"ProMP: covariance must be one of {COVARIANCES}, got {self.covariance!r}"
            )

    def weights(self, demonstration: ArrayLike, times: ArrayLike | None = None) -> NDArray[np.float64]:
        """Weights (D, B) of one demonstration (T, D) by ridge regression; sampled evenly or at times (T,).

        Raises
        ------
        ShapeError
            If it is not a finite (T, D) array with T ≥ 2.
        """
        arrays = checked_demonstrations([demonstration])
        phases = None if times is None else _phases([times], arrays)[0]
        return np.asarray(Ridge().weights(reduce_demonstrations(self.basis, arrays, phases))[0])

    def fit(
        self,
        demonstrations: Sequence[ArrayLike],
        *,
        times: Sequence[ArrayLike] | None = None,
        durations: Sequence[float] | None = None,
        names: Sequence[str] = (),
    ) -> TrajectoryDistribution:
        """Distribution of joint-space trajectories like the demonstrations.

        Parameters
        ----------
        demonstrations
            N ≥ 1 arrays (T_n, D); lengths may differ.
        times
            N arrays (T_n,) of seconds, rising, from the start to the end of each movement. Without them the
            demonstrations are taken to be sampled evenly.
        durations
            (N,) seconds each took, instead of ``times``; the mean is kept. One second if neither is given.
        names
            Of the degrees of freedom.

        Raises
        ------
        ShapeError
            If there is no demonstration, one is not a finite (T ≥ 2, D) array, they disagree in D, or times or
            durations do not fit; the message names the demonstration.
        ConfigurationError
            If both times and durations are given.
        """
        arrays = checked_demonstrations(demonstrations)
        estimate, duration = self._estimate(arrays, times, durations)
        return self._distribution(estimate, duration=duration, names=tuple(names))

    def fit_poses(
        self,
        demonstrations: Sequence[ArrayLike],
        *,
        times: Sequence[ArrayLike] | None = None,
        durations: Sequence[float] | None = None,
        chart: PoseChart | None = None,
    ) -> TrajectoryDistribution:
        """Distribution of task-space trajectories like demonstrated poses, arrays (T_n, 4, 4) ``T_base_end``.

        Orientations are weighed as rotation vectors around their mean (or the reference of ``chart``), so that
        every mean and sample is a pose.

        Raises
        ------
        ShapeError, ConfigurationError
            As :meth:`fit`; also if a pose is not rigid or turns right round.
        """
        if len(demonstrations) == 0:
            raise ShapeError("ProMP: no demonstrations to fit")
        chart = PoseChart.around(demonstrations) if chart is None else chart
        arrays = checked_demonstrations([chart.coordinates(poses) for poses in demonstrations])
        estimate, duration = self._estimate(arrays, times, durations)
        return self._distribution(estimate, duration=duration, space="task", chart=chart)

    def _distribution(self, estimate: WeightEstimate, **fields: Any) -> TrajectoryDistribution:
        make = TrajectoryDistribution.of_sound_covariance if estimate.sound else TrajectoryDistribution
        return make(
            self.basis, estimate.mean, estimate.covariance, observation_std=estimate.noise_std, **fields
        )

    def _estimate(
        self,
        arrays: Sequence[NDArray[np.float64]],
        times: Sequence[ArrayLike] | None,
        durations: Sequence[float] | None,
    ) -> tuple[WeightEstimate, float]:
        if times is not None and durations is not None:
            raise ConfigurationError("ProMP: give times or durations, not both; times tell the durations")
        phases: list[NDArray[np.float64]] | None = None
        duration = 1.0
        if times is not None:
            phases, spans = _phases(times, arrays)
            duration = float(spans.mean())
        elif durations is not None:
            if len(durations) != len(arrays):
                raise ShapeError(f"ProMP: {len(durations)} durations for {len(arrays)} demonstrations")
            duration = float(np.mean(durations))
        reduced = reduce_demonstrations(self.basis, arrays, phases)
        return self.estimator.estimate(reduced, self.covariance), duration


def checked_demonstrations(demonstrations: Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
    """Demonstrations (T_n, D) as arrays of one D.

    Raises
    ------
    ShapeError
        Naming the demonstration, and of a number that is not finite its place.
    """
    if len(demonstrations) == 0:
        raise ShapeError("ProMP: no demonstrations to fit")
    arrays = []
    for number, demonstration in enumerate(demonstrations):
        try:
            values = np.asarray(demonstration, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ShapeError(f"ProMP: demonstration {number} is no array of numbers ({error})") from error
        if values.ndim != 2 or values.shape[1] < 1:
            raise ShapeError(f"ProMP: demonstration {number} must be (T, D), got {values.shape}")
        if len(values) < 2:
            raise ShapeError(
                f"ProMP: demonstration {number} has {len(values)} sample; a movement needs its start and its end"
            )
        # The sum of squares of finite numbers is finite (short of 1e154), and quicker than asking each.
        if not math.isfinite(np.vdot(values, values)) and not np.isfinite(values).all():
            sample, degree = np.argwhere(~np.isfinite(values))[0].tolist()
            raise ShapeError(
                f"ProMP: demonstration {number} must be finite, but sample {sample}, degree of freedom {degree} is "
                f"{values[sample, degree]}"
            )
        arrays.append(values)
    counts = [values.shape[1] for values in arrays]
    if any(count != counts[0] for count in counts):
        odd = next(number for number, count in enumerate(counts) if count != counts[0])
        raise ShapeError(
            f"ProMP: demonstrations disagree in D: demonstration 0 has {counts[0]} degrees of freedom, "
            f"demonstration {odd} has {counts[odd]}"
        )
    return arrays


def _phases(
    times: Sequence[ArrayLike], arrays: Sequence[NDArray[np.float64]]
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Phases (T_n,) of each demonstration and durations (N,)."""
    if len(times) != len(arrays):
        raise ShapeError(f"ProMP: {len(times)} arrays of times for {len(arrays)} demonstrations")
    phases, spans = [], []
    for number, (stamps, values) in enumerate(zip(times, arrays, strict=True)):
        t = np.asarray(stamps, dtype=np.float64)
        if t.shape != (len(values),) or not np.isfinite(t).all() or (np.diff(t) <= 0).any():
            raise ShapeError(
                f"ProMP: times of demonstration {number} must be ({len(values)},), finite and rising"
            )
        phases.append((t - t[0]) / (t[-1] - t[0]))
        spans.append(t[-1] - t[0])
    return phases, np.array(spans)
