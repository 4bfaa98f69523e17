"""The Franka Emika Panda: geometry, limits, forward kinematics and Jacobian, vectorised over joint vectors.

Modified (Craig) Denavit–Hartenberg parameters and limits are those that the maker publishes with libfranka
("Robot and interface specifications"). The FR3 has the same geometry.

=====  ========  ========  ======
link   a (m)     d (m)     α (rad)
=====  ========  ========  ======
1      0         0.333     0
2      0         0         −π/2
3      0         0.316     π/2
4      0.0825    0         π/2
5      −0.0825   0.384     −π/2
6      0         0         π/2
7      0.088     0         π/2
flange 0         0.107     0
=====  ========  ========  ======
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.geometry import invert_transform, is_transform
from punnet.movement import ForwardKinematics, JointLimits
from punnet.robot.tool import T_FLANGE_TOOL

__all__ = ["HOME", "JOINT_NAMES", "PANDA_LIMITS", "PANDA_TORQUE", "Panda"]

SHOULDER_HEIGHT = 0.333
UPPER_ARM = 0.316
ELBOW_OFFSET = 0.0825
FOREARM = 0.384
WRIST_OFFSET = 0.088
FLANGE_LENGTH = 0.107

# α as −1, 0, 1 quarter turns, a and d in metres, link by link; the flange is link 8.
QUARTER_TURNS = (0, -1, 1, 1, -1, 1, 1)
LINK_LENGTHS = (0.0, 0.0, 0.0, ELBOW_OFFSET, -ELBOW_OFFSET, 0.0, WRIST_OFFSET)
LINK_OFFSETS = (SHOULDER_HEIGHT, 0.0, UPPER_ARM, 0.0, FOREARM, 0.0, 0.0)

JOINT_NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))

PANDA_LIMITS = JointLimits(
    lower=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    upper=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    velocity=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
    acceleration=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    joint_names=JOINT_NAMES,
)
"""rad, rad/s, rad/s², rad/s³."""

PANDA_TORQUE: NDArray[np.float64] = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
"""Largest joint torques in newton metres."""

HOME: NDArray[np.float64] = np.array([0.035, -1.010, -0.152, -2.533, -0.158, 2.880, 0.054])
"""Where the lab's arm looks at the plant from: flange at about (0.28, −0.06, 0.73) m, looking along +x."""
for _constant in (PANDA_TORQUE, HOME):
    _constant.setflags(write=False)


