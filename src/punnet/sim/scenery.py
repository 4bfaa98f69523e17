"""What surrounds the plant: table-top gutter, growing bags, irrigation, gravel, the next rows, the tunnel, light."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from punnet.sim.distant_row import bag_mesh, row_mesh, row_texture
from punnet.sim.layers import SCENERY, STRUCTURE, TOUCHES_NOTHING
from punnet.sim.mesh_assets import add_mesh_asset, add_texture_asset
from punnet.sim.scenery_textures import paint_backdrop, paint_bag, paint_gravel, paint_tape, paint_zinc

__all__ = ["SceneryLayout", "add_scenery"]


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
    next_rows: tuple[float, ...] = (2.5, 4.1)

    @property
    def centre(self) -> float:
        """x of the gutter's middle."""
        return self.front + self.width / 2.0


def add_scenery(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout | None = None) -> None:
    """Add scenery and light to ``spec`` and set the quality of its rendering.

    The gutter, its bags and its leg are solid (layer ``STRUCTURE``); everything else is only seen.
    """
    layout = layout or SceneryLayout()
    _add_materials(spec, rng)
    _add_gutter(spec, rng, layout)
    _add_irrigation(spec, rng, layout)
    _add_surroundings(spec, rng, layout)
    _add_light(spec, rng)
    _set_quality(spec)


def _textured(
    spec: mujoco.MjSpec,
    name: str,
    image: np.ndarray,
    *,
    repeat: tuple[float, float] = (1.0, 1.0),
    **gloss: float,
) -> None:
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = add_texture_asset(spec, f"{name}_texture", image)
    spec.add_material(name=name, textures=textures, texrepeat=repeat, texuniform=True, **gloss)


def _add_materials(spec: mujoco.MjSpec, rng: np.random.Generator) -> None:
    _textured(spec, "gravel", paint_gravel(rng), repeat=(0.55, 0.55), specular=0.0, shininess=0.0)
    _textured(spec, "zinc", paint_zinc(rng), repeat=(2.0, 4.0), specular=0.25, shininess=0.25)
    spec.add_material(name="film", rgba=(0.07, 0.07, 0.075, 1.0), specular=0.4, shininess=0.6)
    spec.add_material(name="pipe", rgba=(0.055, 0.055, 0.06, 1.0), specular=0.3, shininess=0.4)


def _box(
    spec: mujoco.MjSpec,
    name: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    material: str,
    layer: tuple[int, int] = TOUCHES_NOTHING,
) -> None:
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


def _rod(
    spec: mujoco.MjSpec,
    name: str,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    radius: float,
    material: str,
    layer: tuple[int, int] = TOUCHES_NOTHING,
) -> None:
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


