"""Conditioning on where the hand shall be: via-points in space for a distribution over joints.

A pose is no linear function of the weights, so it is linearised, conditioned on in closed form together with
everything else asked, and linearised again where that led: the iterated extended Kalman update, a Gauss–Newton
method. Steps are shortened until they pay (likelihood against what is still missed), so that it settles on the
most likely trajectory also where an arm has joints to spare.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, KinematicsError, ShapeError
from punnet.geometry import is_transform, vector_from_rotation
from punnet.movement.conditioning import condition_gaussian, observe
from punnet.movement.covariance import covariance_factor
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.kinematics import ForwardKinematics
from punnet.movement.via_point import ViaPoint

__all__ = ["PoseViaPoint", "condition_on_poses"]

Array = NDArray[np.float64]

ITERATIONS = 100
LARGEST_STEP = 0.5  # of a coordinate; beyond it the linearisation is not to be trusted
SHORTEST = 1e-3  # share of a step below which nothing is gained
CONVERGED = 1e-7
MET = 1e-6  # metres and radians by which an exact pose may be missed
CORRECTIONS = 4


@dataclass(frozen=True, eq=False)
class PoseViaPoint:
    """A pose that the hand shall pass at a phase.

    Parameters
    ----------
    phase
        0 start … 1 end.
    pose
        ``T_base_end`` (4, 4); "end" is the frame that the kinematics are of.
    position_std, rotation_std
        Standard deviation along each axis in metres, and of the turn about each in radians. 0 asks for the
        exact pose, infinity leaves that part free.

    Raises
    ------
    ShapeError
        If the pose is not rigid.
    ConfigurationError
        If the phase lies outside [0, 1], a std is negative, or both are infinite.
    """

    phase: float
    pose: Array = field(default_factory=lambda: np.eye(4))
    position_std: float = 0.0
    rotation_std: float = 0.0

    def __post_init__(self) -> None:
        pose = np.array(self.pose, dtype=np.float64)
        if not is_transform(pose):
            raise ShapeError("pose via-point: pose is not a 4×4 rigid transform")
        if not 0.0 <= self.phase <= 1.0:
            raise ConfigurationError(f"pose via-point: phase must lie in [0, 1], got {self.phase}")
        if not (self.position_std >= 0 and self.rotation_std >= 0):
            raise ConfigurationError("pose via-point: std must not be negative")
        if math.isinf(self.position_std) and math.isinf(self.rotation_std):
            raise ConfigurationError("pose via-point: with both std infinite it asks for nothing")
        object.__setattr__(self, "pose", pose)

    @property
    def std(self) -> Array:
        """Standard deviations (6,): three of the position, three of the rotation."""
        return np.repeat((float(self.position_std), float(self.rotation_std)), 3)


def condition_on_poses(
    distribution: TrajectoryDistribution,
    poses: Sequence[PoseViaPoint],
    kinematics: ForwardKinematics | None = None,
    *,
    via_points: Sequence[ViaPoint] = (),
) -> TrajectoryDistribution:
    """Distribution of the trajectories whose hand passes ``poses``, and that pass ``via_points``, jointly.

    Parameters
    ----------
    distribution
        In joint space, or in task space.
    poses
        Where the hand shall be.
    kinematics
        Of the arm, as ``punnet.robot.Panda().tool_kinematics``; in task space the chart's are used.
    via_points
        Further values asked of the degrees of freedom themselves.

    Returns
    -------
    TrajectoryDistribution
        Its mean meets exact poses to 1e-6 m and rad; its covariance is that of the last linearisation. Joint
        limits are not looked at: :func:`~punnet.movement.retime` refuses a path that leaves them.

    Raises
    ------
    KinematicsError
        If an exact pose is not met: it is out of reach, or the demonstrations never vary there.
    ConfigurationError
        If joints come without kinematics, or exact values contradict each other.
    """
    if kinematics is None:
        if distribution.chart is None:
            raise ConfigurationError(
                "condition_on_poses: a joint-space distribution needs the arm's kinematics"
            )
        kinematics = distribution.chart.kinematics()
    if not poses:
        return distribution.condition(via_points)
    problem = _Problem.of(distribution, kinematics, poses, via_points)
    u = _search(problem)
    if problem.missed(u) > MET:
        raise KinematicsError(
            f"{problem.worst(u)}: it is out of reach or contradicts another via-point; give a std, another "
            "pose, or broaden the distribution"
        )
    factor = problem.root @ covariance_factor(problem.update(u)[1])
    return distribution._with_weights(
        problem.weights(u).reshape(distribution.weight_mean.shape),
        factor @ factor.T,
        via_points=distribution.via_points + tuple(via_points),
    )


def _search(problem: _Problem) -> Array:
    """Most likely whitened weights u (N,) among those that meet what was asked, if there are any."""
    u = np.zeros(problem.root.shape[1])
    price = 0.0
    for _ in range(ITERATIONS):
        target, _, multiplier = problem.update(u)
        step = target - u
        size = problem.largest_move(step)
        if size < CONVERGED:
            break
        price = max(price, 1.5 * multiplier)
        share, now = min(1.0, LARGEST_STEP / size), problem.cost(u, price)
        while share > SHORTEST and problem.cost(u + share * step, price) >= now:
            share /= 2.0
        if share <= SHORTEST:
            break
        u = u + share * step
    for _ in range(CORRECTIONS):
        corrected = u + problem.correction(u)
        if problem.missed(corrected) >= problem.missed(u):
            break
        u = corrected
    return u


@dataclass(frozen=True, eq=False)
class _Problem:
    """In whitened weights: w = mean + root u with u ~ N(0, I)."""

    prior: TrajectoryDistribution
    kinematics: ForwardKinematics
    poses: tuple[PoseViaPoint, ...]
    phi: Array  # (P, B) at the poses' phases
    std: Array  # (P, 6)
    linear: tuple[Array, Array, Array]  # what the other via-points observe
    root: Array  # (N, N)

    @classmethod
    def of(
        cls,
        prior: TrajectoryDistribution,
        kinematics: ForwardKinematics,
        poses: Sequence[PoseViaPoint],
        via_points: Sequence[ViaPoint],
    ) -> _Problem:
        linear: tuple[Array, Array, Array] = (np.zeros((0, prior.weight_mean.size)), np.zeros(0), np.zeros(0))
        if via_points:
            linear = observe(via_points, prior.basis, prior.dimensions)
        root = covariance_factor(prior.weight_covariance)
        phi = prior.basis.phi([point.phase for point in poses])
        std = np.stack([point.std for point in poses])
        return cls(prior, kinematics, tuple(poses), phi, std, linear, root)

    def weights(self, u: Array) -> Array:
        """Weights (N,) as they are."""
        return np.asarray(self.prior.weight_mean.ravel() + self.root @ u)

    def _coordinates(self, weights: Array) -> Array:
        """Joints (P, D) at the poses' phases."""
        return self.phi @ weights.reshape(self.prior.weight_mean.shape).T

    def _errors(self, u: Array) -> Array:
        """What is left to the poses (P, 6): metres and rotation vector, base axes."""
        wanted = np.stack([point.pose for point in self.poses])
        T = self.kinematics.pose(self._coordinates(self.weights(u)))
        turn = vector_from_rotation(wanted[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1))
        return np.concatenate((wanted[:, :3, 3] - T[:, :3, 3], turn), axis=1)

    @property
    def noise(self) -> Array:
        """Variances (M,) of everything asked: the other via-points, then the poses."""
        return np.concatenate((self.linear[2], self.std[np.isfinite(self.std)] ** 2))

    def residual(self, u: Array) -> Array:
        """What is left (M,) to everything asked."""
        matrix, values, _ = self.linear
        return np.concatenate((values - matrix @ self.weights(u), self._errors(u)[np.isfinite(self.std)]))

    def rows(self, u: Array) -> Array:
        """Derivative (M, N) of everything asked by u."""
        J = self.kinematics.jacobian(self._coordinates(self.weights(u)))
        rows = np.einsum("pid,pb->pidb", J, self.phi).reshape(self.std.size, -1)
        return np.concatenate((self.linear[0], rows[np.isfinite(self.std).ravel()])) @ self.root

    def update(self, u: Array) -> tuple[Array, Array, float]:
        """Posterior mean and covariance of u, linearised there, and the largest multiplier of what is exact."""
        rows, noise = self.rows(u), self.noise
        left = self.residual(u)
        try:
            target, spread = condition_gaussian(
                np.zeros_like(u), np.eye(len(u)), rows, left + rows @ u, noise
            )
        except ConfigurationError as error:
            raise KinematicsError(
                f"{self.worst(u)}; no trajectory of the distribution comes nearer ({error})"
            ) from error
        exact = noise == 0.0
        if not exact.any():
            return target, spread, 0.0
        still = (left + rows @ (u - target))[~exact] / noise[~exact]
        force = target - rows[~exact].T @ still
        return target, spread, float(np.abs(np.linalg.lstsq(rows[exact].T, force, rcond=None)[0]).max())

    def cost(self, u: Array, price: float) -> float:
        """Negative log-likelihood, and ``price`` for each metre and radian by which what is exact is missed."""
        left, noise = self.residual(u), self.noise
        exact = noise == 0.0
        noisy = np.square(left[~exact]) / noise[~exact]
        return float(0.5 * (u @ u + noisy.sum()) + price * np.abs(left[exact]).sum())

    def correction(self, u: Array) -> Array:
        """Smallest change of u that, to first order, meets what is exact."""
        exact = self.noise == 0.0
        if not exact.any():
            return np.zeros_like(u)
        return np.asarray(np.linalg.lstsq(self.rows(u)[exact], self.residual(u)[exact], rcond=1e-9)[0])

    def largest_move(self, step: Array) -> float:
        """By how much a step of u moves a coordinate at one of the poses."""
        return float(np.abs(self._coordinates(self.root @ step)).max())

    def missed(self, u: Array) -> float:
        """Largest miss of what was asked exactly."""
        return float(np.abs(self.residual(u)[self.noise == 0.0]).max(initial=0.0))

    def worst(self, u: Array) -> str:
        """Describe the pose that is missed by most."""
        errors = np.where(np.isfinite(self.std), np.abs(self._errors(u)), 0.0)
        index = int(np.argmax(errors.max(axis=1)))
        place = np.round(self.poses[index].pose[:3, 3], 3).tolist()
        return (
            f"pose via-point {index} at phase {self.poses[index].phase:g}, {place} m, is missed by "
            f"{1e3 * np.linalg.norm(errors[index, :3]):.1f} mm and "
            f"{np.rad2deg(np.linalg.norm(errors[index, 3:])):.1f}°"
        )
