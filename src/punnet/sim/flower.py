"""Flowers: five white petals around a yellow centre, on green sepals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import rotation_from_vector
from punnet.sim.calyx import sepal
from punnet.sim.mesh import Mesh

__all__ = ["Flower", "make_flower"]

_PETALS = 5
_RIM = 9


@dataclass(frozen=True, eq=False)
class Flower:
    """A flower in its own frame: the pedicel joins at the origin from −z, the flower opens towards +z.

    ``texture`` is uint8 (64, 96, 3) in three strips: petal, centre, sepal.
    """

    mesh: Mesh
    texture: NDArray[np.uint8]
    diameter: float


def _petal(rng: np.random.Generator, radius: float, azimuth: float) -> Mesh:
    """Shape a cupped, two-sided round petal that starts near the axis."""
    angles = np.linspace(-np.pi * 0.80, np.pi * 0.80, _RIM)
    rim = np.stack((0.56 + 0.44 * np.cos(angles), 0.47 * np.sin(angles)), axis=-1)
    flat = np.concatenate(([[0.12, 0.0], [0.58, 0.0]], rim)) * radius
    height = 0.22 * radius * (np.linalg.norm(flat, axis=1) / radius) ** 2 + rng.normal(0.0, 0.03) * radius
    height[1] -= 0.05 * radius
    top = np.column_stack((flat, height))
    hub, base = 1, 0
    fan = [(hub, 2 + k, 3 + k) for k in range(_RIM - 1)]
    fan += [(hub, base, 2), (hub, 1 + _RIM, base)]
    upper = np.array(fan)
    uv = np.column_stack((flat[:, 1] / radius * 0.3 + 1 / 6, 0.98 - 0.95 * flat[:, 0] / radius / 1.02))
    vertices = np.concatenate((top, top - (0.0, 0.0, 0.0002)))
    faces = np.concatenate((upper, upper[:, ::-1] + len(top)))
    T = np.eye(4)
    T[:3, :3] = rotation_from_vector((0.0, 0.0, azimuth))
    return Mesh(vertices, faces, np.concatenate((uv, uv))).transformed(T)


def _centre(radius: float) -> Mesh:
    """Shape a low dome."""
    ring = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]
    rows = [
        np.column_stack((r * np.cos(ring), r * np.sin(ring), np.full(8, h)))
        for r, h in ((1.0, 0.15), (0.7, 0.55))
    ]
    vertices = np.concatenate((*rows, [[0.0, 0.0, 0.72]])) * radius
    faces = []
    for k in range(8):
        n = (k + 1) % 8
        faces += [(k, n, 8 + k), (n, 8 + n, 8 + k), (8 + k, 8 + n, 16)]
    uv = 0.5 + vertices[:, :2] / radius * 0.48
    return Mesh(vertices, np.array(faces), np.column_stack((1 / 3 + uv[:, 0] / 3, uv[:, 1])))


def _in_strip(green: Mesh) -> Mesh:
    """Move a sepal's texture coordinates into the green strip."""
    uv = np.zeros((len(green.vertices), 2)) if green.uv is None else green.uv
    return Mesh(green.vertices, green.faces, uv * (1 / 3.2, 1.0) + (0.675, 0.0))


def _texture(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 64
    row, column = np.meshgrid(np.linspace(0, 1, size), np.linspace(-1, 1, 32), indexing="ij")
    veins = 1.0 - 0.035 * (np.cos(column * 22.0) > 0.6) - 0.10 * np.clip(row - 0.75, 0, 1)
    petal = np.array((247.0, 247.0, 243.0)) * veins[..., None] * rng.uniform(0.96, 1.02)
    spots = rng.normal(1.0, 0.16, (size, 32))[..., None]
    rim = np.clip(np.hypot(column, 2 * row - 1), 0.0, 1.0)[..., None]
    centre = ((1 - rim) * np.array((206.0, 190.0, 70.0)) + rim * np.array((226.0, 178.0, 40.0))) * spots
    green = np.broadcast_to(np.array((104.0, 140.0, 62.0)), (size, 32, 3)) * rng.normal(
        1.0, 0.05, (size, 32, 1)
    )
    return np.asarray(np.clip(np.concatenate((petal, centre, green), axis=1), 0, 255), dtype=np.uint8)


def make_flower(rng: np.random.Generator) -> Flower:
    """Grow a flower of 22 to 32 mm, sometimes with a petal missing."""
    diameter = float(rng.uniform(0.022, 0.032))
    radius = diameter / 2.0
    parts = [_centre(0.28 * radius)]
    phase = rng.uniform(0.0, 2.0 * np.pi)
    fallen = int(rng.integers(_PETALS)) if rng.random() < 0.2 else -1
    for number in range(_PETALS):
        azimuth = phase + 2.0 * np.pi * number / _PETALS + rng.normal(0.0, 0.06)
        if number != fallen:
            parts.append(_petal(rng, radius * rng.uniform(0.92, 1.05), azimuth))
        slopes = np.array([0.1, 0.05, 0.15])
        green = sepal(
            0.85 * radius, 0.2 * radius, azimuth + np.pi / _PETALS, (0.02 * radius, -0.0006), slopes
        )
        parts.append(_in_strip(green))
    return Flower(Mesh.joined(parts), _texture(rng), diameter)
