"""Painted backgrounds: what may lie or stand behind a plant, tables and tunnels aside.

Each function paints uint8 (H, W, 3). Those in :data:`NEAR_SURFACES` tile and lie just behind the fruit, like the film
of a raised bed; those in :data:`FAR_VIEWS` are seen out of focus, and some hold red things that are no berries.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.sim.foliage import LEAF_TEXTURES, leaf_texture
from punnet.sim.noise import tiling_noise
from punnet.sim.scenery_textures import paint_backdrop, paint_gravel, paint_soil

__all__ = ["FAR_VIEWS", "NEAR_SURFACES", "Painter"]

_Image = NDArray[np.uint8]
Painter = Callable[[np.random.Generator], _Image]
_NEAR, _FAR = (256, 256), (384, 512)


def _image(colour: NDArray[np.floating]) -> _Image:
    return np.asarray(np.clip(colour, 0.0, 255.0), dtype=np.uint8)


def _film(rng: np.random.Generator, colour: tuple[float, float, float], streak: float) -> _Image:
    """Plastic film: streaks that water has left, dust, creases across."""
    streaks = tiling_noise(rng, (1, _NEAR[1]), 1.5) + 0.7 * tiling_noise(rng, (1, _NEAR[1]), 9.0)
    fade = 0.6 + 0.4 * tiling_noise(rng, _NEAR, 18.0)
    creases = np.clip(tiling_noise(rng, (_NEAR[0], 1), 3.0) - 1.0, 0.0, 2.0)
    dust = np.clip(tiling_noise(rng, _NEAR, 1.2) - 2.2, 0.0, 1.0) * 90.0
    cloud = tiling_noise(rng, _NEAR, 30.0)
    tone = 1.0 + streak * streaks * fade + 0.3 * streak * creases + 0.12 * cloud
    return _image(np.array(colour) * tone[..., None] + dust[..., None])


def _paint_dark_film(rng: np.random.Generator) -> _Image:
    base = rng.uniform(26.0, 92.0)
    return _film(rng, (base * rng.uniform(0.96, 1.12), base, base * rng.uniform(0.92, 1.12)), 0.16)


def _paint_white_film(rng: np.random.Generator) -> _Image:
    base = rng.uniform(165.0, 232.0)
    return _film(rng, (base, base, base * rng.uniform(0.92, 1.04)), 0.04)


def _paint_straw(rng: np.random.Generator) -> _Image:
    """Straw, stalk upon stalk."""
    canvas = np.full((*_NEAR, 3), (96, 80, 54), dtype=np.uint8)
    base = np.array(_between(rng, (206, 176, 116), (180, 160, 120)))
    count = 700
    middles = rng.uniform(0, _NEAR[1], (count, 2))
    angles = rng.normal(rng.uniform(0, np.pi), 0.9, count)
    half = rng.uniform(12, 46, count)[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    tones = rng.uniform(0.55, 1.25, count)
    for middle, reach, tone in zip(middles, half, tones, strict=True):
        start, end = np.rint(middle - reach).astype(int), np.rint(middle + reach).astype(int)
        colour = np.clip(base * tone, 0, 255).tolist()
        cv2.line(canvas, start.tolist(), end.tolist(), colour, int(rng.integers(1, 3)), cv2.LINE_AA)
    return np.asarray(canvas, dtype=np.uint8)


def _between(
    rng: np.random.Generator, one: tuple[float, ...], other: tuple[float, ...]
) -> tuple[float, float, float]:
    share = rng.random()
    r, g, b = (a + share * (z - a) for a, z in zip(one, other, strict=True))
    return (r, g, b)


def _paint_earth(rng: np.random.Generator) -> _Image:
    return _image(paint_soil(rng) * rng.uniform(0.45, 1.05))


def _paint_chippings(rng: np.random.Generator) -> _Image:
    return _image(paint_gravel(rng, size=256) * rng.uniform(0.6, 1.05))


def _paint_foliage(rng: np.random.Generator) -> _Image:
    """Leaves upon leaves, darker the deeper, out of focus."""
    height, width = _FAR
    canvas = np.full((height, width, 3), _between(rng, (18, 26, 14), (60, 84, 48)), dtype=np.float32)
    textures = [leaf_texture(rng, int(rng.integers(LEAF_TEXTURES)))[:, :192] for _ in range(4)]
    ellipse = np.zeros((192, 192), dtype=np.float32)
    cv2.ellipse(ellipse, (96, 96), (78, 94), 0, 0, 360, 1.0, -1, cv2.LINE_AA)
    count = int(rng.integers(150, 320))
    for number in range(count):
        size = rng.uniform(0.12, 0.42)
        turn = np.asarray(cv2.getRotationMatrix2D((96, 96), rng.uniform(0, 360), size), dtype=np.float64)
        place = rng.uniform((-20, -20), (width + 20, height + 20))
        turn[:, 2] += place - 96
        tone = (0.3 + 0.75 * number / count) * rng.uniform(0.7, 1.3)
        corner = np.maximum(np.floor(place - 60).astype(int), 0)
        end = np.minimum(np.ceil(place + 60).astype(int), (width, height))
        if (end <= corner).any():
            continue
        turn[:, 2] -= corner
        span = (int(end[0] - corner[0]), int(end[1] - corner[1]))
        leaf = cv2.warpAffine(textures[number % 4], turn, span).astype(np.float32) * tone
        cover = cv2.warpAffine(ellipse, turn, span)[..., None]
        part = canvas[corner[1] : end[1], corner[0] : end[0]]
        part[:] = part + cover * (leaf - part)
    return _image(cv2.GaussianBlur(canvas, (0, 0), rng.uniform(0.6, 3.0)) * rng.uniform(0.7, 1.5))


def _paint_noise(rng: np.random.Generator) -> _Image:
    """Blotches of any colours."""
    colour = np.zeros((*_FAR, 3)) + rng.uniform(20, 235) + rng.normal(0.0, 30.0, 3)
    for sigma in (40.0, 12.0, 3.0):
        colour += tiling_noise(rng, _FAR, sigma)[..., None] * rng.normal(0.0, 18.0, 3)
    return _image(colour)


def _paint_things(rng: np.random.Generator) -> _Image:
    """Crates, cloths, labels: plain things of all colours, red among them, before something else."""
    ground = (_paint_noise, _paint_foliage, _paint_tunnel)[int(rng.integers(3))](rng)
    canvas = cv2.resize(ground, (_FAR[1], _FAR[0]))
    for _ in range(int(rng.integers(4, 22))):
        if rng.random() < 0.4:
            colour = _between(rng, (240, 60, 50), (130, 8, 20))
        else:
            colour = (float(rng.uniform(0, 255)), float(rng.uniform(0, 255)), float(rng.uniform(0, 255)))
        middle = (int(rng.integers(_FAR[1])), int(rng.integers(_FAR[0])))
        axes = (int(rng.integers(4, 50)), int(rng.integers(4, 34)))
        if rng.random() < 0.5:
            cv2.ellipse(canvas, middle, axes, rng.uniform(0, 180), 0, 360, colour, -1, cv2.LINE_AA)
        else:
            box = cv2.boxPoints((middle, axes, rng.uniform(0, 90)))
            cv2.fillConvexPoly(canvas, np.rint(box).astype(np.int32), colour, cv2.LINE_AA)
    return _image(cv2.GaussianBlur(canvas, (0, 0), rng.uniform(0.6, 4.0)).astype(np.float32))


def _paint_tunnel(rng: np.random.Generator) -> _Image:
    return np.asarray(cv2.resize(paint_backdrop(rng), (_FAR[1], _FAR[0])), dtype=np.uint8)


def _paint_dark(rng: np.random.Generator) -> _Image:
    return _image(_paint_noise(rng) * rng.uniform(0.05, 0.3))


NEAR_SURFACES: dict[str, tuple[float, Painter]] = {
    "dark film": (0.45, _paint_dark_film),
    "white film": (0.17, _paint_white_film),
    "straw": (0.13, _paint_straw),
    "soil": (0.13, _paint_earth),
    "gravel": (0.12, _paint_chippings),
}
"""Name → (share, painter)."""

FAR_VIEWS: dict[str, tuple[float, Painter]] = {
    "foliage": (0.40, _paint_foliage),
    "tunnel": (0.20, _paint_tunnel),
    "things": (0.18, _paint_things),
    "noise": (0.12, _paint_noise),
    "dark": (0.10, _paint_dark),
}
"""Name → (share, painter)."""
