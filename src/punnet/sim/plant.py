"""Write a grown cluster into the world: trusses, berries on their stems, leaves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import rotation_from_vector
from punnet.sim.blossom import add_blossom
from punnet.sim.calyx import calyx_texture, make_calyx
from punnet.sim.cluster import STUB_LENGTH, Cluster, HangingBerry
from punnet.sim.foliage import Leaf, make_leaf
from punnet.sim.gloss import BERRY_GLOSS, CALYX_GLOSS, LEAF_GLOSS, STEM_GLOSS
from punnet.sim.layers import BERRY, COLLISION_ONLY, PLANT_VISUAL, SOFT_PLANT, TOUCHES_NOTHING
from punnet.sim.mesh import Mesh
from punnet.sim.mesh_assets import MeshAsset, add_mesh_asset
from punnet.sim.orientation import mujoco_quaternion
from punnet.sim.truss import add_truss

__all__ = [
    "STUB_PIECES",
    "PlantedBerry",
    "add_cluster",
    "add_drawn_mesh",
    "add_leaves",
    "add_petiole",
    "leaf_pose",
]

STUB_PIECES = 6
"""The stub is drawn and touched in this many pieces, so that a cut shows where it went through."""

_STEM_MATERIAL = "stem"
_LEAF_VARIANTS = 8
# About 1 N/mm for a berry of 20 g; see BRUISING_FORCE.
_FRUIT_CONTACT = (0.006, 1.0)


@dataclass(frozen=True)
class PlantedBerry:
    """Names under which a berry stands in the model."""

    index: int
    body: str
    fruit: str
    weld: str
    stub: tuple[str, ...]


def add_cluster(spec: mujoco.MjSpec, rng: np.random.Generator, cluster: Cluster) -> list[PlantedBerry]:
    """Add every truss and berry of ``cluster``; one entry a berry, by index."""
    spec.add_material(name=_STEM_MATERIAL, rgba=(0.50, 0.60, 0.29, 1.0), **STEM_GLOSS)
    planted = []
    for number, hanging in enumerate(cluster.trusses):
        loads = tuple((berry.berry.mass / 1000.0, berry.centre) for berry in hanging.berries)
        links = add_truss(spec, f"truss{number}", hanging.truss, loads, _STEM_MATERIAL)
        for tip, berry in zip(hanging.truss.tips, hanging.berries, strict=True):
            planted.append(_add_berry(spec, rng, berry, links[tip], hanging.truss.links[tip].radius))
    return planted


def _add_berry(
    spec: mujoco.MjSpec, rng: np.random.Generator, hanging: HangingBerry, link: str, stem_radius: float
) -> PlantedBerry:
    name = f"berry{hanging.index}"
    fruit = hanging.berry
    T = hanging.T_base_berry
    body = spec.worldbody.add_body(name=name, pos=T[:3, 3], quat=mujoco_quaternion(T[:3, :3]))
    # Air and the plant's own tissue take the spin out of a berry; the armature keeps small ones stable at this time step.
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_FREE, damping=1e-4, armature=1e-5)
    skin = add_mesh_asset(spec, name, fruit.mesh, fruit.texture, **BERRY_GLOSS)
    add_drawn_mesh(body, f"{name}_skin", skin)
    calyx = make_calyx(rng, fruit.width, size=fruit.calyx_size)
    add_drawn_mesh(
        body,
        f"{name}_calyx",
        add_mesh_asset(spec, f"{name}_calyx", calyx, calyx_texture(rng), **CALYX_GLOSS),
    )
    body.add_geom(
        name=f"{name}_fruit",
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=fruit.semi_axes,
        pos=fruit.centre,
        mass=fruit.mass / 1000.0,
        contype=BERRY[0],
        conaffinity=BERRY[1],
        group=COLLISION_ONLY,
        friction=(0.6, 0.01, 0.002),
        solref=_FRUIT_CONTACT,
        condim=6,
    )
    stub = _add_stub(body, name, stem_radius)
    weld = spec.add_equality(
        name=f"{name}_attached",
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1=link,
        name2=name,
        solref=(0.01, 1.0),
    )
    weld.data[:3] = (0.0, 0.0, STUB_LENGTH)  # anchored where the stub meets the truss
    weld.data[10] = 0.02  # torque scale: a thin stem pulls much harder than it bends
    return PlantedBerry(hanging.index, name, f"{name}_fruit", f"{name}_attached", stub)


def add_drawn_mesh(body: mujoco.MjsBody, name: str, asset: MeshAsset) -> None:
    """Draw a mesh on ``body``; nothing touches it."""
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=asset.mesh,
        material=asset.material,
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=PLANT_VISUAL,
        mass=0.0,
    )


def _add_stub(body: mujoco.MjsBody, name: str, radius: float) -> tuple[str, ...]:
    """The stem just above the calyx, from the berry's origin up, in pieces."""
    edges = np.linspace(0.0, STUB_LENGTH, STUB_PIECES + 1)
    names = []
    for piece, (low, high) in enumerate(pairwise(edges)):
        geom = body.add_geom(
            name=f"{name}_stub{piece}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(0.0, 0.0, low, 0.0, 0.0, high),
            size=(radius, 0.0, 0.0),
            mass=2e-5,
            contype=SOFT_PLANT[0],
            conaffinity=SOFT_PLANT[1],
            group=PLANT_VISUAL,
            material=_STEM_MATERIAL,
            friction=(1.5, 0.02, 0.002),
            solref=(0.006, 1.0),
            condim=4,
        )
        names.append(geom.name)
    return tuple(names)


