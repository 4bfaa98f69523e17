"""An arm in a model that a world can be built around: the Panda, or any arm that was read from a model file."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, FileFormatError
from punnet.geometry import quaternion_from_rotation
from punnet.robot import Arm, Panda, SerialArm
from punnet.robot.arm_model import read_arm_spec
from punnet.robot.serial_arm import ModelSource
from punnet.sim.arm import JOINT_NAMES, PANDA_FLANGE, SERVO_LAG, WRIST_BODY, panda_spec
from punnet.sim.layers import ARM_VISUAL, COLLISION_ONLY, TOUCHES_PLANT_AND_STRUCTURE, TOUCHES_STRUCTURE

__all__ = ["PlacedArm", "place_arm"]

# Of other arms, of which no model file tells it: as the FR3's.
_STIFFNESS, _WRIST_STIFFNESS = (
    4500.0,
    2000.0,
)  # N·m/rad, of the joints of shoulder and elbow, and of the last three
_DAMPING, _ARMATURE, _FRICTION = 0.21, 0.195, 1.137
_PREFIX = "arm/"
_LOWEST_PEDESTAL = 0.02  # metres that a foot has to be above the table to be drawn on something
_COLOUR = (0.72, 0.74, 0.77, 1.0)


@dataclass(frozen=True, eq=False)
class PlacedArm:
    """An arm in a model of its own.

    Parameters
    ----------
    spec
        The model, the base frame its world, with joint-position servos named as the joints.
    joints
        Names of the joints, from the foot on.
    first_link
        Body that the first joint turns; all that hangs on it is the arm.
    wrist
        Body that the picker is mounted on.
    T_wrist_flange
        (4, 4) the picker's frame in that body's.
    """

    spec: mujoco.MjSpec
    joints: tuple[str, ...]
    first_link: str
    wrist: str
    T_wrist_flange: NDArray[np.float64]


def place_arm(arm: Arm, *, with_visuals: bool = True) -> PlacedArm:
    """Put an arm into a model.

    Parameters
    ----------
    arm
        A Panda, or an arm that was read from a model file.
    with_visuals
        Keep what is drawn of it for third-person views; the wrist camera never sees the arm, so a world that is only
        looked at through it builds and renders faster without.

    Raises
    ------
    ConfigurationError
        If it is another arm without a model file.
    FileFormatError
        If its model can't be read any more.
    """
    if isinstance(arm, Panda):
        spec = panda_spec(with_visuals=with_visuals)
        return PlacedArm(spec, JOINT_NAMES, "fr3_link1", WRIST_BODY, PANDA_FLANGE)
    if isinstance(arm, SerialArm) and arm.source is not None:
        return _other(arm, arm.source, with_visuals=with_visuals)
    raise ConfigurationError(
        f"simulator: {type(arm).__name__} has no model file to put into a world; load it with punnet.robot.load_arm"
    )


def _other(arm: SerialArm, source: ModelSource, *, with_visuals: bool) -> PlacedArm:
    model = read_arm_spec(source.path)
    model.compiler.discardvisual = False
    for thing in (
        *model.actuators,
        *model.sensors,
        *model.keys,
        *model.equalities,
        *model.cameras,
        *model.lights,
    ):
        model.delete(thing)
    for geom in list(model.worldbody.geoms):
        model.delete(geom)
    for body in list(model.body(source.flange).bodies):
        model.delete(body)  # a gripper of its own, where the picker goes
    joints = arm.limits.joint_names
    for index, name in enumerate(joints):
        joint = model.joint(name)
        joint.range = (arm.limits.lower[index], arm.limits.upper[index])
        joint.armature, joint.frictionloss = _ARMATURE, _FRICTION
        joint.damping = np.full_like(np.asarray(joint.damping, dtype=np.float64), _DAMPING)
    first = model.joint(joints[0]).parent.name
    _touch_and_show(model, {model.joint(name).parent.name for name in joints[-2:]}, with_visuals=with_visuals)
    spec = _mounted(model, arm.T_base_foot, source)
    joints = tuple(_PREFIX + name for name in joints)
    for index, name in enumerate(joints):
        stiffness = _WRIST_STIFFNESS if index >= len(joints) - 3 else _STIFFNESS
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=stiffness, kv=stiffness * SERVO_LAG)
        actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
    return PlacedArm(spec, joints, _PREFIX + first, _PREFIX + source.flange, source.T_body_flange)


def _touch_and_show(model: mujoco.MjSpec, last_links: set[str], *, with_visuals: bool) -> None:
    """Contact layers as the Panda's; what collides is also what is drawn, unless the model has its own looks."""
    has_looks = any(not (geom.contype or geom.conaffinity) for geom in model.geoms)
    for body in model.bodies[1:]:
        body.gravcomp = 1.0
    for geom in list(model.geoms):
        if geom.contype or geom.conaffinity:
            near_plant = geom.parent.name in last_links
            geom.contype, geom.conaffinity = TOUCHES_PLANT_AND_STRUCTURE if near_plant else TOUCHES_STRUCTURE
            geom.group = ARM_VISUAL if with_visuals and not has_looks else COLLISION_ONLY
            geom.rgba = _COLOUR
        elif with_visuals:
            geom.group = ARM_VISUAL
        else:
            model.delete(geom)


def _mounted(model: mujoco.MjSpec, T_base_foot: NDArray[np.float64], source: ModelSource) -> mujoco.MjSpec:
    """The model in a world of its own, at the arm's mount."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    quaternion = np.roll(quaternion_from_rotation(T_base_foot[:3, :3]), 1)
    frame = spec.worldbody.add_frame(pos=T_base_foot[:3, 3], quat=quaternion)
    if T_base_foot[2, 3] > _LOWEST_PEDESTAL:
        half = float(T_base_foot[2, 3]) / 2.0
        spec.worldbody.add_geom(
            name="pedestal",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=(0.07, half, 0.0),
            pos=(T_base_foot[0, 3], T_base_foot[1, 3], half),
            rgba=_COLOUR,
            contype=0,
            conaffinity=0,
            group=ARM_VISUAL,
        )
    try:
        spec.attach(model, frame=frame, prefix=_PREFIX)
    except ValueError as error:
        raise FileFormatError(f"{source.path}: can't be put into a world ({error})") from error
    return spec
