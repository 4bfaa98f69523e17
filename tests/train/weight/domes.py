"""Berries without a simulator: half ellipsoids before a small camera, whose weight follows from their size."""

from __future__ import annotations

import numpy as np

from punnet.geometry import CameraIntrinsics
from punnet.weight.observation import BerryObservation
from punnet.weight.samples import WeightSamples

CAMERA = CameraIntrinsics(320, 240, 300.0, 300.0, 159.5, 119.5)
GRAMS_A_CUBIC_METRE = 6e5


def dome(
    radius: float = 0.015, length: float = 0.02, distance: float = 0.3, centre: tuple[int, int] = (160, 120)
) -> BerryObservation:
    """A berry of the semi-axes ``radius``, ``length``, ``radius`` metres, ``distance`` metres from the camera."""
    half_width, half_height = (CAMERA.fx * size / distance for size in (radius, length))
    rows = np.arange(int(centre[1] - half_height), int(centre[1] + half_height) + 2)
    columns = np.arange(int(centre[0] - half_width), int(centre[0] + half_width) + 2)
    u, v = np.meshgrid(columns, rows)
    inside = 1.0 - ((u - centre[0]) / half_width) ** 2 - ((v - centre[1]) / half_height) ** 2
    mask = inside > 0
    depth = np.where(mask, distance - radius * np.sqrt(np.maximum(inside, 0.0)), 0.0).astype(np.float32)
    z = depth[mask].astype(np.float64)
    cloud = np.column_stack(((u[mask] - CAMERA.cx) / CAMERA.fx * z, (v[mask] - CAMERA.cy) / CAMERA.fy * z, z))
    rgb = np.full((*mask.shape, 3), 40, np.uint8)
    rgb[mask] = (200, 30, 40)
    window = (slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1))
    box = np.array((window[1].start, window[0].start, window[1].stop, window[0].stop), dtype=np.float64)
    return BerryObservation(CAMERA, window, rgb, depth, mask, cloud, box)


def domes(count: int, seed: int = 0) -> WeightSamples:
    """Berries of 7 to 60 g at 0.25 to 0.45 m."""
    generator = np.random.default_rng(seed)
    radii = generator.uniform(0.013, 0.022, count)
    lengths = radii * generator.uniform(1.0, 1.5, count)
    distances = generator.uniform(0.25, 0.45, count)
    return WeightSamples(
        observations=tuple(dome(*sizes) for sizes in zip(radii, lengths, distances, strict=True)),
        grams=4 / 3 * np.pi * radii**2 * lengths * GRAMS_A_CUBIC_METRE,
        groups=tuple(f"plant {index}" for index in range(count)),
        occlusion=np.zeros(count),
        distance=distances,
        image=np.arange(count),
        annotation=np.arange(count),
    )
