"""A trajectory distribution seen through a smooth map of its values: joints as poses, poses in another chart.

The mean goes through the map itself, the covariance through its linearisation along the mean: a linear map of
the weights, so that what correlates at two instants still does afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement.basis import GaussianBasis
from punnet.movement.covariance import covariance_factor, require_semi_definite
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.kinematics import ForwardKinematics
from punnet.movement.pose_chart import PoseChart

__all__ = ["from_quaternion_weights", "in_basis", "in_chart", "pushed_forward", "to_task_space"]

Array = NDArray[np.float64]
SAMPLES = 150


def pushed_forward(
    basis: GaussianBasis,
    weight_mean: Array,
    weight_covariance: Array,
    function: Callable[[Array], Array],
    derivative: Callable[[Array], Array],
) -> tuple[Array, Array]:
    """Weights of ``function(x)`` for a trajectory x with weights of mean (D, B) and covariance (D·B, D·B).

    ``function`` takes (T, D) to (T, E), ``derivative`` (T, D) to (T, E, D). Returned are the mean (E, B) and the
    covariance (E·B, E·B) of the weights that come nearest on a grid of phases.
    """
    phi, projection = _on_grid(basis)
    x = phi @ weight_mean.T
    values, J = function(x), derivative(x)
    # M[(e, c), (d, b)] = Σ_t P[c, t] J[t, e, d] Φ[t, b] takes weights of x to weights of the function.
    M = np.einsum("ct,ted,tb->ecdb", projection, J, phi, optimize=True)
    M = M.reshape(values.shape[1] * basis.count, -1)
    root = covariance_factor(weight_covariance)
    spread = M @ root
    return (projection @ values).T, spread @ spread.T


def in_basis(distribution: TrajectoryDistribution, basis: GaussianBasis) -> TrajectoryDistribution:
    """The distribution with other basis functions: the weights that come nearest to every trajectory.

    Takes what was read with the ill-conditioned ``GaussianBasis.recorded()`` to the default.
    """
    z = np.linspace(0.0, 1.0, SAMPLES)
    M = np.linalg.pinv(basis.phi(z)) @ distribution.basis.phi(z)
    D, B = distribution.weight_mean.shape
    root = M @ covariance_factor(distribution.weight_covariance).reshape(D, B, -1)
    root = root.reshape(D * basis.count, -1)
    return replace(
        distribution, basis=basis, weight_mean=distribution.weight_mean @ M.T, weight_covariance=root @ root.T
    )


def to_task_space(
    distribution: TrajectoryDistribution, kinematics: ForwardKinematics, *, chart: PoseChart | None = None
) -> TrajectoryDistribution:
    """Task-space distribution of a joint-space one, through the arm's kinematics.

    ``chart`` is around the mean's orientations if not given.

    Raises
    ------
    ConfigurationError
        If the distribution is in task space already.
    """
    if distribution.space != "joint":
        raise ConfigurationError(
            "to_task_space: the distribution is in task space already; in_chart changes charts"
        )
    if chart is None:
        chart = PoseChart.around([kinematics.pose(distribution.mean(np.linspace(0.0, 1.0, SAMPLES)))])
    return _in_task_space(distribution, kinematics, chart)


def in_chart(distribution: TrajectoryDistribution, chart: PoseChart) -> TrajectoryDistribution:
    """The task-space distribution around another reference orientation.

    Raises
    ------
    ConfigurationError
        If the distribution is in joint space.
    """
    if distribution.chart is None:
        raise ConfigurationError("in_chart: joints have no chart; see to_task_space")
    return _in_task_space(distribution, distribution.chart.kinematics(), chart)


def _in_task_space(
    distribution: TrajectoryDistribution, kinematics: ForwardKinematics, chart: PoseChart
) -> TrajectoryDistribution:
    def coordinates(x: Array) -> Array:
        return chart.coordinates(kinematics.pose(x))

    def derivative(x: Array) -> Array:
        return np.asarray(np.linalg.solve(chart.jacobian(coordinates(x)), kinematics.jacobian(x)))

    mean, covariance = pushed_forward(
        distribution.basis, distribution.weight_mean, distribution.weight_covariance, coordinates, derivative
    )
    middle = distribution.mean([0.5])
    noise = derivative(middle)[0] * np.asarray(distribution.observation_std)
    return TrajectoryDistribution(
        basis=distribution.basis,
        weight_mean=mean,
        weight_covariance=covariance,
        duration=distribution.duration,
        space="task",
        observation_std=np.sqrt(np.square(noise).sum(axis=1)),
        chart=chart,
    )


def from_quaternion_weights(
    basis: GaussianBasis, weight_mean: ArrayLike, weight_covariance: ArrayLike, *, duration: float = 1.0
) -> TrajectoryDistribution:
    """Task-space distribution of weights that were recorded as x, y, z and four free quaternion numbers.

    The lab kept task-space movements so (scalar last). The quaternions are put on the sphere, their signs
    made continuous; spread off the sphere, which is no rotation, falls away.

    Parameters
    ----------
    basis
        Of the weights; ``GaussianBasis.recorded()`` for the lab's.
    weight_mean, weight_covariance
        (7, B) and (7·B, 7·B).
    duration
        Seconds.

    Raises
    ------
    ShapeError
        If the shapes are wrong or the mean's quaternion comes near zero, where it has no direction.
    """
    mean = np.asarray(weight_mean, dtype=np.float64)
    covariance = np.asarray(weight_covariance, dtype=np.float64)
    size = 7 * basis.count
    if mean.shape != (7, basis.count) or covariance.shape != (size, size):
        raise ShapeError(
            f"quaternion weights: must be (7, {basis.count}) and ({size}, {size}), got {mean.shape}, {covariance.shape}"
        )
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        raise ShapeError("quaternion weights: must be finite")
    require_semi_definite(covariance)
    return from_quaternion_factor(basis, mean, covariance_factor(covariance), duration=duration)


def from_quaternion_factor(
    basis: GaussianBasis, weight_mean: Array, factor: Array, *, duration: float = 1.0
) -> TrajectoryDistribution:
    """As :func:`from_quaternion_weights`, from a factor F (7·B, R) of the covariance ``F Fᵀ``.

    Raises
    ------
    ShapeError
        As there.
    """
    if not (np.isfinite(weight_mean).all() and np.isfinite(factor).all()):
        raise ShapeError("quaternion weights: must be finite")
    B = basis.count
    phi, projection = _on_grid(basis)
    q = phi @ weight_mean[3:].T
    length = np.linalg.norm(q, axis=1)
    if length.min() < 0.1:
        raise ShapeError(
            f"quaternion weights: the mean's quaternion has a length of {length.min():.2g} on the way"
        )
    chart = PoseChart.around_quaternions([q / length[:, None]])
    turned, rates = chart.of_quaternions(q)
    # Σ_t P[c, t] J[t, e, d] Φ[t, b], as in `pushed_forward`, of the orientation alone: positions stay as they are.
    M = (rates.transpose(1, 2, 0)[:, :, None] * projection).reshape(-1, SAMPLES) @ phi
    M = M.reshape(3, 4, B, B).transpose(0, 2, 1, 3).reshape(3 * B, 4 * B)
    root = np.concatenate((factor[: 3 * B], M @ factor[3 * B :]))
    weights, spread = np.concatenate((weight_mean[:3], (projection @ turned).T)), root @ root.T
    return TrajectoryDistribution.of_sound_covariance(
        basis, weights, spread, duration=duration, space="task", chart=chart
    )


@lru_cache(maxsize=16)
def _on_grid(basis: GaussianBasis) -> tuple[Array, Array]:
    """Φ (T, B) on the grid of phases and its pseudo-inverse (B, T), both to be read only."""
    phi = basis.phi(np.linspace(0.0, 1.0, SAMPLES))
    projection = np.linalg.pinv(phi)
    for array in (phi, projection):
        array.setflags(write=False)
    return phi, np.asarray(projection, dtype=np.float64)
