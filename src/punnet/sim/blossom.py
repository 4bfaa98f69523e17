"""Flowers on bent stems among the trusses; they are only seen, and give way to nothing."""

from __future__ import annotations

from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import rotation_from_vector
from punnet.sim.flower import make_flower
from punnet.sim.gloss import FLOWER_GLOSS, STEM_GLOSS
from punnet.sim.layers import PLANT_VISUAL, TOUCHES_NOTHING
from punnet.sim.mesh_assets import MeshAsset, add_mesh_asset
from punnet.sim.orientation import mujoco_quaternion

__all__ = ["add_blossom"]

_VARIANTS = 2
_STEM_RADIUS = 0.0008
_PIECES = 5


def add_blossom(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    count: int,
    *,
    front: float = 0.80,
    across: tuple[float, float] = (-0.30, 0.24),
    lip: float = 0.91,
) -> None:
    """Add ``count`` flowers that lean over the gutter's lip.

    Parameters
    ----------
    spec, rng
        What to add to, and the source of randomness.
    count
        How many flowers.
    front, lip
        x and z (metres, base frame) where their stems leave the gutter.
    across
        Range of y in which they do.
    """
    if count < 1:
        return
    spec.add_material(name="flower_stem", rgba=(0.50, 0.60, 0.30, 1.0), **STEM_GLOSS)
    flowers = [make_flower(rng) for _ in range(_VARIANTS)]
    assets = [
        add_mesh_asset(spec, f"flower{number}", flower.mesh, flower.texture, **FLOWER_GLOSS)
        for number, flower in enumerate(flowers)
    ]
    for number in range(count):
        start = np.array((front, rng.uniform(*across), lip))
        curve = _stem_curve(rng, start)
        _add_stem(spec, f"blossom{number}", curve)
        _add_head(spec, rng, f"blossom{number}", assets[number % _VARIANTS], curve)


def _stem_curve(rng: np.random.Generator, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (6, 3) of an arch that leaves upwards and outwards and bends over."""
    step = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    outwards = np.array((-rng.uniform(0.015, 0.06), rng.normal(0.0, 0.03), 0.0))
    rise, fall = rng.uniform(0.02, 0.05), rng.uniform(0.05, 0.19)
    height = rise * np.sin(np.pi * np.clip(step * 1.4, 0.0, 1.0)) - fall * step**2
    return np.asarray(start + outwards * np.sqrt(step) + height * np.array((0.0, 0.0, 1.0)))


def _add_stem(spec: mujoco.MjSpec, name: str, curve: NDArray[np.float64]) -> None:
    for number, (start, end) in enumerate(pairwise(curve)):
        spec.worldbody.add_geom(
            name=f"{name}_stem{number}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=(*start, *end),
            size=(_STEM_RADIUS, 0.0, 0.0),
            material="flower_stem",
            contype=TOUCHES_NOTHING[0],
            conaffinity=TOUCHES_NOTHING[1],
            group=PLANT_VISUAL,
            mass=0.0,
        )


def _add_head(
    spec: mujoco.MjSpec, rng: np.random.Generator, name: str, asset: MeshAsset, curve: NDArray[np.float64]
) -> None:
    """Set the flower on its stem, facing the light: up and out of the canopy, whatever the stem does."""
    facing = rotation_from_vector((0.0, -rng.uniform(0.5, 1.5), 0.0))
    turned = rotation_from_vector((0.0, 0.0, rng.normal(0.0, 0.7))) @ facing
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=asset.mesh,
        material=asset.material,
        pos=curve[-1],
        quat=mujoco_quaternion(turned),
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=PLANT_VISUAL,
        mass=0.0,
    )
