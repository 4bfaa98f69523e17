"""Poses as six numbers without constraint: position, and orientation in the tangent space of the sphere.

Unit quaternions are no vector space: the mean of two is not one, and q and −q are the same rotation. A chart
describes an orientation by the rotation vector ξ that leads there from a reference, ``R = R_ref Exp(ξ)``:
three numbers that a movement primitive may weigh, add and sample, with every result an orientation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import (
    continuous_quaternions,
    make_transform,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
)
from punnet.movement.kinematics import ForwardKinematics

__all__ = ["COORDINATE_NAMES", "PoseChart"]

Array = NDArray[np.float64]

COORDINATE_NAMES = ("x", "y", "z", "rx", "ry", "rz")
LARGEST_ANGLE = 2 * np.pi - 0.1  # at a full turn the chart ends
SMALL_ANGLE = 1e-4
RIGID = 1e-6


@dataclass(frozen=True, eq=False)
class PoseChart:
    """Chart of the poses around a reference orientation.

    Parameters
    ----------
    reference
        Quaternion (4,), scalar last, of the orientation that has ξ = 0; best in the middle of what is to be
        described (:meth:`around`). It is normalised.

    Raises
    ------
    ShapeError
        If it is not four finite numbers.
    ConfigurationError
        If it is zero.
    """

    reference: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))

    def __post_init__(self) -> None:
        q = np.array(self.reference, dtype=np.float64)
        if q.shape != (4,) or not np.isfinite(q).all():
            raise ShapeError(f"pose chart: reference must be a finite quaternion (4,), got {q}")
        if not np.linalg.norm(q) > 1e-9:
            raise ConfigurationError("pose chart: the reference quaternion is zero")
        if abs(np.linalg.norm(q) - 1.0) > 1e-12:  # what is of unit length stays as it is, to the last bit
            q /= np.linalg.norm(q)
        q.setflags(write=False)
        object.__setattr__(self, "reference", q)

    @classmethod
    def around(cls, demonstrations: Sequence[ArrayLike]) -> PoseChart:
        """Chart around the mean orientation of demonstrated poses, arrays (T_n, 4, 4); each counts alike.

        The mean is the principal axis of the quaternions' second moments, to which signs do not matter.
        """
        return cls.around_quaternions(
            [
                quaternion_from_rotation(_rigid(demonstration, f"demonstration {number}")[:, :3, :3])
                for number, demonstration in enumerate(demonstrations)
            ]
        )

    @classmethod
    def around_quaternions(cls, demonstrations: Sequence[Array]) -> PoseChart:
        """As :meth:`around`, of unit quaternions, arrays (T_n, 4), of either sign."""
        moments = sum((q.T @ q / len(q) for q in demonstrations), np.zeros((4, 4)))
        return cls(np.linalg.eigh(moments)[1][:, -1])

    def same_as(self, other: PoseChart | None) -> bool:
        """Whether both have the same reference."""
        return other is not None and bool(np.array_equal(self.reference, other.reference))

    def coordinates(self, poses: ArrayLike) -> Array:
        """Coordinates (T, 6) of a trajectory of poses (T, 4, 4): x, y, z, then ξ in the reference's axes.

        ξ is continuous along the trajectory, also through half a turn away from the reference.

        Raises
        ------
        ShapeError
            If these are not rigid transforms.
        ConfigurationError
            If the trajectory turns by a full turn from the reference, where the chart ends.
        """
        T = _rigid(poses, "pose chart")
        q = quaternion_from_rotation(rotation_from_quaternion(self.reference).T @ T[:, :3, :3])
        return np.concatenate((T[:, :3, 3], _rotation_vectors(_of_one_sign(q))[0]), axis=1)

    def of_quaternions(self, quaternions: ArrayLike) -> tuple[Array, Array]:
        """Orientations ξ (T, 3) of a trajectory of quaternions (T, 4) of any length but zero, and ∂ξ/∂q (T, 3, 4).

        Raises
        ------
        ConfigurationError
            As :meth:`coordinates`.
        """
        x, y, z, w = self.reference
        to_relative = np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]])
        free = np.asarray(quaternions, dtype=np.float64) @ to_relative.T
        length = np.sqrt(np.einsum("ti,ti->t", free, free))
        q = _of_one_sign(free / length[:, None])
        xi, rate = _rotation_vectors(q)
        # With q = (v, cos θ/2) and v = u sin θ/2, ξ is θ u, which has rates across u and along it.
        v, cosine = q[:, :3], q[:, 3]
        sine = np.sqrt(np.einsum("ti,ti->t", v, v))
        u = np.divide(v, sine[:, None], out=np.zeros_like(v), where=sine[:, None] > 0.0)
        by_q = np.empty((len(q), 3, 4))
        by_q[:, :, :3] = ((2.0 * cosine - rate)[:, None] * u)[:, :, None] * u[:, None, :]
        by_q[:, :, :3] += rate[:, None, None] * np.eye(3)
        by_q[:, :, 3] = -2.0 * v
        scale = np.copysign(1.0 / length, np.einsum("ti,ti->t", q, free))
        return xi, scale[:, None, None] * (by_q @ to_relative)

    def poses(self, coordinates: ArrayLike) -> Array:
        """Poses (..., 4, 4) at coordinates (..., 6)."""
        c = np.asarray(coordinates, dtype=np.float64)
        if c.shape[-1:] != (6,):
            raise ShapeError(f"pose chart: coordinates must be (..., 6), got {c.shape}")
        return make_transform(
            rotation_from_quaternion(self.reference) @ rotation_from_vector(c[..., 3:]), c[..., :3]
        )

    def jacobian(self, coordinates: ArrayLike) -> Array:
        """Jacobian (..., 6, 6) that takes rates of the coordinates to linear and angular velocity (base axes).

        The rotation part is ``R_ref J(ξ)`` with the left Jacobian
        ``J = I + (1 − cos θ)/θ² [ξ]ₓ + (θ − sin θ)/θ³ [ξ]ₓ²``, θ = ‖ξ‖.
        """
        xi = np.asarray(coordinates, dtype=np.float64)[..., 3:]
        angle = np.linalg.norm(xi, axis=-1)
        small = angle < SMALL_ANGLE
        safe = np.where(small, 1.0, angle)
        first = np.where(small, 0.5 - angle**2 / 24, (1.0 - np.cos(safe)) / safe**2)[..., None, None]
        second = np.where(small, 1.0 / 6.0 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)[..., None, None]
        cross = np.zeros((*xi.shape[:-1], 3, 3))
        for row, column, axis, sign in ((0, 1, 2, -1), (0, 2, 1, 1), (1, 2, 0, -1)):
            cross[..., row, column] = sign * xi[..., axis]
            cross[..., column, row] = -sign * xi[..., axis]
        J = np.zeros((*xi.shape[:-1], 6, 6))
        J[..., :3, :3] = np.eye(3)
        turned = np.eye(3) + first * cross + second * (cross @ cross)
        J[..., 3:, 3:] = rotation_from_quaternion(self.reference) @ turned
        return J

    def kinematics(self) -> ForwardKinematics:
        """The chart as kinematics, so that task-space movements are conditioned on poses as an arm's are."""
        return ForwardKinematics(self.poses, self.jacobian)


