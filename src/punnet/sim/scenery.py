"""The table-top gutter that the plant grows in, with bags, tape and irrigation, and the tunnel around it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from punnet.sim.distant_row import bag_mesh
from punnet.sim.layers import COLLISION_ONLY, STRUCTURE
from punnet.sim.lighting import add_lights, set_render_quality
from punnet.sim.mesh_assets import add_mesh_asset
from punnet.sim.scenery_textures import paint_bag, paint_tape, paint_zinc
from punnet.sim.solids import add_box, add_card, add_mesh_geom, add_painted_material, add_rod
from punnet.sim.surroundings import add_surroundings

__all__ = ["SceneryLayout", "add_gutter", "add_scenery"]

_HALF_LENGTH = 1.55  # metres of gutter to each side with real bags; beyond, a plain box goes on
_FAR = 12.0


@dataclass(frozen=True)
class SceneryLayout:
    """Where things stand; metres, base frame.

    Parameters
    ----------
    front
        x of the gutter's front face.
    width
        Extent of the gutter along x.
    bottom, lip
        z of the gutter's lower edge and of its lip, where trusses hang over.
    bag_height
        Height of the growing bags above the lip.
    ground
        z of the gravel.
    next_rows
        x of the rows behind.
    """

    front: float = 0.805
    width: float = 0.20
    bottom: float = 0.862
    lip: float = 0.905
    bag_height: float = 0.085
    ground: float = -0.75
    next_rows: tuple[float, ...] = (2.5, 4.1, 5.7, 7.3)

    @property
    def centre(self) -> float:
        """Middle of the gutter, along x."""
        return self.front + self.width / 2.0


def add_scenery(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout | None = None) -> None:
    """Add scenery and light to ``spec`` and set the quality of its rendering.

    Solid (layer ``STRUCTURE``) are the geoms ``gutter``, ``bags``, ``leg0``…``leg2`` and ``ground``;
    everything else is only seen. Light, and where the leg, bags and soil lie, vary with ``rng``.
    """
    layout = layout or SceneryLayout()
    add_gutter(spec, rng, layout)
    add_surroundings(
        spec,
        rng,
        ground=layout.ground,
        gutter=(layout.front, layout.bottom, layout.lip),
        next_rows=layout.next_rows,
    )
    add_lights(spec, rng)
    set_render_quality(spec)


def add_gutter(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    """Add the gutter that the plant grows in, with its legs, bags, tape and irrigation."""
    add_painted_material(spec, "zinc", paint_zinc(rng), repeat=(1.5, 3.0), specular=0.25, shininess=0.25)
    spec.add_material(name="film", rgba=(0.07, 0.07, 0.075, 1.0), specular=0.4, shininess=0.6)
    spec.add_material(name="pipe", rgba=(0.055, 0.055, 0.06, 1.0), specular=0.3, shininess=0.4)
    _add_gutter(spec, rng, layout)
    _add_bags(spec, rng, layout)
    _add_irrigation(spec, rng, layout)


def _add_gutter(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    front, back = layout.front, layout.front + layout.width
    bottom, lip, half = layout.bottom, layout.lip, _HALF_LENGTH
    add_box(spec, "gutter", (front, -half, bottom), (back, half, lip), "zinc", STRUCTURE)
    groove = bottom + 0.62 * (lip - bottom)
    add_box(spec, "gutter_groove", (front - 0.0006, -half, groove), (front, half, groove + 0.003), "pipe")
    add_rod(spec, "gutter_lip", (front, -half, lip), (front, half, lip), 0.004, "zinc")
    for side in (-1, 1):
        low, high = sorted((side * half, side * _FAR))
        add_box(spec, f"gutter_beyond{side}", (front, low, bottom), (back, high, lip), "zinc")
        add_box(
            spec,
            f"bags_beyond{side}",
            (front + 0.01, low, lip),
            (back - 0.01, high, lip + layout.bag_height),
            "film",
        )
    leg = rng.uniform(-0.55, 0.45)
    for number, y in enumerate((leg - 1.3, leg, leg + 1.3)):
        foot, head = (layout.centre, y, layout.ground), (layout.centre, y, bottom)
        add_rod(spec, f"leg{number}", foot, head, 0.021, "zinc", STRUCTURE)


def _add_bags(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    """Add three bags end to end, the solid box they stand for, and the woven tape that trusses hang over."""
    bag = bag_mesh(rng, 0.98, layout.width * 0.96, layout.bag_height)
    asset = add_mesh_asset(spec, "bag", bag, paint_bag(rng), specular=0.5, shininess=0.5)
    offset = float(rng.uniform(-0.4, 0.4))
    for number in (-1, 0, 1):
        add_mesh_geom(spec, f"bag{number + 1}", asset, (layout.centre, offset + number, layout.lip - 0.004))
    spec.worldbody.add_geom(
        name="bags",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(layout.width * 0.45, _HALF_LENGTH, layout.bag_height / 2),
        pos=(layout.centre, 0.0, layout.lip + layout.bag_height / 2),
        contype=STRUCTURE[0],
        conaffinity=STRUCTURE[1],
        group=COLLISION_ONLY,
    )
    add_painted_material(spec, "tape", paint_tape(rng), repeat=(2.5, 31.25), specular=0.05, shininess=0.1)
    middle = (layout.front + 0.004, 0.0, layout.lip + layout.bag_height - 0.012)
    tilt = (0.42, 0.0, 0.91)
    add_card(spec, "tape", middle, (_HALF_LENGTH, 0.016), (0.0, -1.0, 0.0), tilt, "tape")


def _add_irrigation(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    """Add a main pipe that sags below the gutter, and thin drip lines that loop down from it."""
    knots = np.linspace(-_HALF_LENGTH, _HALF_LENGTH, 9)
    height = layout.bottom - 0.02 - 0.018 * np.abs(np.sin(knots * 2.1 + rng.uniform(0.0, 3.0)))
    x = layout.centre - 0.02
    pipe = [(x, float(y), float(z)) for y, z in zip(knots, height, strict=True)]
    for number, (start, end) in enumerate(pairwise(pipe)):
        add_rod(spec, f"pipe{number}", start, end, 0.009, "pipe")
    angles = np.linspace(0.0, np.pi, 7)
    for line in range(2):
        y, width, depth = rng.uniform(-0.45, 0.4), rng.uniform(0.06, 0.12), rng.uniform(0.03, 0.07)
        loop = [
            (layout.front + 0.03, float(y - width * np.cos(a)), float(layout.bottom - depth * np.sin(a)))
            for a in angles
        ]
        for piece, (start, end) in enumerate(pairwise(loop)):
            add_rod(spec, f"drip{line}_{piece}", start, end, 0.0022, "pipe")
