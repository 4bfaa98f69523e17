"""The picker on the flange: two separation fingers, two grasping fingers, a blade, and a D435i on top.

Modelled on the thesis' UPH (section 6.1): the separation fingers move leaves and neighbours aside, beneath them the
grasping fingers hold the stem and the blade cuts it. The blade runs just above the grasping pads, so the cut berry
hangs in the grip by its stem. All in the flange frame (x up, y right, z forward at the home pose).
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from punnet.robot.tool import BLADE_ABOVE_GRIP, GRIP_OPENING, T_FLANGE_CAMERA, T_FLANGE_TOOL
from punnet.sim.layers import PLANT_VISUAL, TOUCHES_NOTHING, TOUCHES_PLANT_AND_STRUCTURE
from punnet.sim.orientation import mujoco_quaternion
from punnet.sim.placed_arm import PlacedArm

__all__ = [
    "BLADE_RETRACTED",
    "CAMERA_NAME",
    "CLOSING_FORCE",
    "PAD_GEOMS",
    "SEPARATION_ANGLE",
    "add_picker",
]

CAMERA_NAME = "wrist"
PAD_GEOMS = ("pad_left", "pad_right")
SEPARATION_ANGLE = (0.0, 0.36)
"""Angle of each separation finger to the tool axis, closed and fully open, radians."""
BLADE_RETRACTED = -0.035
"""Where the blade waits, metres behind the grip point."""
CLOSING_FORCE = 3.0
"""Newtons of each pad as it closes: a stem holds, and a fruit between both is not bruised."""

_GRIP_Z = float(T_FLANGE_TOOL[2, 3])
_DARK = (0.13, 0.13, 0.15, 1.0)
_PRINTED = (0.82, 0.83, 0.85, 1.0)
_STEEL = (0.75, 0.78, 0.80, 1.0)
_RUBBER = (0.20, 0.22, 0.24, 1.0)
# Soft pads: about 1 N/mm against a berry of 20 g.
_SOFT = (0.006, 1.0)


def add_picker(arm: PlacedArm) -> None:
    """Mount the picker on an arm and give it its actuators and camera."""
    spec, T = arm.spec, arm.T_wrist_flange
    flange = spec.body(arm.wrist).add_body(
        name="picker", pos=T[:3, 3], quat=mujoco_quaternion(T[:3, :3]), gravcomp=1.0
    )
    _add_housing(flange)
    _add_camera(flange)
    for side, name in ((-1.0, "left"), (1.0, "right")):
        _add_grasping_finger(spec, flange, side, name)
        _add_separation_finger(spec, flange, side, name)
    _add_blade(spec, flange)


def _box(
    body: mujoco.MjsBody,
    half_size: tuple[float, float, float],
    position: tuple[float, float, float],
    rgba: tuple[float, ...],
    *,
    mass: float,
    layer: tuple[int, int] = TOUCHES_PLANT_AND_STRUCTURE,
    name: str = "",
    friction: float = 0.6,
) -> None:
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half_size,
        pos=position,
        rgba=rgba,
        mass=mass,
        contype=layer[0],
        conaffinity=layer[1],
        group=PLANT_VISUAL,
        friction=(friction, 0.01, 0.001),
        solref=_SOFT,
        condim=4,
    )


def _add_housing(flange: mujoco.MjsBody) -> None:
    _box(flange, (0.036, 0.036, 0.010), (0.0, 0.0, 0.010), _DARK, mass=0.10)
    _box(flange, (0.026, 0.030, 0.040), (0.0, 0.0, 0.060), _PRINTED, mass=0.30, name="housing")
    _box(flange, (0.024, 0.007, 0.007), (0.046, 0.0, 0.022), _PRINTED, mass=0.03)


def _add_camera(flange: mujoco.MjsBody) -> None:
    """D435i body (90×25×25 mm) and its colour camera; MuJoCo's cameras look along −z with y up."""
    position = T_FLANGE_CAMERA[:3, 3]
    _box(flange, (0.0125, 0.045, 0.0115), (position[0], 0.0, position[2] - 0.014), _STEEL, mass=0.072)
    for offset in (-0.03, 0.0, 0.03):
        flange.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=(0.005, 0.0006, 0.0),
            pos=(position[0], offset, position[2] - 0.002),
            rgba=(0.02, 0.02, 0.04, 1.0),
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=PLANT_VISUAL,
        )
    to_opengl = np.diag((1.0, -1.0, -1.0))
    quaternion = mujoco_quaternion(T_FLANGE_CAMERA[:3, :3] @ to_opengl)
    flange.add_camera(name=CAMERA_NAME, pos=position, quat=quaternion)


