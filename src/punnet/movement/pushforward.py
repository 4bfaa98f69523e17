"""A trajectory distribution seen through a smooth map of its values: joints as poses, poses in another chart.

The mean goes through the map itself, the covariance through its linearisation along the mean: a linear map of
the weights, so that what correlates at two instants still does afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import make_transform, rotation_from_quaternion
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
    phi = basis.phi(np.linspace(0.0, 1.0, SAMPLES))
    projection = np.linalg.pinv(phi)
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
    along = basis.phi(np.linspace(0.0, 1.0, SAMPLES)) @ mean.T
    shortest = float(np.linalg.norm(along[:, 3:], axis=1).min())
    if shortest < 0.1:
        raise ShapeError(
            f"quaternion weights: the mean's quaternion has a length of {shortest:.2g} on the way"
        )
    chart = PoseChart.around([_poses(along)])

    def coordinates(x: Array) -> Array:
        return chart.coordinates(_poses(x))

    def derivative(x: Array) -> Array:
        c = coordinates(x)
        return np.asarray(np.linalg.solve(chart.jacobian(c), _pose_rates(x)))

    weights, spread = pushed_forward(basis, mean, covariance, coordinates, derivative)
    return TrajectoryDistribution(basis, weights, spread, duration=duration, space="task", chart=chart)


def _poses(x: Array) -> Array:
    return make_transform(rotation_from_quaternion(x[..., 3:]), x[..., :3])


def _pose_rates(x: Array) -> Array:
    """Jacobian (T, 6, 7) from rates of position and free quaternion to linear and angular velocity (base axes).

    ω = 2 q̇ q* for a unit quaternion; of a free one the part along it changes nothing.
    """
    length = np.linalg.norm(x[:, 3:], axis=1)[:, None]
    (qx, qy, qz, qw) = (x[:, 3:] / length).T
    rows = [[qw, -qz, qy, -qx], [qz, qw, -qx, -qy], [-qy, qx, qw, -qz]]
    J = np.zeros((len(x), 6, 7))
    J[:, :3, :3] = np.eye(3)
    J[:, 3:, 3:] = 2.0 * np.moveaxis(np.array(rows), -1, 0) / length[..., None]
    return J
