"""The arm: the Robot protocol, where the picker sits, the Panda's kinematics, and any other arm as data."""

from punnet.robot.arm import Arm
from punnet.robot.arm_file import ARMS, load_arm
from punnet.robot.arm_shape import Boxes
from punnet.robot.dry_run import DryRunRobot
from punnet.robot.nearest import nearest_solution, nearest_solutions
from punnet.robot.panda import HOME, JOINT_NAMES, PANDA_LIMITS, PANDA_TORQUE, Panda
from punnet.robot.path import follow_path
from punnet.robot.protocol import (
    NOT_ALONE,
    NOTHING_HELD,
    TOO_THICK,
    CutResult,
    GripResult,
    MotionResult,
    Robot,
)
from punnet.robot.safety import GuardedRobot, MotionGuard
from punnet.robot.serial_arm import SerialArm
from punnet.robot.tool import BLADE_ABOVE_GRIP, COMING_IN, GRIP_OPENING, T_FLANGE_CAMERA, T_FLANGE_TOOL

__all__ = [
    "ARMS",
    "BLADE_ABOVE_GRIP",
    "COMING_IN",
    "GRIP_OPENING",
    "HOME",
    "JOINT_NAMES",
    "NOTHING_HELD",
    "NOT_ALONE",
    "PANDA_LIMITS",
    "PANDA_TORQUE",
    "TOO_THICK",
    "T_FLANGE_CAMERA",
    "T_FLANGE_TOOL",
    "Arm",
    "Boxes",
    "CutResult",
    "DryRunRobot",
    "GripResult",
    "GuardedRobot",
    "MotionGuard",
    "MotionResult",
    "Panda",
    "Robot",
    "SerialArm",
    "follow_path",
    "load_arm",
    "nearest_solution",
    "nearest_solutions",
]