@dataclass(frozen=True, eq=False)
class Panda:
    """The arm with a tool on its flange.

    Parameters
    ----------
    T_flange_tool
        Pose of the tool frame in the flange frame, (4, 4).
    limits
        Joint limits.

    Raises
    ------
    ShapeError
        If ``T_flange_tool`` is not a rigid transform or the limits are not for seven joints.
    """

    T_flange_tool: NDArray[np.float64] = field(default_factory=T_FLANGE_TOOL.copy)
    limits: JointLimits = PANDA_LIMITS

    def __post_init__(self) -> None:
        T = np.array(self.T_flange_tool, dtype=np.float64)
        if not is_transform(T):
            raise ShapeError("panda: T_flange_tool is not a 4×4 rigid transform")
        if len(self.limits) != 7:
            raise ShapeError(f"panda: limits of seven joints needed, got {len(self.limits)}")
        T.setflags(write=False)
        object.__setattr__(self, "T_flange_tool", T)

    @property
    def home(self) -> NDArray[np.float64]:
        """Home joints (7,)."""
        return HOME.copy()

    def forward_kinematics(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Flange poses ``T_base_flange`` (..., 4, 4) of joints (..., 7).

        Raises
        ------
        ShapeError
            If the last axis is not seven long.
        """
        q = _joints(joints)
        T = np.zeros((*q.shape[:-1], 4, 4))
        for column, axis in enumerate(_link_frames(q)[-1]):
            T[..., :3, column] = np.moveaxis(axis, 0, -1)
        T[..., :3, 3] += FLANGE_LENGTH * T[..., :3, 2]
        T[..., 3, 3] = 1.0
        return T

    def link_poses(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Poses (..., 9, 4, 4) in the base frame of the base itself, links 1 … 7 and the flange, for joints (..., 7)."""
        q = _joints(joints)
        T = np.zeros((*q.shape[:-1], 9, 4, 4))
        T[..., 3, 3] = 1.0
        T[..., 0, :3, :3] = np.eye(3)
        for link, frame in enumerate(_link_frames(q), start=1):
            for column, axis in enumerate(frame):
                T[..., link, :3, column] = np.moveaxis(axis, 0, -1)
        T[..., 8, :, :] = self.forward_kinematics(q)
        return T

    def forward_kinematics_tool(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Tool poses ``T_base_tool`` (..., 4, 4) of joints (..., 7)."""
        return self.forward_kinematics(joints) @ self.T_flange_tool

    def flange_pose(self, T_base_tool: ArrayLike) -> NDArray[np.float64]:
        """Flange poses ``T_base_flange`` (..., 4, 4) that put the tool at ``T_base_tool`` (..., 4, 4)."""
        return np.asarray(T_base_tool, dtype=np.float64) @ invert_transform(self.T_flange_tool)

    def jacobian(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian (..., 6, 7) of the flange's origin in the base frame.

        Rows 0–2 take joint rates to the linear velocity in m/s, rows 3–5 to the angular velocity in rad/s.
        """
        q = _joints(joints)
        frames = _link_frames(q)
        end = frames[-1][3] + FLANGE_LENGTH * frames[-1][2]
        axis = np.stack([frame[2] for frame in frames], axis=1)  # (3, 7, ...)
        lever = end[:, None] - np.stack([frame[3] for frame in frames], axis=1)
        J = np.empty((6, 7, *q.shape[:-1]))
        J[0] = axis[1] * lever[2] - axis[2] * lever[1]
        J[1] = axis[2] * lever[0] - axis[0] * lever[2]
        J[2] = axis[0] * lever[1] - axis[1] * lever[0]
        J[3:] = axis
        return np.moveaxis(J, (0, 1), (-2, -1))

    def jacobian_tool(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian (..., 6, 7) of the tool's origin in the base frame, rows as :meth:`jacobian`."""
        J = self.jacobian(joints)
        lever = self.forward_kinematics(joints)[..., :3, :3] @ self.T_flange_tool[:3, 3]
        J[..., :3, :] += np.cross(J[..., 3:, :], lever[..., None], axis=-2)
        return J

    @property
    def tool_kinematics(self) -> ForwardKinematics:
        """The tool's kinematics as movement primitives take them, to condition on poses of the tool."""
        return ForwardKinematics(self.forward_kinematics_tool, self.jacobian_tool)

    def manipulability(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Yoshikawa's measure √det(J Jᵀ) (...) of the flange; 0 at a singularity, about 0.06 at home."""
        J = self.jacobian(joints)
        return np.asarray(np.sqrt(np.maximum(np.linalg.det(J @ np.swapaxes(J, -1, -2)), 0.0)))

    def limit_margin(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Radians (...) from the nearest position limit; negative outside, NaN for NaN joints."""
        q = _joints(joints)
        return np.asarray(np.minimum(q - self.limits.lower, self.limits.upper - q).min(axis=-1))

    def within_limits(self, joints: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether joints (..., 7) keep at least ``margin`` radians from every position limit; not if NaN."""
        return np.asarray(self.limit_margin(joints) >= margin)


def _joints(joints: ArrayLike) -> NDArray[np.float64]:
    q = np.asarray(joints, dtype=np.float64)
    if q.shape[-1:] != (7,):
        raise ShapeError(f"panda: joints must be (..., 7), got {q.shape}")
    return q


def _link_frames(q: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], ...]]:
    """Axes x, y, z and origin, each (3, ...), of the seven link frames in the base frame."""
    cosines, sines = np.cos(q), np.sin(q)
    shape = (3, *q.shape[:-1])
    x, y, z, p = (np.zeros(shape) for _ in range(4))
    x[0] = y[1] = z[2] = 1.0
    frames: list[tuple[NDArray[np.float64], ...]] = []
    for joint, (turns, length, offset) in enumerate(
        zip(QUARTER_TURNS, LINK_LENGTHS, LINK_OFFSETS, strict=True)
    ):
        if length:
            p = p + length * x
        if turns:  # a turn about x by ±90° swaps the other two axes
            y, z = turns * z, -turns * y
        if offset:
            p = p + offset * z
        c, s = cosines[..., joint], sines[..., joint]
        x, y = c * x + s * y, c * y - s * x
        frames.append((x, y, z, p))
    return frames
