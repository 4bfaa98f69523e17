"""Painted surfaces of the tunnel: gravel, growing bags, woven tape, zinc, the far end of the tunnel."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.sim.noise import tiling_noise

__all__ = [
    "paint_backdrop",
    "paint_bag",
    "paint_gravel",
    "paint_hedge",
    "paint_soil",
    "paint_tape",
    "paint_zinc",
]

_Image = NDArray[np.uint8]


def _image(colour: NDArray[np.floating]) -> _Image:
    return np.asarray(np.clip(colour, 0.0, 255.0), dtype=np.uint8)


def _stones(
    rng: np.random.Generator, size: int, spacing: float
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Break a tile into stones: each pixel's stone, and how far it is from the stone's middle."""
    count = int((size / spacing) ** 2)
    middles = np.full((size, size), 255, dtype=np.uint8)
    places = rng.integers(0, size, (2, count))
    middles[places[0], places[1]] = 0
    pad = int(4 * spacing)
    tiled = cv2.copyMakeBorder(middles, pad, pad, pad, pad, cv2.BORDER_WRAP)
    away, stone = cv2.distanceTransformWithLabels(tiled, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    inner = slice(pad, pad + size)
    # the copies of one stone across the seam must share a label: name it by the pixel of its middle
    rows, columns = np.nonzero(tiled == 0)
    names = np.zeros(int(stone.max()) + 1, dtype=np.int32)
    names[stone[rows, columns]] = (rows - pad) % size * size + (columns - pad) % size
    return names[stone[inner, inner]], np.asarray(away[inner, inner] / spacing, dtype=np.float32)


def paint_gravel(rng: np.random.Generator, *, size: int = 512) -> _Image:
    """Paint pale limestone chippings with rusty and damp patches, tiling; (size, size, 3)."""
    stone, away = _stones(rng, size, 4.6)
    tints = rng.normal(1.0, 0.065, (size * size, 1)) + rng.normal(0.0, 0.014, (size * size, 3))
    tone = 1.06 - 0.20 * np.clip(away, 0.0, 1.2) ** 2  # dark joints
    tone += 0.06 * (away - np.roll(away, (2, 1), axis=(0, 1)))  # lit from one side
    tone += 0.03 * tiling_noise(rng, (size, size), 24.0)
    patches = np.clip(tiling_noise(rng, (size, size), 40.0) - 0.6, 0.0, 1.5)[..., None]
    colour = np.array((208.0, 199.0, 190.0)) * tints[stone] * tone[..., None]
    return _image(colour * (1.0 - patches * np.array((0.03, 0.06, 0.10))))


def paint_soil(rng: np.random.Generator) -> _Image:
    """Paint bare soil with weeds, as between the rows of an older tunnel, tiling; (256, 256, 3)."""
    shape = (256, 256)
    crumbs, weeds = (
        tiling_noise(rng, shape, 1.2),
        tiling_noise(rng, shape, 5.0) + 0.5 * tiling_noise(rng, shape, 1.5),
    )
    soil = np.array((138.0, 122.0, 106.0)) * (1.0 + 0.10 * crumbs[..., None])
    green = np.array((104.0, 120.0, 82.0)) * (1.0 + 0.14 * crumbs[..., None])
    cover = np.clip((weeds - rng.uniform(-0.4, 1.2)) / 0.6, 0.0, 1.0)[..., None]
    return _image(soil + cover * (green - soil))


def paint_bag(rng: np.random.Generator) -> _Image:
    """Paint the creased, printed film of a growing bag; (128, 512, 3), rows around, columns along it."""
    height, width = 128, 512
    creases = cv2.GaussianBlur(rng.normal(size=(height, width)).astype(np.float32), (0, 0), 2.0, sigmaY=9.0)
    creases = np.clip(creases / creases.std() - 1.1, 0.0, 3.0)
    colour = np.full((height, width, 3), 21.0) + (26.0 * creases)[..., None] * np.array((0.92, 0.97, 1.05))
    print_layer = np.zeros((height, width), dtype=np.uint8)
    for column in (60, 320):
        cv2.ellipse(print_layer, (column, 64), (11, 17), 25, 0, 360, 200, 2, cv2.LINE_AA)
        cv2.line(print_layer, (column - 6, 77), (column + 7, 51), 200, 2, cv2.LINE_AA)
        cv2.putText(
            print_layer, "coir", (column + 20, 76), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 200, 2, cv2.LINE_AA
        )
        cv2.rectangle(print_layer, (column + 98, 48), (column + 138, 80), 170, 1, cv2.LINE_AA)
    worn = np.clip(0.72 + 0.2 * tiling_noise(rng, (height, width), 5.0), 0.0, 1.0) * print_layer / 255.0
    return _image(colour + worn[..., None] * np.array((120.0, 124.0, 128.0)))


def paint_tape(rng: np.random.Generator) -> _Image:
    """Paint woven tape that keeps the trusses off the gutter's edge; (32, 256, 3)."""
    row, column = np.meshgrid(np.arange(32), np.arange(256), indexing="ij")
    weave = 0.5 + 0.5 * np.where((row // 2 + column // 2) % 2 == 0, 1.0, -1.0)
    tone = 74.0 + 46.0 * weave + rng.normal(0.0, 7.0, (32, 256))
    tone[:3] += 30.0
    return _image(tone[..., None] * np.array((0.96, 1.0, 1.02)))


def paint_zinc(rng: np.random.Generator) -> _Image:
    """Paint galvanised sheet, weathered: faint streaks and stains; (128, 256, 3), tiling."""
    streaks = cv2.GaussianBlur(rng.normal(size=(128, 256)).astype(np.float32), (0, 0), 14.0, sigmaY=1.0)
    streaks = streaks / streaks.std()
    spangle = tiling_noise(rng, (128, 256), 1.5)
    stain = np.clip(tiling_noise(rng, (128, 256), 9.0) - 1.2, 0.0, 2.0)
    tone = 156.0 + 7.0 * streaks + 3.0 * spangle - 16.0 * stain
    return _image(tone[..., None] * np.array((0.965, 1.0, 1.03)))


def paint_hedge(rng: np.random.Generator) -> _Image:
    """Paint a canopy seen from afar, tiling; (128, 128, 3)."""
    shape = (128, 128)
    clumps = tiling_noise(rng, shape, 1.6) + tiling_noise(rng, shape, 4.0)
    return _image(np.array((74.0, 104.0, 60.0)) * (1.0 + 0.22 * clumps[..., None]))


def paint_backdrop(rng: np.random.Generator) -> _Image:
    """Paint the far end of the tunnel: bright sheet above, crops in haze, pale ground; (256, 512, 3)."""
    height, width = 256, 512
    y = np.linspace(0.0, 1.0, height)[:, None, None]
    colour = np.broadcast_to(np.array((226.0, 230.0, 228.0)) * (1.0 - 0.08 * y), (height, width, 3)).copy()
    for column in range(0, width, 64):  # hoops of the tunnel
        colour[:, column : column + 2] -= 26.0
    clumps = tiling_noise(rng, (height, width), 3.0) + tiling_noise(rng, (height, width), 10.0)
    green = np.array((98.0, 118.0, 84.0)) * (1.0 + 0.14 * clumps[..., None])
    top = 0.60 + 0.02 * tiling_noise(rng, (1, width), 9.0)[..., None]
    colour += np.clip((y - top) / 0.03, 0.0, 1.0) * (green - colour)
    shadow = np.clip((y - 0.74) / 0.05, 0.0, 1.0)  # below the gutters: legs, pipes and ground run together
    below = np.array((136.0, 134.0, 122.0)) * (1.0 + 0.05 * clumps[..., None])
    colour += shadow * (below - colour)
    ground = np.clip((y - 0.90) / 0.08, 0.0, 1.0)
    colour += ground * (np.array((188.0, 180.0, 170.0)) - colour)
    return _image(np.asarray(cv2.GaussianBlur(colour.astype(np.float32), (0, 0), 1.6), dtype=np.float32))
