"""Meshes of the background: a growing bag, and the leaves and fruit of the next row as flat shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.sim.foliage import LEAF_TEXTURES, leaf_texture
from punnet.sim.mesh import Mesh

__all__ = ["bag_mesh", "row_mesh", "row_texture"]

_CELL = 192
_LEAF_SHAPE = np.array(
    [[0.5, 0.98], [0.12, 0.7], [0.06, 0.35], [0.3, 0.06], [0.7, 0.06], [0.94, 0.35], [0.88, 0.7]]
)


def bag_mesh(rng: np.random.Generator, length: float, width: float, height: float) -> Mesh:
    """Shape a filled bag along y, metres: base centre at the origin, rounded, slumped, ends closed."""
    around, along = 14, 16
    angle = np.linspace(0.0, 2.0 * np.pi, around + 1)
    step = np.linspace(0.0, 1.0, along + 1)
    cosine, sine = np.cos(angle), np.sin(angle)
    section = np.stack(
        (np.sign(cosine) * np.abs(cosine) ** 0.55, np.sign(sine) * np.abs(sine) ** 0.55), axis=-1
    )
    taper = np.clip(np.sin(np.pi * np.clip(step, 0.0, 1.0)), 0.0, 1.0) ** 0.18
    slump = 1.0 + 0.05 * np.sin(step * 21.0 + rng.uniform(0, 6)) * taper
    x = section[None, :, 0] * (width / 2) * (taper * slump)[:, None]
    z = height / 2 + section[None, :, 1] * (height / 2) * (taper * slump)[:, None]
    y = np.broadcast_to(((step - 0.5) * length)[:, None], x.shape)
    u, v = np.meshgrid(angle / (2 * np.pi), step)
    row, column = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a = (row * (around + 1) + column).ravel()
    b, c, d = a + 1, a + around + 1, a + around + 2
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((b, d, c), axis=1)))[:, ::-1]
    # front (−x) is angle π: put the print's middle row there
    uv = np.stack((1.0 - v.ravel(), np.clip(0.5 + (u.ravel() - 0.5) * 2.0, 0.0, 1.0)), axis=-1)
    return Mesh(np.stack((x, y, z), axis=-1).reshape(-1, 3), faces, uv)


def row_texture(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Atlas (384, 384, 3): three dark leaves and, bottom right, the red of berries."""
    cells = [leaf_texture(rng, int(n))[:, :_CELL] for n in rng.choice(LEAF_TEXTURES, 3, replace=False)]
    red = np.full((_CELL, _CELL, 3), (150, 36, 34), dtype=np.uint8)
    top = np.concatenate(cells[:2], axis=1)
    return np.concatenate((top, np.concatenate((cells[2], red), axis=1)), axis=0)


def _card(
    shape: NDArray[np.float64], cell: tuple[float, float]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    fan = np.array([(0, k, k + 1) for k in range(1, len(shape) - 1)])
    return fan, np.array(cell) + 0.5 * shape * (1.0, 1.0)


def row_mesh(rng: np.random.Generator, length: float, *, leaves: int = 170, berries: int = 16) -> Mesh:
    """Scatter leaves and fruit of a row along y, metres, seen from −x: canopy above z = 0, fruit below."""
    cells = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))
    parts = []
    for _ in range(leaves):
        size = rng.uniform(0.07, 0.13)
        fan, uv = _card(_LEAF_SHAPE, cells[rng.integers(3)])
        flat = (_LEAF_SHAPE - 0.5) * (size, -size)
        spin, lean = rng.uniform(0, 2 * np.pi), rng.uniform(-0.9, 0.5)
        turned = flat @ np.array([[np.cos(spin), -np.sin(spin)], [np.sin(spin), np.cos(spin)]])
        depth = rng.uniform(-0.12, 0.12)
        height = rng.triangular(-0.1, 0.08, 0.26)
        points = np.column_stack(
            (
                depth + turned[:, 1] * np.sin(lean),
                rng.uniform(-length / 2, length / 2) + turned[:, 0],
                height + turned[:, 1] * np.cos(lean),
            )
        )
        parts.append(_facing_front(points, fan, uv))
    parts += [part for _ in range(berries) for part in _hanging_berry(rng, length)]
    return Mesh.joined(parts)


def _hanging_berry(rng: np.random.Generator, length: float) -> list[Mesh]:
    """Hang a flat berry, narrower towards the tip, on a stem that comes out of the leaves."""
    width = rng.uniform(0.010, 0.016)
    x, y = rng.uniform(-0.16, -0.11), rng.uniform(-length / 2, length / 2)
    z = rng.triangular(-0.30, -0.14, -0.06)
    rim = np.linspace(0.0, 2.0 * np.pi, 7)[:-1]
    half_width = np.where(np.cos(rim) > 0, 1.0, 0.75) * np.sin(rim)
    ring = np.column_stack((np.zeros(6), width * half_width, 1.25 * width * np.cos(rim)))
    ring += np.array((x, y, z))
    uv = np.full((6, 2), 0.75) + 0.05 * np.column_stack((np.sin(rim), np.cos(rim)))
    fruit = _facing_front(ring, np.array([(0, k, k + 1) for k in range(1, 5)]), uv)
    top, sway = z + 1.2 * width, rng.normal(0.0, 0.02)
    stem = np.array([(x, y - 0.0015, top), (x, y + 0.0015, top), (-0.1, y + sway, 0.05)])
    in_leaf = np.array([(0.2, 0.2), (0.22, 0.2), (0.2, 0.22)])
    return [fruit, _facing_front(stem, np.array([(0, 1, 2)]), in_leaf)]


def _facing_front(points: NDArray[np.float64], fan: NDArray[np.int64], uv: NDArray[np.float64]) -> Mesh:
    """Make a card whose visible side looks to −x."""
    normal = np.cross(points[fan[:, 1]] - points[fan[:, 0]], points[fan[:, 2]] - points[fan[:, 0]]).sum(
        axis=0
    )
    return Mesh(points, fan if normal[0] < 0 else fan[:, ::-1], uv)