def _add_grasping_finger(spec: mujoco.MjSpec, flange: mujoco.MjsBody, side: float, name: str) -> None:
    """A finger that slides sideways; its pad's inner face is at the middle when the joint is at 0."""
    finger = flange.add_body(name=f"grasp_{name}", pos=(0.0, 0.0, 0.0), gravcomp=1.0)
    joint = finger.add_joint(
        name=f"grasp_{name}",
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=(0.0, side, 0.0),
        range=(0.0, GRIP_OPENING),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=0.02,
        damping=2.0,
    )
    _box(finger, (0.0045, 0.0035, 0.052), (-0.003, side * 0.0055, 0.142), _PRINTED, mass=0.02)
    _box(
        finger,
        (0.0045, 0.0015, 0.011),
        (0.0, side * 0.0015, _GRIP_Z),
        _RUBBER,
        mass=0.005,
        name=f"pad_{name}",
        friction=1.5,
    )
    actuator = spec.add_actuator(
        name=f"grasp_{name}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=joint.name,
        forcerange=(-CLOSING_FORCE, CLOSING_FORCE),
    )
    actuator.set_to_position(kp=1500.0, kv=20.0)


def _add_separation_finger(spec: mujoco.MjSpec, flange: mujoco.MjsBody, side: float, name: str) -> None:
    """A paddle above the grip that turns outwards about the vertical axis of the tool."""
    finger = flange.add_body(name=f"separate_{name}", pos=(0.024, side * 0.018, 0.095), gravcomp=1.0)
    joint = finger.add_joint(
        name=f"separate_{name}",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=(-side, 0.0, 0.0),
        range=(0.0, SEPARATION_ANGLE[1]),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=0.005,
        damping=0.2,
    )
    _box(
        finger,
        (0.0075, 0.0015, 0.050),
        (0.004, 0.0, 0.050),
        _PRINTED,
        mass=0.02,
        friction=0.3,
        name=f"paddle_{name}",
    )
    finger.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=(0.003, 0.009, 0.0),
        pos=(0.004, 0.0, 0.101),
        quat=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0),
        rgba=_PRINTED,
        mass=0.003,
        contype=TOUCHES_PLANT_AND_STRUCTURE[0],
        conaffinity=TOUCHES_PLANT_AND_STRUCTURE[1],
        group=PLANT_VISUAL,
        friction=(0.3, 0.01, 0.001),
        solref=_SOFT,
    )
    actuator = spec.add_actuator(
        name=f"separate_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name, forcerange=(-0.4, 0.4)
    )
    actuator.set_to_position(kp=6.0, kv=0.3)


def _add_blade(spec: mujoco.MjSpec, flange: mujoco.MjsBody) -> None:
    """A thin blade that slides forward over the pads; it cuts by rule (``cutting.py``), not by contact."""
    blade = flange.add_body(name="blade", pos=(BLADE_ABOVE_GRIP, 0.0, _GRIP_Z), gravcomp=1.0)
    joint = blade.add_joint(
        name="blade",
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=(0.0, 0.0, 1.0),
        range=(BLADE_RETRACTED, 0.012),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        armature=0.02,
        damping=2.0,
    )
    _box(blade, (0.0004, 0.010, 0.020), (0.0, 0.0, -0.020), _STEEL, mass=0.02, layer=TOUCHES_NOTHING)
    blade.add_site(name="blade_edge", pos=(0.0, 0.0, 0.0), size=(0.001, 0.001, 0.001), group=5)
    actuator = spec.add_actuator(
        name="blade", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name, forcerange=(-20.0, 20.0)
    )
    actuator.set_to_position(kp=2000.0, kv=30.0)