def _add_gutter(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    front, back, half = layout.front, layout.front + layout.width, 1.6
    bottom, lip = layout.bottom, layout.lip
    _box(spec, "gutter", (front, -half, bottom), (back, half, lip), "zinc", STRUCTURE)
    groove = bottom + 0.62 * (lip - bottom)
    _box(spec, "gutter_groove", (front - 0.0006, -half, groove), (front, half, groove + 0.004), "film")
    _rod(spec, "gutter_lip", (front, -half, lip), (front, half, lip), 0.004, "zinc")
    leg = rng.uniform(-0.55, 0.45)
    for number, y in enumerate((leg - 1.3, leg, leg + 1.3)):
        _rod(
            spec,
            f"leg{number}",
            (layout.centre, y, layout.ground),
            (layout.centre, y, bottom),
            0.021,
            "zinc",
            STRUCTURE,
        )
    bag = bag_mesh(rng, 0.98, layout.width * 0.96, layout.bag_height)
    asset = add_mesh_asset(spec, "bag", bag, paint_bag(rng), specular=0.5, shininess=0.5)
    offset = rng.uniform(-0.4, 0.4)
    for number in range(-1, 2):
        spec.worldbody.add_geom(
            name=f"bag{number + 1}",
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=asset.mesh,
            material=asset.material,
            pos=(layout.centre, offset + number, lip - 0.004),
            contype=TOUCHES_NOTHING[0],
            conaffinity=TOUCHES_NOTHING[1],
            group=SCENERY,
        )
    spec.worldbody.add_geom(
        name="bags",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(layout.width * 0.45, half, layout.bag_height / 2),
        pos=(layout.centre, 0.0, lip + layout.bag_height / 2),
        contype=STRUCTURE[0],
        conaffinity=STRUCTURE[1],
        rgba=(0.0, 0.0, 0.0, 0.0),
        group=3,
    )
    _add_tape(spec, rng, layout)


def _add_tape(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    """Woven tape along the bags' upper front edge, over which the trusses hang."""
    _textured(spec, "tape", paint_tape(rng), repeat=(0.0, 0.0), specular=0.05, shininess=0.1)
    tape = spec.material("tape")
    tape.texuniform = False
    tape.texrepeat = (8.0, 1.0)
    spec.worldbody.add_geom(
        name="tape",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(1.6, 0.016, 0.0008),
        pos=(layout.front + 0.004, 0.0, layout.lip + layout.bag_height - 0.012),
        # x of the box along y of the world, its face tilted towards the aisle
        quat=_tape_quaternion(),
        material="tape",
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=SCENERY,
    )


def _tape_quaternion() -> np.ndarray:
    along, up = np.array([0.0, -1.0, 0.0]), np.array([0.42, 0.0, 0.91])
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.stack((along, up, np.cross(along, up)), axis=1).ravel())
    return quaternion


def _add_irrigation(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    """A main pipe that sags below the gutter and thin drip lines that loop down from it."""
    knots = np.linspace(-1.6, 1.6, 9)
    sag = layout.bottom - 0.02 - 0.018 * np.abs(np.sin(knots * 2.1 + rng.uniform(0.0, 3.0)))
    x = layout.centre - 0.02
    for number in range(len(knots) - 1):
        _rod(
            spec,
            f"pipe{number}",
            (x, knots[number], sag[number]),
            (x, knots[number + 1], sag[number + 1]),
            0.009,
            "pipe",
        )
    for number in range(2):
        y, width, depth = rng.uniform(-0.45, 0.4), rng.uniform(0.06, 0.12), rng.uniform(0.03, 0.07)
        angles = np.linspace(0.0, np.pi, 6)
        points = [
            (layout.front + 0.03, y - width * np.cos(a), layout.bottom - depth * np.sin(a)) for a in angles
        ]
        for piece in range(len(points) - 1):
            _rod(spec, f"drip{number}_{piece}", points[piece], points[piece + 1], 0.0025, "pipe")


def _add_surroundings(spec: mujoco.MjSpec, rng: np.random.Generator, layout: SceneryLayout) -> None:
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(9.0, 9.0, 1.0),
        pos=(3.0, 0.0, layout.ground),
        material="gravel",
        contype=STRUCTURE[0],
        conaffinity=STRUCTURE[1],
        group=SCENERY,
    )
    row = add_mesh_asset(spec, "next_row", row_mesh(rng, 5.0), row_texture(rng), specular=0.0, shininess=0.0)
    for number, x in enumerate(layout.next_rows):
        _box(spec, f"row{number}_gutter", (x, -5.0, layout.bottom - 0.03), (x + 0.2, 5.0, layout.lip), "zinc")
        _box(
            spec,
            f"row{number}_bags",
            (x + 0.01, -5.0, layout.lip),
            (x + 0.19, 5.0, layout.lip + 0.09),
            "film",
        )
        shift = rng.uniform(-0.6, 0.6)
        for leg in range(-3, 4):
            y = 1.3 * leg + shift
            _rod(
                spec,
                f"row{number}_leg{leg + 3}",
                (x + 0.1, y, layout.ground),
                (x + 0.1, y, layout.bottom),
                0.02,
                "zinc",
            )
        for copy, y in enumerate((-4.9, 0.0, 4.9)):
            spec.worldbody.add_geom(
                name=f"row{number}_plants{copy}",
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=row.mesh,
                material=row.material,
                pos=(x, y + shift, layout.lip + 0.08),
                contype=TOUCHES_NOTHING[0],
                conaffinity=TOUCHES_NOTHING[1],
                group=SCENERY,
            )
    _textured(spec, "backdrop", paint_backdrop(rng), specular=0.0, shininess=0.0, emission=0.35)
    backdrop = spec.material("backdrop")
    backdrop.texuniform = False
    # a box face takes its texture whole; the box stands upright at the end of the tunnel
    spec.worldbody.add_geom(
        name="backdrop",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(9.0, 2.6, 0.01),
        pos=(7.5, 0.0, layout.ground + 2.6),
        quat=_upright_quaternion(),
        material="backdrop",
        contype=TOUCHES_NOTHING[0],
        conaffinity=TOUCHES_NOTHING[1],
        group=SCENERY,
    )


def _upright_quaternion() -> np.ndarray:
    """Box axes: x to the right of someone looking along +x, y up, z towards them."""
    quaternion = np.zeros(4)
    axes = np.stack(((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)), axis=1)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return quaternion


def _add_light(spec: mujoco.MjSpec, rng: np.random.Generator) -> None:
    """Light through a diffusing sheet: one soft-edged key from above, a cool fill from the side, much ambient light."""
    spec.worldbody.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=(0.0, 0.0, 3.0),
        dir=(0.45 + rng.normal(0.0, 0.1), rng.uniform(-0.45, 0.45), -0.85),
        diffuse=np.array((0.62, 0.60, 0.56)) * rng.uniform(0.88, 1.08),
        ambient=(0.0, 0.0, 0.0),
        specular=(0.55, 0.55, 0.55),
        castshadow=True,
    )
    spec.worldbody.add_light(
        name="sky",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=(0.0, 0.0, 3.0),
        dir=(0.55, -0.45 * np.sign(rng.normal()), -0.25),
        diffuse=(0.20, 0.21, 0.23),
        ambient=(0.0, 0.0, 0.0),
        specular=(0.15, 0.15, 0.15),
        castshadow=False,
    )
    spec.visual.headlight.ambient = (0.40, 0.41, 0.42)
    spec.visual.headlight.diffuse = (0.08, 0.08, 0.08)
    spec.visual.headlight.specular = (0.05, 0.05, 0.05)


def _set_quality(spec: mujoco.MjSpec) -> None:
    """A fixed scale, so that distant scenery does not blur the shadows near the plant."""
    spec.stat.extent = 1.0
    spec.stat.center = (0.6, 0.0, 0.8)
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 14.0
    spec.visual.map.shadowclip = 0.8
    spec.visual.quality.shadowsize = 1024
    spec.visual.quality.offsamples = 4
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.95),
        rgb2=(0.75, 0.78, 0.74),
        width=32,
        height=32,
    )
