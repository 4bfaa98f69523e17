"""Boxes, rods and painted materials: the few shapes that scenery is made of."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim.layers import SCENERY, TOUCHES_NOTHING
from punnet.sim.mesh_assets import MeshAsset, add_texture_asset
from punnet.sim.orientation import mujoco_quaternion

__all__ = ["Point", "add_box", "add_card", "add_mesh_geom", "add_painted_material", "add_rod"]

Point = tuple[float, float, float]


def add_painted_material(
    spec: mujoco.MjSpec,
    name: str,
    image: NDArray[np.uint8],
    *,
    repeat: tuple[float, float] | None = None,
    specular: float = 0.0,
    shininess: float = 0.0,
    emission: float = 0.0,
) -> None:
    """Add a material of a texture that covers each face once, or repeats ``repeat`` times a metre."""
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = add_texture_asset(spec, f"{name}_texture", image)
    spec.add_material(
        name=name,
        textures=textures,
        texrepeat=repeat or (1.0, 1.0),
        texuniform=repeat is not None,
        specular=specular,
        shininess=shininess,
        emission=emission,
    )


def add_box(
    spec: mujoco.MjSpec,
    name: str,
    low: Point,
    high: Point,
    material: str,
    layer: tuple[int, int] = TOUCHES_NOTHING,
) -> None:
    """Add a box between two corners, metres."""
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(np.array(high) - low) / 2.0,
        pos=(np.array(high) + low) / 2.0,
        material=material,
        contype=layer[0],
        conaffinity=layer[1],
        group=SCENERY,
    )


def add_rod(
    spec: mujoco.MjSpec,
    name: str,
    start: Point,
    end: Point,
    radius: float,
    material: str,
    layer: tuple[int, int] = TOUCHES_NOTHING,
) -> None:
    """Add a round rod from ``start`` to ``end``, metres."""
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(*start, *end),
        size=(radius, 0.0, 0.0),
        material=material,
        contype=layer[0],
        conaffinity=layer[1],
        group=SCENERY,
    )


def add_card(
    spec: mujoco.MjSpec,
    name: str,
    centre: Point,
    half: tuple[float, float],
    right: Point,
    up: Point,
    material: str,
) -> None:
    """Add a picture of ``half`` width and height at ``centre``, upright along ``up``, facing right × up."""
    axes = np.stack((right, up, np.cross(right, up)), axis=1)
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(*half, 0.0008),
        pos=centre,
        quat=mujoco_quaternion(axes),
        material=material,
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=SCENERY,
    )


def add_mesh_geom(spec: mujoco.MjSpec, name: str, asset: MeshAsset, position: Point) -> None:
    """Add a mesh that is only seen."""
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=asset.mesh,
        material=asset.material,
        pos=position,
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=SCENERY,
    )
