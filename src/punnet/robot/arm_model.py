"""An arm's chain and the room of its links, read from a URDF or MJCF file by MuJoCo's own reader."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.geometry import make_transform, rotation_from_quaternion, rotation_from_vector
from punnet.robot.link_spheres import spheres_of_points, surface_points

if TYPE_CHECKING:
    import mujoco

__all__ = ["ArmModel", "read_arm_model", "read_arm_spec"]

Array = NDArray[np.float64]

FEWEST_JOINTS = 6
"""With fewer the flange can't be held in any pose."""


@dataclass(frozen=True, eq=False)
class ArmModel:
    """What a model file says of a chain of J revolute joints.

    ``T_link_next`` (J + 1, 4, 4), ``axes`` (J, 3) as :class:`~punnet.robot.serial_arm.SerialArm` takes them, ``lower`` and
    ``upper`` (J,) radians, joint ``names``, and of the foot and each link the spheres that hold it: centres (S, 3), radii (S,).
    """

    T_link_next: Array
    axes: Array
    lower: Array
    upper: Array
    names: tuple[str, ...]
    spheres: tuple[tuple[Array, Array], ...]


def read_arm_model(path: str | Path, flange: str) -> ArmModel:
    """Read the chain from the model's world to the body ``flange``.

    Joints elsewhere (fingers) are left as they are at zero. Meshes that can't be found or read are left out.

    Raises
    ------
    FileFormatError
        If the file can't be read, has no such body, the chain has other than revolute, limited joints, or fewer than six, or
        no link has a collision geometry that can be read.
    """
    path = Path(path)
    model, origins = _compiled(path)
    chain = _chain(model, flange, path)
    frames: list[Array] = [np.eye(4)]
    axes, joints, body_link = [], [], {0: 0}
    # What is left to do from the last joint's frame to the body at hand.
    onward = np.eye(4)
    for body in chain:
        onward = onward @ make_transform(_rotation(model.body_quat[body]), model.body_pos[body])
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            _require_revolute(model, joint, path)
            axis, position = model.jnt_axis[joint], model.jnt_pos[joint]
            frames[-1] = onward @ make_transform(
                rotation_from_vector(-axis * model.qpos0[model.jnt_qposadr[joint]]), position
            )
            onward = make_transform(np.eye(3), -position)
            axes.append(axis)
            joints.append(joint)
            frames.append(np.eye(4))
        body_link[body] = len(joints)
    frames[-1] = onward
    if len(joints) < FEWEST_JOINTS:
        raise FileFormatError(
            f"{path}: between the world and '{flange}' are {len(joints)} joints; an arm needs at least {FEWEST_JOINTS}"
        )
    return ArmModel(
        np.stack(frames),
        np.stack(axes),
        np.array([model.jnt_range[joint][0] for joint in joints]),
        np.array([model.jnt_range[joint][1] for joint in joints]),
        tuple(model.joint(joint).name or f"joint{index + 1}" for index, joint in enumerate(joints)),
        _spheres(model, origins, body_link, len(joints), path),
    )


def read_arm_spec(path: Path) -> mujoco.MjSpec:
    """The model as it can be changed, its bodies not fused, with those meshes that can be read.

    Raises
    ------
    FileFormatError
        If the file can't be read.
    """
    import mujoco

    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise FileFormatError(f"{path}: not readable as URDF or MJCF ({error})") from error
    spec.compiler.fusestatic = False
    _keep_readable_meshes(spec, path)
    return spec


def _compiled(path: Path) -> tuple[mujoco.MjModel, Array]:
    """The model, and where each body's frame is (B, 4, 4) at zero joints, relative to the joint frame it turns with."""
    spec = read_arm_spec(path)
    try:
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise FileFormatError(f"{path}: not readable as URDF or MJCF ({error})") from error
    origins = np.tile(np.eye(4), (model.nbody, 1, 1))
    for body in range(1, model.nbody):
        start, count = model.body_jntadr[body], model.body_jntnum[body]
        if count:
            origins[body, :3, 3] = -model.jnt_pos[start + count - 1]
        else:
            origins[body] = origins[model.body_parentid[body]] @ make_transform(
                _rotation(model.body_quat[body]), model.body_pos[body]
            )
    return model, origins


def _keep_readable_meshes(spec: mujoco.MjSpec, path: Path) -> None:
    """Point meshes of ROS packages to their files; drop those that are not there or that MuJoCo has no reader for."""
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        file = _mesh_file(mesh.file, path, spec.meshdir)
        if file is not None and file.suffix.lower() in (".stl", ".obj", ".msh"):
            mesh.file = str(file)
            continue
        for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
            spec.delete(geom)
        spec.delete(mesh)
    # Looks don't matter, and textures are files too.
    for geom in spec.geoms:
        geom.material = ""
    for thing in (*spec.materials, *spec.textures):
        spec.delete(thing)


def _mesh_file(name: str, path: Path, folder: str) -> Path | None:
    """Find ``package://PACKAGE/rest`` in a folder PACKAGE above the model file, other names in its mesh folder."""
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        places = [folder / rest for folder in path.resolve().parents if folder.name == package]
    else:
        places = [path.resolve().parent / folder / name]
    return next((place for place in places if place.is_file()), None)


def _chain(model: mujoco.MjModel, flange: str, path: Path) -> list[int]:
    """Bodies from the first below the world to the flange."""
    names = [model.body(index).name for index in range(model.nbody)]
    if flange not in names:
        raise FileFormatError(
            f"{path}: no body '{flange}'; there are {', '.join(name for name in names[1:])}"
        )
    body = names.index(flange)
    chain = []
    while body:
        chain.append(body)
        body = int(model.body_parentid[body])
    return chain[::-1]


def _require_revolute(model: mujoco.MjModel, joint: int, path: Path) -> None:
    import mujoco

    name = model.joint(joint).name
    if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
        raise FileFormatError(
            f"{path}: joint '{name}' does not turn about one axis; only such joints are known"
        )
    if not model.jnt_limited[joint]:
        raise FileFormatError(f"{path}: joint '{name}' has no limits; write them into the model")


def _spheres(
    model: mujoco.MjModel, origins: Array, body_link: dict[int, int], joints: int, path: Path
) -> tuple[tuple[Array, Array], ...]:
    """Spheres of the foot and each link, in the joint's frame; what hangs on a body of the chain turns with it."""
    points: list[list[tuple[Array, float]]] = [[] for _ in range(joints + 1)]
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]) or body not in body_link:
            continue
        found = surface_points(model, geom)
        if found is not None:
            local, radius = found
            T = origins[body] @ make_transform(_rotation(model.geom_quat[geom]), model.geom_pos[geom])
            points[body_link[body]].append((local @ T[:3, :3].T + T[:3, 3], radius))
    if not any(points[1:]):
        raise FileFormatError(
            f"{path}: none of the links has a collision geometry that can be read (STL, OBJ, or simple solids), so nobody "
            "would know what the arm runs into"
        )
    return tuple(spheres_of_points(link) for link in points)


def _rotation(quaternion: Array) -> Array:
    """Rotation (3, 3) of MuJoCo's scalar-first quaternion."""
    return rotation_from_quaternion(np.roll(quaternion, -1))
