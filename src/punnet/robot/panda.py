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
from punnet.movement import JointLimits
from punnet.robot.arm import Arm
from punnet.robot.arm_shape import PICKER_PIECES, ArmShape, Piece
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


# Parts in order along the arm. A piece is: part, frame, its two ends in that frame, radius; metres.
# Frames 1 … 7 are the links' by modified Denavit–Hartenberg, 8 is the flange, 0 the base.
_BASE, _SHOULDER, _UPPER_ARM, _FOREARM, _WRIST, _PICKER = range(6)
_PIECES: tuple[tuple[int, int, Piece], ...] = (
    (_BASE, 0, ((0.0, 0.0, 0.06), (0.0, 0.0, 0.20), 0.085)),
    (_BASE, 0, ((-0.09, -0.03, 0.05), (-0.09, 0.03, 0.05), 0.085)),
    (_BASE, 0, ((-0.05, 0.0, 0.06), (0.0, 0.0, 0.06), 0.085)),
    (_SHOULDER, 1, ((0.0, 0.0, -0.10), (0.0, 0.0, 0.0), 0.085)),
    (_SHOULDER, 2, ((0.0, 0.0, -0.07), (0.0, 0.0, 0.07), 0.075)),
    (_UPPER_ARM, 3, ((0.0, 0.0, -0.20), (0.0, 0.0, 0.0), 0.075)),
    (_UPPER_ARM, 4, ((0.0, 0.0, -0.07), (0.0, 0.0, 0.07), 0.070)),
    (_FOREARM, 5, ((0.0, 0.0, -0.33), (0.0, 0.0, -0.22), 0.070)),
    (_FOREARM, 5, ((0.0, 0.03, -0.20), (0.0, 0.075, -0.02), 0.055)),
    (_WRIST, 6, ((0.0, 0.0, -0.06), (0.0, 0.0, 0.02), 0.070)),
    (_WRIST, 6, ((0.03, 0.015, 0.0), (0.08, 0.015, 0.0), 0.070)),
    (_WRIST, 7, ((0.0, 0.0, 0.02), (0.0, 0.0, 0.09), 0.055)),
    (_WRIST, 7, ((0.02, 0.02, 0.08), (0.048, 0.048, 0.08), 0.048)),
    *((_PICKER, 8, piece) for piece in PICKER_PIECES),
)
# Neighbours along the arm always touch; between base and upper arm there always is air.
_TOGETHER = frozenset({(part, part + 1) for part in range(_PICKER)} | {(_BASE, _UPPER_ARM)})
_SHAPE = ArmShape.of_pieces(_PIECES, together=_TOGETHER, standing=_SHOULDER)


@dataclass(frozen=True, eq=False)
class Panda(Arm):
    """The Panda with a tool on its flange, J = 7. Links are frames 1 … 7 of the table above.

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
        super().__post_init__()
        if len(self.limits) != 7:
            raise ShapeError(f"panda: limits of seven joints needed, got {len(self.limits)}")

    @property
    def home(self) -> NDArray[np.float64]:
        """Home joints (7,)."""
        return HOME.copy()

    @property
    def shape(self) -> ArmShape:
        """Spheres that hold arm and picker."""
        return _SHAPE

    def forward_kinematics(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Flange poses ``T_base_flange`` (..., 4, 4) of joints (..., 7).

        Raises
        ------
        ShapeError
            If the last axis is not seven long.
        """
        q = self._joints(joints)
        T = np.zeros((*q.shape[:-1], 4, 4))
        for column, axis in enumerate(_link_frames(q)[-1]):
            T[..., :3, column] = np.moveaxis(axis, 0, -1)
        T[..., :3, 3] += FLANGE_LENGTH * T[..., :3, 2]
        T[..., 3, 3] = 1.0
        return T

    def link_poses(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Poses (..., 9, 4, 4) in the base frame of the base itself, links 1 … 7 and the flange, for joints (..., 7)."""
        q = self._joints(joints)
        T = np.zeros((*q.shape[:-1], 9, 4, 4))
        T[..., 3, 3] = 1.0
        T[..., 0, :3, :3] = np.eye(3)
        for link, frame in enumerate(_link_frames(q), start=1):
            for column, axis in enumerate(frame):
                T[..., link, :3, column] = np.moveaxis(axis, 0, -1)
        T[..., 8, :, :] = self.forward_kinematics(q)
        return T

    def jacobian(self, joints: ArrayLike) -> NDArray[np.float64]:
        """Geometric Jacobian (..., 6, 7) of the flange's origin in the base frame.

        Rows 0–2 take joint rates to the linear velocity in m/s, rows 3–5 to the angular velocity in rad/s.
        """
        q = self._joints(joints)
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