def add_leaves(
    spec: mujoco.MjSpec, rng: np.random.Generator, cluster: Cluster
) -> list[list[tuple[MeshAsset, float]]]:
    """A canopy of leaves above the gutter, rigid, and some that hang among the trusses and give way when touched.

    Returns
    -------
    list
        The leaves that there are to choose from, each in several (asset, size in metres).
    """
    variants = []
    for number in range(_LEAF_VARIANTS):
        leaf = make_leaf(rng, 1.0)
        variants.append((leaf, _leaf_assets(spec, number, leaf)))
    config = cluster.config
    for number in range(int(rng.integers(config.canopy_leaves[0], config.canopy_leaves[1], endpoint=True))):
        _add_canopy_leaf(spec, rng, f"canopy{number}", variants[rng.integers(len(variants))][1])
    for number in range(int(rng.integers(config.hanging_leaves[0], config.hanging_leaves[1], endpoint=True))):
        _add_hanging_leaf(spec, rng, f"hanging{number}", variants[rng.integers(len(variants))][1])
    if config.veils[1] > 0:
        _add_veils(spec, rng, cluster, [sizes for _, sizes in variants])
    add_blossom(spec, rng, int(rng.integers(2, 6)))
    return [sizes for _, sizes in variants]


_LEAF_SIZES = (0.055, 0.072, 0.09)


def _leaf_assets(spec: mujoco.MjSpec, number: int, leaf: Leaf) -> list[tuple[MeshAsset, float]]:
    """Each variant in three sizes (a mesh can't be scaled where it is used)."""
    assets: list[tuple[MeshAsset, float]] = []
    for which, size in enumerate(_LEAF_SIZES):
        scaled = Mesh(leaf.mesh.vertices * size, leaf.mesh.faces, leaf.mesh.uv)
        name = f"leaf{number}_{which}"
        look = leaf.texture if which == 0 else assets[0][0].material
        assets.append((add_mesh_asset(spec, name, scaled, look, **LEAF_GLOSS), size))
    return assets


def _add_canopy_leaf(
    spec: mujoco.MjSpec, rng: np.random.Generator, name: str, sizes: list[tuple[MeshAsset, float]]
) -> None:
    crown = np.array([rng.uniform(0.86, 0.93), rng.uniform(-0.5, 0.45), 0.985])
    azimuth = rng.uniform(0.0, 2.0 * np.pi)
    reach = rng.uniform(0.05, 0.17)
    tip = crown + np.array([np.cos(azimuth) * reach, np.sin(azimuth) * reach, rng.uniform(0.03, 0.20)])
    asset, _ = sizes[rng.integers(len(sizes))]
    add_petiole(spec.worldbody, name, crown, tip)
    pose = leaf_pose(azimuth, droop=rng.uniform(-0.1, 0.9), roll=rng.normal(0.0, 0.35))
    body = spec.worldbody.add_body(name=name, pos=tip, quat=mujoco_quaternion(pose))
    add_drawn_mesh(body, name, asset)


