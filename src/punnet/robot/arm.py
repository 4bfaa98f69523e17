"""What every arm can tell of itself: where its flange and its links are for given joints, what its limits are.

:class:`~punnet.robot.panda.Panda` has it in closed form; :class:`~punnet.robot.serial_arm.SerialArm` is any other serial arm
of revolute joints, read from a model file. Both have the base frame of :doc:`conventions </conventions>`, whichever way
the arm is mounted in it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.geometry import invert_transform, is_transform
from punnet.movement import ForwardKinematics, JointLimits
from punnet.robot.arm_shape import ArmShape

__all__ = ["Arm"]


@dataclass(frozen=True, eq=False)
class Arm(ABC):
    """An arm with a tool on its flange. J is its number of joints.

    Parameters
    ----------
    T_flange_tool
        Pose of the tool frame in the flange frame, (4, 4).
    limits
        Joint limits.

    Raises
    ------
    ShapeError
        If ``T_flange_tool`` is not a rigid transform.
    """

    T_flange_tool: NDArray[np.float64]
    limits: JointLimits

    def __post_init__(self) -> None:
        T = np.array(self.T_flange_tool, dtype=np.float64)
        if not is_transform(T):
            raise ShapeError("arm: T_flange_tool is not a 4×4 rigid transform")
        T.setflags(write=False)
        object.__setattr__(self, "T_flange_tool", T)

    @property
    @abstractmethod
    def home(self) -> NDArray[np.float64]:
        """Joints (J,) from where the camera on the flange looks at the plant, radians."""

    @property
    @abstractmethod
    def shape(self) -> ArmShape:
        """Room that arm and picker take."""

    @abstractmethod
    def forward_kinematics(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Flange poses ``T_base_flange`` (..., 4, 4) of joints (..., J).

        Raises
        ------
        ShapeError
            If the last axis is not J long.
        """

    @abstractmethod
    def link_poses(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Poses (..., J + 2, 4, 4) in the base frame of the arm's foot, its links and the flange, for joints (..., J)."""

    @abstractmethod
    def jacobian(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian (..., 6, J) of the flange's origin in the base frame.

        Rows 0–2 take joint rates to the linear velocity in m/s, rows 3–5 to the angular velocity in rad/s.
        """

    @property
    def joint_count(self) -> int:
        """J."""
        return len(self.limits)

    def forward_kinematics_tool(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Tool poses ``T_base_tool`` (..., 4, 4) of joints (..., J)."""
        return self.forward_kinematics(joints) @ self.T_flange_tool

    def flange_pose(self, T_base_tool: ArrayLike) -> NDArray[np.float64]:
        """Flange poses ``T_base_flange`` (..., 4, 4) that put the tool at ``T_base_tool`` (..., 4, 4)."""
        return np.asarray(T_base_tool, dtype=np.float64) @ invert_transform(self.T_flange_tool)

    def jacobian_tool(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian (..., 6, J) of the tool's origin in the base frame, rows as :meth:`jacobian`."""
        J = self.jacobian(joints)
        lever = self.forward_kinematics(joints)[..., :3, :3] @ self.T_flange_tool[:3, 3]
        J[..., :3, :] += np.cross(J[..., 3:, :], lever[..., None], axis=-2)
        return J

    @property
    def tool_kinematics(self) -> ForwardKinematics:
        """The tool's kinematics as movement primitives take them, to condition on poses of the tool."""
        return ForwardKinematics(self.forward_kinematics_tool, self.jacobian_tool)

    def manipulability(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Yoshikawa's measure √det(J Jᵀ) (...) of the flange; 0 at a singularity, about 0.06 at the Panda's home."""
        J = self.jacobian(joints)
        return np.asarray(np.sqrt(np.maximum(np.linalg.det(J @ np.swapaxes(J, -1, -2)), 0.0)))

    def limit_margin(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Radians (...) from the nearest position limit; negative outside, NaN for NaN joints."""
        q = self._joints(joints)
        return np.asarray(np.minimum(q - self.limits.lower, self.limits.upper - q).min(axis=-1))

    def within_limits(self, joints: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether joints (..., J) keep at least ``margin`` radians from every position limit; not if NaN."""
        return np.asarray(self.limit_margin(joints) >= margin)

    def _joints(self, joints: ArrayLike) -> NDArray[np.float64]:
        q = np.asarray(joints, dtype=np.float64)
        if q.shape[-1:] != (self.joint_count,):
            raise ShapeError(f"arm: joints must be (..., {self.joint_count}), got {q.shape}")
        return q
