"""Conditioning on where the hand shall be: via-points in space for a distribution over joints.

A pose is no linear function of the weights, so it is linearised, conditioned on in closed form together with
everything else asked, and linearised again where that led (iterated extended Kalman update, a Gauss–Newton
method): among all trajectories that meet the poses it finds the most likely one.
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
from punnet.movement.distribution import TrajectoryDistribution
from punnet.movement.kinematics import ForwardKinematics
from punnet.movement.via_point import ViaPoint

__all__ = ["PoseViaPoint", "condition_on_poses"]

Array = NDArray[np.float64]

ITERATIONS = 60
LARGEST_STEP = 0.5  # of a coordinate; beyond it the linearisation is not to be trusted
CONVERGED = 1e-9
SETTLED = 1e-4  # a search that still moves by more at its end has found nothing
MET = 1e-6  # metres and radians by which an exact pose may be missed


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
        Its mean meets exact poses to 1e-6 m and rad; its covariance is that of the last linearisation.

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
    weights = distribution.weight_mean.ravel()
    covariance = distribution.weight_covariance
    size = math.inf
    for _ in range(ITERATIONS):
        try:
            target, covariance = problem.update(weights)
        except ConfigurationError as error:
            raise KinematicsError(
                f"{problem.worst(weights)}; no trajectory of the distribution comes nearer ({error})"
            ) from error
        step = target - weights
        size = problem.largest_move(step)
        weights = weights + step * min(1.0, LARGEST_STEP / max(size, 1e-300))
        if size < CONVERGED:
            break
    if problem.missed(weights) > MET or size > SETTLED:
        raise KinematicsError(
            f"{problem.worst(weights)}: it is out of reach or contradicts another via-point; give a std, another "
            "pose, or broaden the distribution"
        )
    return distribution._with_weights(
        weights.reshape(distribution.weight_mean.shape),
        covariance,
        via_points=distribution.via_points + tuple(via_points),
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    prior: TrajectoryDistribution
    kinematics: ForwardKinematics
    poses: tuple[PoseViaPoint, ...]
    phi: Array  # (P, B) at the poses' phases
    std: Array  # (P, 6)
    linear: tuple[Array, Array, Array]  # what the other via-points observe

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
        phi = prior.basis.phi([point.phase for point in poses])
        return cls(prior, kinematics, tuple(poses), phi, np.stack([point.std for point in poses]), linear)

    def _coordinates(self, weights: Array) -> Array:
        """Joints (P, D) at the poses' phases."""
        return self.phi @ weights.reshape(self.prior.weight_mean.shape).T

    def _errors(self, weights: Array) -> Array:
        """What is left to the poses (P, 6): metres and rotation vector, base axes."""
        wanted = np.stack([point.pose for point in self.poses])
        T = self.kinematics.pose(self._coordinates(weights))
        turn = vector_from_rotation(wanted[:, :3, :3] @ T[:, :3, :3].transpose(0, 2, 1))
        return np.concatenate((wanted[:, :3, 3] - T[:, :3, 3], turn), axis=1)

    def update(self, weights: Array) -> tuple[Array, Array]:
        """Posterior of the prior, given the poses linearised at ``weights``."""
        q = self._coordinates(weights)
        J = self.kinematics.jacobian(q)
        needed = self._errors(weights) + np.einsum("pij,pj->pi", J, q)
        rows = np.einsum("pid,pb->pidb", J, self.phi).reshape(len(q) * 6, -1)
        asked = np.isfinite(self.std).ravel()
        matrix, values, variances = self.linear
        return condition_gaussian(
            self.prior.weight_mean.ravel(),
            self.prior.weight_covariance,
            np.concatenate((matrix, rows[asked])),
            np.concatenate((values, needed.ravel()[asked])),
            np.concatenate((variances, self.std.ravel()[asked] ** 2)),
        )

    def largest_move(self, step: Array) -> float:
        """By how much a step of the weights moves a coordinate at one of the poses."""
        return float(np.abs(self._coordinates(step)).max())

    def missed(self, weights: Array) -> float:
        """Largest miss of what was asked exactly."""
        return float(np.abs(self._errors(weights)[self.std == 0.0]).max(initial=0.0))

    def worst(self, weights: Array) -> str:
        """Describe the pose that is missed by most."""
        errors = np.where(np.isfinite(self.std), np.abs(self._errors(weights)), 0.0)
        index = int(np.argmax(errors.max(axis=1)))
        place = np.round(self.poses[index].pose[:3, 3], 3).tolist()
        return (
            f"pose via-point {index} at phase {self.poses[index].phase:g}, {place} m, is missed by "
            f"{1e3 * np.linalg.norm(errors[index, :3]):.1f} mm and "
            f"{np.rad2deg(np.linalg.norm(errors[index, 3:])):.1f}°"
        )
