"""What lies around the plant's gutter: gravel, soil, the rows behind, the ends of the tunnel."""

from __future__ import annotations

import mujoco
import numpy as np

from punnet.sim.distant_row import row_mesh, row_texture
from punnet.sim.layers import SCENERY, STRUCTURE
from punnet.sim.mesh_assets import MeshAsset, add_mesh_asset
from punnet.sim.scenery_textures import paint_backdrop, paint_gravel, paint_hedge, paint_soil
from punnet.sim.solids import add_box, add_card, add_mesh_geom, add_painted_material, add_rod

__all__ = ["add_surroundings"]

_ROW_LENGTH = 5.0
_REACH = 12.0  # metres to the ends of the tunnel


def add_surroundings(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    *,
    ground: float,
    gutter: tuple[float, float, float],
    next_rows: tuple[float, ...],
) -> None:
    """Add everything beyond the plant.

    Parameters
    ----------
    spec, rng
        What to add to, and the source of randomness.
    ground
        z of the gravel.
    gutter
        x of the front, z of the lower edge and z of the lip of the plant's gutter, as all rows have.
    next_rows
        x of the rows behind.
    """
    _add_ground(spec, rng, ground)
    plants = add_mesh_asset(
        spec, "next_row", row_mesh(rng, _ROW_LENGTH), row_texture(rng), specular=0.0, shininess=0.0
    )
    leaves_only = add_mesh_asset(spec, "own_row", row_mesh(rng, _ROW_LENGTH, berries=0), plants.material)
    add_painted_material(spec, "hedge", paint_hedge(rng), repeat=(0.7, 0.7))
    for side in (-1, 1):  # the plant's own row goes on to both sides, out of the arm's reach
        middle = (gutter[0] + 0.08, side * (0.75 + _ROW_LENGTH / 2), gutter[2] + 0.12)
        add_mesh_geom(spec, f"own_row{side}", leaves_only, middle)
    for number, x in enumerate(next_rows):
        _add_row(spec, rng, f"row{number}", x, ground, gutter, plants if number < 2 else None)
    add_painted_material(spec, "backdrop", paint_backdrop(rng), emission=0.3)
    height = ground + 2.6
    for name, centre, right in (
        ("far_end", (_REACH + 2.0, 0.0, height), (0.0, -1.0, 0.0)),
        ("left_end", (2.0, _REACH, height), (1.0, 0.0, 0.0)),
        ("right_end", (2.0, -_REACH, height), (-1.0, 0.0, 0.0)),
    ):
        add_card(spec, name, centre, (_REACH + 2.0, 2.6), right, (0.0, 0.0, 1.0), "backdrop")


def _add_ground(spec: mujoco.MjSpec, rng: np.random.Generator, ground: float) -> None:
    add_painted_material(spec, "gravel", paint_gravel(rng), repeat=(1.0, 1.0))
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(_REACH + 2.0, _REACH + 2.0, 1.0),
        pos=(2.0, 0.0, ground),
        material="gravel",
        contype=STRUCTURE[0],
        conaffinity=STRUCTURE[1],
        group=SCENERY,
    )
    if (
        rng.random() < 0.5
    ):  # some aisles are gravel from end to end, others leave the soil under the rows bare
        add_painted_material(spec, "soil", paint_soil(rng), repeat=(0.5, 0.5))
        start, depth = rng.uniform(2.0, 3.4), rng.uniform(0.8, 2.2)
        add_box(spec, "soil", (start, -_REACH, ground), (start + depth, _REACH, ground + 0.004), "soil")


def _add_row(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    name: str,
    x: float,
    ground: float,
    gutter: tuple[float, float, float],
    plants: MeshAsset | None,
) -> None:
    """Add a row of plants in its gutter on legs; from afar (``plants`` None) its canopy is one hedge."""
    _, bottom, lip = gutter
    add_box(spec, f"{name}_gutter", (x, -_REACH, bottom - 0.03), (x + 0.2, _REACH, lip), "zinc")
    add_box(spec, f"{name}_bags", (x + 0.01, -_REACH, lip), (x + 0.19, _REACH, lip + 0.09), "film")
    shift = float(rng.uniform(-1.2, 1.2))
    for leg in range(-2, 3):
        y = 2.4 * leg + shift
        add_rod(spec, f"{name}_leg{leg + 2}", (x + 0.1, y, ground), (x + 0.1, y, bottom), 0.02, "zinc")
    add_rod(
        spec,
        f"{name}_pipe",
        (x + 0.05, -_REACH, bottom - 0.07),
        (x + 0.05, _REACH, bottom - 0.09),
        0.012,
        "pipe",
    )
    if plants is None:
        add_box(
            spec, f"{name}_canopy", (x - 0.05, -_REACH, lip + 0.02), (x + 0.25, _REACH, lip + 0.28), "hedge"
        )
        return
    for copy in (-1, 0, 1):
        add_mesh_geom(
            spec, f"{name}_plants{copy + 1}", plants, (x, copy * (_ROW_LENGTH - 0.1) + shift, lip + 0.08)
        )
