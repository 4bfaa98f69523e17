"""Skin of a strawberry: flesh colour by ripeness, achenes in spiral order in their dimples, baked sheen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from punnet.sim.berry_shape import BerryShape

__all__ = ["TEXTURE_SIZE", "paint_berry"]

TEXTURE_SIZE = 256
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_Colour = tuple[float, float, float]


@dataclass(frozen=True)
class _Palette:
    """Colours (RGB 0–255) of one stage: flesh before and after reddening, achenes; ``red`` share and ``gloss``."""

    pale: _Colour
    flesh: _Colour
    achene: _Colour
    red: float
    gloss: float
    dimple: float


_PALETTES = (
    _Palette((190, 196, 112), (190, 196, 112), (206, 172, 74), 0.0, 0.2, 0.34),
    _Palette((226, 216, 158), (226, 216, 158), (196, 140, 70), 0.04, 0.22, 0.30),
    _Palette((240, 208, 142), (222, 50, 32), (220, 160, 78), 0.6, 0.5, 0.28),
    _Palette((232, 110, 64), (214, 20, 24), (228, 168, 70), 0.96, 0.9, 0.32),
    _Palette((150, 18, 22), (112, 6, 16), (176, 120, 54), 1.0, 0.55, 0.30),
)


def paint_berry(rng: np.random.Generator, shape: BerryShape, scale: float, stage: int) -> NDArray[np.uint8]:
    """Texture (256, 256, 3) for the coordinates of :meth:`BerryShape.mesh`: row θ/π from the calyx, column φ/2π.

    Parameters
    ----------
    rng
        Source of randomness.
    shape, scale
        The surface and metres per unit of it: achenes are placed evenly on the real surface.
    stage
        Index of the ripeness stage, 0 green to 4 over-ripe.
    """
    palette = _PALETTES[stage]
    theta, phi = _texel_angles()
    points = shape.surface(theta, phi) * scale * 1000.0  # millimetres
    seeds, spacing = _place_achenes(rng, shape, scale)
    nearest, distance, along = _to_achenes(points, seeds)
    flesh = _flesh_colour(rng, palette, theta, phi)
    return _compose(rng, palette, flesh, nearest, distance, along, spacing, theta)


def _texel_angles() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    centres = (np.arange(TEXTURE_SIZE) + 0.5) / TEXTURE_SIZE
    return np.meshgrid(np.pi * centres, 2.0 * np.pi * centres, indexing="ij")


def _place_achenes(
    rng: np.random.Generator, shape: BerryShape, scale: float
) -> tuple[NDArray[np.float64], float]:
    """Achenes (A, 3) in millimetres in golden-angle spiral order, one for each equal share of area; their spacing."""
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


def _to_achenes(
    points: NDArray[np.float64], seeds: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """For each texel: index of the nearest achene, distance to it, and how far below it (towards the tip), mm."""
    distance, nearest = cKDTree(seeds).query(points.reshape(-1, 3))
    meridian = np.gradient(points, axis=0)
    meridian /= np.maximum(np.linalg.norm(meridian, axis=-1, keepdims=True), 1e-9)
    offset = points - seeds[nearest].reshape(points.shape)
    along = np.einsum("ijk,ijk->ij", offset, meridian)
    return nearest.reshape(points.shape[:2]), distance.reshape(points.shape[:2]), along


def _noise(rng: np.random.Generator, sigma: float) -> NDArray[np.float64]:
    """Smooth noise of unit deviation that closes around the berry."""
    field = gaussian_filter(rng.normal(size=(TEXTURE_SIZE, TEXTURE_SIZE)), sigma, mode=("nearest", "wrap"))
    return np.asarray(field / field.std())


def _flesh_colour(
    rng: np.random.Generator, palette: _Palette, theta: NDArray[np.float64], phi: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Flesh (H, W, 3) in 0–255: red from the tip up and stronger on the sunny side, pale under the calyx."""
    sunny = np.cos(phi - rng.uniform(0.0, 2.0 * np.pi))
    height = theta / np.pi + 0.16 * sunny + 0.05 * _noise(rng, 14.0)
    edge = 1.02 - 1.05 * palette.red
    redness = 1.0 / (1.0 + np.exp(-(height - edge) / 0.075))
    redness *= min(1.0, palette.red * 4.0) if palette.red < 0.5 else 1.0
    colour = (1.0 - redness)[..., None] * np.array(palette.pale) + redness[..., None] * np.array(
        palette.flesh
    )
    tone = 1.0 + 0.045 * _noise(rng, 20.0) + 0.025 * _noise(rng, 4.0)
    return np.asarray(colour * tone[..., None])


def _compose(
    rng: np.random.Generator,
    palette: _Palette,
    flesh: NDArray[np.float64],
    nearest: NDArray[np.int64],
    distance: NDArray[np.float64],
    along: NDArray[np.float64],
    spacing: float,
    theta: NDArray[np.float64],
) -> NDArray[np.uint8]:
    """Dimples, achenes and the small reflections of the sky below each achene, over the flesh."""
    reach = 0.34 * spacing
    dimple = np.exp(-((distance / reach) ** 2))
    # light from above: the upper wall of a dimple is in shade, the lower one catches it
    relief = 1.0 - palette.dimple * dimple + 0.22 * np.clip(along / reach, -1.0, 1.0) * dimple
    colour = flesh * relief[..., None]

    facing_up = np.clip(np.cos(theta - 0.9), 0.0, 1.0) ** 2
    count = int(nearest.max()) + 1
    strength = rng.uniform(0.1, 1.0, count)[nearest]
    glint_at = np.abs(along - 0.42 * spacing) / (0.16 * spacing)
    across = np.sqrt(np.clip(distance**2 - along**2, 0.0, None)) / (0.20 * spacing)
    glint = np.exp(-(glint_at**2) - across**2) * strength * facing_up * palette.gloss
    colour += glint[..., None] * (np.array((255.0, 235.0, 230.0)) - colour) * 0.55

    half_long, half_wide = max(0.20 * spacing, 0.5), max(0.125 * spacing, 0.32)
    aside = np.clip(distance**2 - along**2, 0.0, None)
    ellipse = np.sqrt((along / half_long) ** 2 + aside / half_wide**2)
    seed = 1.0 / (1.0 + np.exp((ellipse - 1.0) / 0.18))
    tint = rng.normal(1.0, 0.12, count)[nearest] * (1.0 - 0.25 * along / half_long * 0.5)
    achene = np.array(palette.achene) * tint[..., None]
    colour += seed[..., None] * (achene - colour)
    return np.asarray(np.clip(colour, 0.0, 255.0), dtype=np.uint8)
