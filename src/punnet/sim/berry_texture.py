"""Skin of a strawberry: flesh colour by ripeness, achenes in spiral order in their dimples, baked sheen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from punnet.sim.berry_shape import BerryShape
from punnet.sim.noise import tiling_noise

__all__ = ["TEXTURE_SIZE", "Skin", "paint_berry"]

TEXTURE_SIZE = 256
_SHAPE = (TEXTURE_SIZE, TEXTURE_SIZE)
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Skin:
    """What a berry's skin looks like.

    Parameters
    ----------
    pale, flesh, achene
        Colours (RGB 0–255) of the flesh before and after reddening, and of the achenes.
    red
        How far up from the tip the skin is red, 0 to 1.
    gloss
        Strength of the small painted reflections.
    dimple
        How much darker the dimples of the achenes are.
    sunny
        How much further the red reaches on the sunny side, in berry lengths.
    rot
        Share of the skin under brown rot and grey mould.
    """

    pale: _Colour
    flesh: _Colour
    achene: _Colour
    red: float
    gloss: float
    dimple: float
    sunny: float
    rot: float = 0.0


def paint_berry(rng: np.random.Generator, shape: BerryShape, scale: float, skin: Skin) -> NDArray[np.uint8]:
    """Paint the texture (256, 256, 3) of :meth:`BerryShape.mesh`: row θ/π from the calyx, column φ/2π.

    Parameters
    ----------
    rng
        Source of randomness.
    shape, scale
        The surface and metres per unit of it: achenes are placed evenly on the real surface.
    skin
        Its colours and marks.
    """
    theta, phi = _texel_angles()
    points = (shape.surface(theta, phi) * scale * 1000.0).astype(np.float32)  # millimetres
    achenes = _locate_achenes(rng, shape, scale, points)
    colour = _flesh_colour(rng, skin, theta, phi)
    colour = _dimpled(colour, achenes, skin)
    colour = _with_glints(rng, colour, achenes, skin, theta)
    colour = _with_achenes(rng, colour, achenes, skin)
    if skin.rot > 0:
        colour = _with_rot(rng, colour, skin.rot)
    return np.asarray(np.clip(colour, 0.0, 255.0), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class _Achenes:
    """Each texel (H, W): its achene's index and how far, how far below and beside it, mm; their spacing."""

    nearest: NDArray[np.int64]
    distance: NDArray[np.float32]
    below: NDArray[np.float32]
    beside: NDArray[np.float32]
    spacing: float

    @property
    def count(self) -> int:
        return int(self.nearest.max()) + 1


def _texel_angles() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Polar angles (H, 1) and azimuths (1, W) of the texels' centres."""
    centres = (np.arange(TEXTURE_SIZE) + 0.5) / TEXTURE_SIZE
    return np.pi * centres[:, None], 2.0 * np.pi * centres[None, :]


def _place_achenes(
    rng: np.random.Generator, shape: BerryShape, scale: float
) -> tuple[NDArray[np.float64], float]:
    """Place achenes (A, 3), mm, on a golden-angle spiral, one an equal share of area; and their spacing."""
    theta = np.linspace(0.0, np.pi, 400)
    ring = shape.surface(theta[:, None], np.linspace(0, 2 * np.pi, 8, endpoint=False)[None]) * scale * 1000.0
    radius = np.linalg.norm(ring[..., :2] - ring[..., :2].mean(axis=1, keepdims=True), axis=-1).mean(axis=1)
    steps = np.linalg.norm(np.diff(ring, axis=0), axis=-1).mean(axis=1)
    area = np.concatenate(([0.0], np.cumsum(steps * 2.0 * np.pi * (radius[1:] + radius[:-1]) / 2.0)))
    count = int(rng.uniform(150, 210))
    shares = (np.arange(count) + 0.5) / count
    seed_theta = np.interp(0.03 + 0.97 * shares, area / area[-1], theta)
    seed_phi = (np.arange(count) * _GOLDEN_ANGLE + rng.normal(0.0, 0.06, count)) % (2.0 * np.pi)
    return shape.surface(seed_theta, seed_phi) * scale * 1000.0, float(np.sqrt(area[-1] / count))


def _locate_achenes(
    rng: np.random.Generator, shape: BerryShape, scale: float, points: NDArray[np.float32]
) -> _Achenes:
    """Place achenes and find every texel's own.

    The nearest achene is looked up for blocks of 2 × 2 texels: what is painted fades out between achenes.
    """
    seeds, spacing = _place_achenes(rng, shape, scale)
    blocks = (points[::2, ::2] + points[1::2, 1::2]) / 2.0
    _, found = cKDTree(seeds).query(blocks.reshape(-1, 3))
    nearest = found.reshape(blocks.shape[:2]).repeat(2, axis=0).repeat(2, axis=1)
    meridian = np.gradient(points, axis=0)
    meridian /= np.maximum(np.linalg.norm(meridian, axis=-1, keepdims=True), 1e-9)
    offset = points - seeds.astype(np.float32)[nearest]
    below = np.einsum("ijk,ijk->ij", offset, meridian)
    squared = np.einsum("ijk,ijk->ij", offset, offset)
    beside = np.sqrt(np.clip(squared - below**2, 0.0, None))
    return _Achenes(nearest, np.sqrt(squared), below, beside, spacing)


