"""Any serial arm of revolute joints: forward kinematics and Jacobian from the geometry of its chain, vectorised."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.geometry import is_transform
from punnet.robot.arm import Arm
from punnet.robot.arm_shape import ArmShape

__all__ = ["ModelSource", "SerialArm"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelSource:
    """Where an arm was read from, so that a simulator can have it too.

    ``path`` of the URDF or MJCF file, the body ``flange``, and where the picker's frame sits on it, ``T_body_flange`` (4, 4).
    """

    path: Path
    flange: str
    T_body_flange: Array


@dataclass(frozen=True, eq=False)
class SerialArm(Arm):
    """A chain of revolute joints, each turning about an axis through the origin of its link's frame.

    Parameters
    ----------
    T_flange_tool, limits
        As :class:`~punnet.robot.arm.Arm`'s.
    T_base_foot
        Pose (4, 4) of the arm's foot in the base frame: how it is mounted.
    T_link_next
        (J + 1, 4, 4): the first link's frame in the foot's, each link's in the one before, the flange's in the last link's,
        all joints at zero.
    axes
        (J, 3) unit axis of each joint in its link's frame.
    home_joints
        (J,) see :attr:`~punnet.robot.arm.Arm.home`, radians.
    room
        See :attr:`~punnet.robot.arm.Arm.shape`; frames are 0 for the foot, 1 … J for the links, J + 1 for the flange.
    name
        The arm's name.
    source
        Its model file, if it was read from one.

    Raises
    ------
    ShapeError
        If a shape is not as above, a matrix no rigid transform, an axis not of unit length, or home outside the limits.
    """

    T_base_foot: Array
    T_link_next: Array
    axes: Array
    home_joints: Array
    room: ArmShape
    name: str
    source: ModelSource | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.limits)
        shapes = {"T_link_next": (count + 1, 4, 4), "axes": (count, 3), "home_joints": (count,)}
        for field, shape in shapes.items():
            values = np.array(getattr(self, field), dtype=np.float64)
            if values.shape != shape or not np.isfinite(values).all():
                raise ShapeError(f"{self.name}: {field} must be finite and {shape}, got {values.shape}")
            values.setflags(write=False)
            object.__setattr__(self, field, values)
        if not is_transform(self.T_base_foot) or not all(is_transform(T) for T in self.T_link_next):
            raise ShapeError(f"{self.name}: T_base_foot or one of T_link_next is no rigid transform")
        if np.abs(np.linalg.norm(self.axes, axis=1) - 1.0).max() > 1e-6:
            raise ShapeError(f"{self.name}: joint axes must be of unit length")
        if not self.within_limits(self.home_joints):
            raise ShapeError(f"{self.name}: home {self.home_joints.tolist()} is outside the joint limits")

    @property
    def home(self) -> Array:
        """Home joints (J,)."""
        return np.array(self.home_joints)

    @property
    def shape(self) -> ArmShape:
        """Spheres that hold arm and picker."""
        return self.room

    def forward_kinematics(self, joints: ArrayLike) -> Array:
        """Flange poses ``T_base_flange`` (..., 4, 4) of joints (..., J)."""
        return self.link_poses(joints)[..., -1, :, :]

    def link_poses(self, joints: ArrayLike) -> Array:
        """Poses (..., J + 2, 4, 4) of foot, links and flange."""
        q = self._joints(joints)
        turns = _turns(self.axes, q)
        T = np.empty((*q.shape[:-1], self.joint_count + 2, 4, 4))
        T[..., 0, :, :] = self.T_base_foot
        for joint in range(self.joint_count):
            frame = T[..., joint, :, :] @ self.T_link_next[joint]
            frame[..., :3, :3] = frame[..., :3, :3] @ turns[..., joint, :, :]
            T[..., joint + 1, :, :] = frame
        T[..., -1, :, :] = T[..., -2, :, :] @ self.T_link_next[-1]
        return T

    def jacobian(self, joints: ArrayLike) -> Array:
        """Geometric Jacobian (..., 6, J) of the flange's origin in the base frame."""
        T = self.link_poses(joints)
        axes = np.einsum("...jik,jk->...ji", T[..., 1:-1, :3, :3], self.axes)
        lever = T[..., -1:, :3, 3] - T[..., 1:-1, :3, 3]
        return np.concatenate(
            (np.swapaxes(np.cross(axes, lever), -1, -2), np.swapaxes(axes, -1, -2)), axis=-2
        )


def _turns(axes: Array, q: Array) -> Array:
    """Rotations (..., J, 3, 3) by angles (..., J) about axes (J, 3): Rodrigues' formula."""
    x, y, z = axes.T
    zero = np.zeros_like(x)
    cross = np.stack(
        (np.stack((zero, -z, y), -1), np.stack((z, zero, -x), -1), np.stack((-y, x, zero), -1)), axis=1
    )
    sine, versine = np.sin(q)[..., None, None], (1.0 - np.cos(q))[..., None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))