def _add_hanging_leaf(
    spec: mujoco.MjSpec, rng: np.random.Generator, name: str, sizes: list[tuple[MeshAsset, float]]
) -> None:
    lip = np.array([0.80, rng.uniform(-0.33, 0.28), rng.uniform(0.905, 0.93)])
    azimuth = np.pi + rng.normal(0.0, 0.7)
    tip = lip + np.array([rng.uniform(-0.05, 0.02), rng.normal(0.0, 0.03), -rng.uniform(0.01, 0.11)])
    leaf = sizes[rng.integers(len(sizes))]
    pose = leaf_pose(azimuth, droop=rng.uniform(0.7, 1.4), roll=rng.normal(0.0, 0.4))
    _add_yielding_leaf(spec, name, leaf, lip, tip, pose)


def _add_veils(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    cluster: Cluster,
    variants: list[list[tuple[MeshAsset, float]]],
) -> None:
    """Leaves that hang between berries and the robot, the blade over an upper corner of the fruit."""
    ripe = [berry for berry in cluster.berries if berry.berry.stage.pluckable]
    others = [berry for berry in cluster.berries if not berry.berry.stage.pluckable]
    hidden = [group[i] for group in (ripe, others) for i in rng.permutation(len(group))]
    count = int(rng.integers(cluster.config.veils[0], cluster.config.veils[1], endpoint=True))
    for number, berry in enumerate(hidden[:count]):
        sizes = variants[rng.integers(len(variants))]
        asset, size = sizes[rng.integers(len(sizes))]
        aside = rng.choice((-1.0, 1.0)) * rng.uniform(0.012, 0.034)
        above = size * rng.uniform(0.7, 1.2)
        tip = berry.centre + np.array([-berry.radius - rng.uniform(0.006, 0.03), aside, above])
        lip = np.array([0.80, tip[1] + rng.normal(0.0, 0.05), rng.uniform(0.905, 0.93)])
        pose = leaf_pose(np.pi + rng.normal(0.0, 0.5), droop=rng.uniform(1.1, 1.5), roll=rng.normal(0.0, 0.3))
        _add_yielding_leaf(spec, f"veil{number}", (asset, size), lip, tip, pose)


def _add_yielding_leaf(
    spec: mujoco.MjSpec,
    name: str,
    leaf: tuple[MeshAsset, float],
    root: NDArray[np.float64],
    tip: NDArray[np.float64],
    pose: NDArray[np.float64],
) -> None:
    """A leaf (asset, size in metres) on a stalk from ``root`` to ``tip`` that gives way when touched."""
    asset, size = leaf
    add_petiole(spec.worldbody, name, root, tip)
    body = spec.worldbody.add_body(name=name, pos=tip, quat=mujoco_quaternion(pose))
    for label, axis in (("pitch", (0.0, 1.0, 0.0)), ("roll", (1.0, 0.0, 0.0))):
        body.add_joint(
            name=f"{name}_{label}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            stiffness=0.004,
            damping=0.0006,
            armature=2e-6,
        )
    add_drawn_mesh(body, name, asset)
    body.add_geom(
        name=f"{name}_touch",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(size * 0.5, size * 0.42, 0.0008),
        pos=(size * 0.55, 0.0, 0.0),
        mass=0.0012,
        contype=SOFT_PLANT[0],
        conaffinity=SOFT_PLANT[1],
        group=COLLISION_ONLY,
        friction=(0.3, 0.01, 0.001),
        solref=(0.02, 1.0),
    )


def add_petiole(
    parent: mujoco.MjsBody, name: str, start: NDArray[np.float64], end: NDArray[np.float64]
) -> None:
    """Draw a leaf's stalk between two points (3,)."""
    parent.add_geom(
        name=f"{name}_petiole",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=(*start, *end),
        size=(0.0014, 0.0, 0.0),
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=PLANT_VISUAL,
        material=_STEM_MATERIAL,
        mass=0.0,
    )


def leaf_pose(azimuth: float, *, droop: float, roll: float) -> NDArray[np.float64]:
    """Rotation of a leaf (x along it, z its upper face) that points to ``azimuth`` and hangs by ``droop`` radians."""
    return np.asarray(
        rotation_from_vector((0.0, 0.0, azimuth))
        @ rotation_from_vector((0.0, droop, 0.0))
        @ rotation_from_vector((roll, 0.0, 0.0))
    )