def _flesh_colour(
    rng: np.random.Generator, skin: Skin, theta: NDArray[np.float64], phi: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Flesh (H, W, 3) in 0–255: red from the tip up and stronger on the sunny side, pale under the calyx."""
    sunny = np.cos(phi - rng.uniform(0.0, 2.0 * np.pi))
    height = (theta / np.pi + skin.sunny * sunny).astype(np.float32) + 0.05 * tiling_noise(rng, _SHAPE, 14.0)
    edge = 1.02 - 1.05 * skin.red
    redness = 1.0 / (1.0 + np.exp((edge - height) / 0.075))
    redness *= min(1.0, skin.red * 4.0) if skin.red < 0.5 else 1.0
    pale, red = (np.array(colour, dtype=np.float32) for colour in (skin.pale, skin.flesh))
    tone = 1.0 + 0.045 * tiling_noise(rng, _SHAPE, 20.0) + 0.025 * tiling_noise(rng, _SHAPE, 4.0)
    return np.asarray((pale + redness[..., None] * (red - pale)) * tone[..., None])


def _dimpled(colour: NDArray[np.float32], achenes: _Achenes, skin: Skin) -> NDArray[np.float32]:
    """Shade the dimples: under light from above, the upper wall is in shade and the lower one catches it."""
    reach = 0.34 * achenes.spacing
    dimple = np.exp(-((achenes.distance / reach) ** 2))
    relief = 1.0 - skin.dimple * dimple + 0.22 * np.clip(achenes.below / reach, -1.0, 1.0) * dimple
    return np.asarray(colour * relief[..., None])


def _with_glints(
    rng: np.random.Generator,
    colour: NDArray[np.float32],
    achenes: _Achenes,
    skin: Skin,
    theta: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Add small reflections of the sky on the swelling below each achene, where the skin looks up."""
    facing_up = (np.clip(np.cos(theta - 0.9), 0.0, 1.0) ** 2).astype(np.float32)
    strength = rng.uniform(0.1, 1.0, achenes.count).astype(np.float32)[achenes.nearest]
    away = ((achenes.below / achenes.spacing - 0.42) / 0.16) ** 2
    away += (achenes.beside / (0.20 * achenes.spacing)) ** 2
    glint = 0.55 * skin.gloss * np.exp(-away) * strength * facing_up
    return np.asarray(colour + glint[..., None] * (np.array((255, 235, 230), dtype=np.float32) - colour))


def _with_achenes(
    rng: np.random.Generator, colour: NDArray[np.float32], achenes: _Achenes, skin: Skin
) -> NDArray[np.float32]:
    """Lay the achenes on: ellipses along the meridian, each of its own tint, lit from above."""
    half_long, half_wide = max(0.19 * achenes.spacing, 0.5), max(0.115 * achenes.spacing, 0.32)
    away = np.sqrt((achenes.below / half_long) ** 2 + (achenes.beside / half_wide) ** 2)
    cover = 1.0 / (1.0 + np.exp(np.clip((away - 1.0) / 0.18, -30.0, 30.0)))
    tint = rng.normal(1.0, 0.12, achenes.count).astype(np.float32)[achenes.nearest]
    tint *= 1.0 - 0.125 * np.clip(achenes.below / half_long, -2.0, 2.0)
    achene = np.array(skin.achene, dtype=np.float32) * tint[..., None]
    return np.asarray(colour + cover[..., None] * (achene - colour))


def _with_rot(rng: np.random.Generator, colour: NDArray[np.float32], share: float) -> NDArray[np.float32]:
    """Lay sunken brown patches over ``share`` of the skin, and grey mould over their middles."""
    patches = tiling_noise(rng, _SHAPE, 26.0) + 0.22 * tiling_noise(rng, _SHAPE, 5.0)
    edge = float(np.quantile(patches, 1.0 - share))
    cover = 1.0 / (1.0 + np.exp(np.clip((edge - patches) / 0.09, -30.0, 30.0)))
    brown = np.array((104.0, 62.0, 38.0), dtype=np.float32) * rng.uniform(0.75, 1.25)
    tone = 1.0 + 0.12 * tiling_noise(rng, _SHAPE, 3.0)
    colour = colour + cover[..., None] * (0.82 * (brown * tone[..., None] - colour))
    fuzz = 1.0 / (1.0 + np.exp(np.clip((edge + rng.uniform(0.25, 0.9) - patches) / 0.12, -30.0, 30.0)))
    grey = (
        np.array((176.0, 172.0, 160.0), dtype=np.float32)
        * (1.0 + 0.16 * tiling_noise(rng, _SHAPE, 1.5))[..., None]
    )
    return np.asarray(colour + fuzz[..., None] * (0.85 * (grey - colour)), dtype=np.float32)