def _of_one_sign(quaternions: Array) -> Array:
    """Quaternions (T, 4) with signs that are continuous, and on the whole less than half a turn away."""
    q = continuous_quaternions(quaternions)
    return -q if q[:, 3].sum() < 0 else q


def _rotation_vectors(q: Array) -> tuple[Array, Array]:
    """Rotation vectors θ u (T, 3) of unit quaternions (T, 4), and θ over the sine of its half (T,)."""
    length = np.linalg.norm(q[:, :3], axis=1)
    angle = 2.0 * np.arctan2(length, q[:, 3])
    if angle.max(initial=0.0) > LARGEST_ANGLE:
        raise ConfigurationError(
            f"pose chart: pose {int(np.argmax(angle))} is {np.rad2deg(angle.max()):.0f}° from the reference; "
            "take a reference in the middle of the movement"
        )
    rate = np.divide(angle, length, out=np.full_like(angle, 2.0), where=length > 1e-12)
    return rate[:, None] * q[:, :3], rate


def _rigid(poses: ArrayLike, where: str) -> Array:
    """Poses (T, 4, 4), checked."""
    T = np.asarray(poses, dtype=np.float64)
    if T.ndim != 3 or T.shape[1:] != (4, 4) or len(T) == 0:
        raise ShapeError(f"{where}: poses must be (T ≥ 1, 4, 4), got {T.shape}")
    if not np.isfinite(T).all():
        raise ShapeError(f"{where}: pose {int(np.argmin(np.isfinite(T).all(axis=(1, 2))))} is not finite")
    R = T[:, :3, :3]
    skew = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = (
        (skew > RIGID) | (np.linalg.det(R) < 0) | (np.abs(T[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1) > RIGID)
    )
    if bad.any():
        raise ShapeError(f"{where}: pose {int(np.argmax(bad))} is not a rigid transform")
    return T
