"""Light under a diffusing sheet, and the quality at which it is rendered."""

from __future__ import annotations

from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

__all__ = ["Light", "add_lights", "add_varied_lights", "set_night", "set_render_quality"]

Light = Literal["day", "lamp"]
"""The sun, through a tunnel's sheet or not; or night, and a lamp beside the camera."""

_PLANT_CENTRE = np.array((0.75, -0.02, 0.78))
_LAMP_DISTANCE = 0.48  # metres at which the lamp gives the light that it is said to give


def add_lights(spec: mujoco.MjSpec, rng: np.random.Generator) -> None:
    """Add a key light with shadows, a cool fill from the side and light that the pale ground throws up."""
    sun = np.array((0.60, 0.585, 0.55)) * rng.uniform(0.88, 1.08)
    across = rng.uniform(-0.45, 0.45)
    lights = (
        ("sun", (0.45 + rng.normal(0.0, 0.1), across, -0.85), sun, 0.6, True),
        ("sky", (0.55, -0.5 * np.sign(across), -0.2), (0.19, 0.20, 0.22), 0.2, False),
        ("ground_bounce", (0.25, 0.0, 0.95), (0.17, 0.16, 0.145), 0.0, False),
    )
    for name, direction, diffuse, specular, shadow in lights:
        towards = np.array(direction) / np.linalg.norm(direction)
        spec.worldbody.add_light(
            name=name,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            # the shadow map is a square about the light's axis: aim it at the plant
            pos=_PLANT_CENTRE - 2.0 * towards,
            dir=towards,
            diffuse=diffuse,
            ambient=(0.0, 0.0, 0.0),
            specular=(specular, specular, specular),
            castshadow=shadow,
        )
    spec.visual.headlight.ambient = (0.38, 0.39, 0.40)
    spec.visual.headlight.diffuse = (0.08, 0.08, 0.08)
    spec.visual.headlight.specular = (0.05, 0.05, 0.05)


def set_render_quality(spec: mujoco.MjSpec) -> None:
    """Set shadows, anti-aliasing and a fixed extent, so that distant scenery does not coarsen shadows."""
    spec.stat.extent = 1.0
    spec.stat.center = (0.6, 0.0, 0.8)
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 30.0
    spec.visual.map.shadowclip = 1.0
    spec.visual.quality.shadowsize = 1024
    spec.visual.quality.offsamples = 4
    # stems and pipes are a few pixels wide: at MuJoCo's default 28 × 16 they would be most of the triangles
    spec.visual.quality.numslices = 10
    spec.visual.quality.numstacks = 6
    spec.add_texture(
        name="tunnel_sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.95),
        rgb2=(0.74, 0.74, 0.71),
        width=32,
        height=32,
    )


def add_varied_lights(spec: mujoco.MjSpec, rng: np.random.Generator, target: NDArray[np.float64]) -> None:
    """Add light from anywhere above, hard or soft, of any daylight's colour, aimed at ``target`` (3,).

    The sum of the key light and the light from all sides stays about the same, so that pictures are
    neither black nor burnt before the camera has set its exposure.
    """
    hard = rng.uniform(0.1, 0.9)
    azimuth, height = rng.uniform(-2.2, 2.2), rng.uniform(0.35, 1.45)
    towards = -np.array((-np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)))
    warmth = rng.normal(0.0, 0.06)
    tint = np.array((1.0 + warmth, 1.0, 1.0 - warmth))
    sun = tint * (0.28 + 0.46 * hard)
    spec.worldbody.add_light(
        name="key",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=target - 2.0 * towards,
        dir=towards,
        diffuse=sun,
        ambient=(0.0, 0.0, 0.0),
        specular=np.full(3, rng.uniform(0.1, 0.9)),
        castshadow=bool(rng.random() < 0.75),
    )
    sideways = np.array((rng.uniform(0.1, 1.0), rng.normal(0.0, 0.8), rng.uniform(-0.6, 0.9)))
    fill = rng.uniform(0.06, 0.26)
    spec.worldbody.add_light(
        name="fill",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=target - 2.0 * sideways,
        dir=sideways / np.linalg.norm(sideways),
        diffuse=fill * np.array((1.0 - 0.5 * warmth, 1.0, 1.0 + 0.5 * warmth)),
        ambient=(0.0, 0.0, 0.0),
        specular=np.full(3, rng.uniform(0.0, 0.3)),
        castshadow=False,
    )
    ambient = 0.52 - 0.30 * hard + rng.normal(0.0, 0.03)
    spec.visual.headlight.ambient = ambient * np.array((1.0 - 0.6 * warmth, 1.0, 1.0 + 0.6 * warmth))
    flash = rng.uniform(0.0, 0.14)
    spec.visual.headlight.diffuse = (flash, flash, flash)
    spec.visual.headlight.specular = (0.5 * flash, 0.5 * flash, 0.5 * flash)


def set_night(spec: mujoco.MjSpec, rng: np.random.Generator, camera: mujoco.MjsBody) -> None:
    """Put out the day, and mount a lamp on ``camera``, a body with the flange's frame that carries the camera.

    What is left of the day is a faint glow. The lamp is two bars of light above the camera; its light falls with
    the square of the distance, so that the plant is bright and the rows behind it dark.
    """
    for light in spec.lights:
        light.diffuse = light.specular = (0.0, 0.0, 0.0)
        light.castshadow = False
    glow = 0.05 * rng.uniform(0.6, 1.4)
    spec.visual.headlight.ambient = (glow, glow, 1.15 * glow)
    spec.visual.headlight.diffuse = spec.visual.headlight.specular = (0.0, 0.0, 0.0)
    for material in spec.materials:
        material.emission = 0.0
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1, texture.rgb2 = (0.012, 0.013, 0.018), (0.004, 0.004, 0.005)
    colour = np.array((1.0, 0.97, 0.90)) * rng.uniform(0.75, 1.05)
    for name, side in (("left", -1.0), ("right", 1.0)):
        camera.add_light(
            name=f"lamp_{name}",
            type=mujoco.mjtLightType.mjLIGHT_SPOT,
            pos=(0.11, 0.05 * side, 0.03),
            dir=(-0.12, 0.0, 1.0),
            diffuse=0.62 * colour,
            ambient=(0.0, 0.0, 0.0),
            specular=0.5 * colour,
            attenuation=(0.0, 0.0, 1.0 / _LAMP_DISTANCE**2),
            cutoff=60.0,
            exponent=2.0,
            castshadow=True,
        )
