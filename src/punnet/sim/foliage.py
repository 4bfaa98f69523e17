"""Leaves: three serrated leaflets with the texture of real ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, FileFormatError
from punnet.geometry import rotation_from_vector
from punnet.sim.mesh import Mesh

__all__ = ["LEAF_TEXTURES", "Leaf", "leaf_texture", "make_leaf"]

LEAF_TEXTURES = 12
"""How many leaf photographs ship with the package."""

_TEETH = 7
_MIDRIB_POINTS = 6
_THICKNESS = 0.004  # of the leaflet's length: enough to keep the two sides apart in the depth buffer


@dataclass(frozen=True, eq=False)
class Leaf:
    """A trifoliate leaf: petiole joins at the origin, leaf extends along +x, upper face looks to +z.

    Parameters
    ----------
    mesh
        Both faces, with texture coordinates.
    texture
        uint8 (192, 384, 3): upper face in the left half, lower face in the right half.
    size
        Length of the middle leaflet in metres.
    """

    mesh: Mesh
    texture: NDArray[np.uint8]
    size: float


@cache
def _photograph(number: int) -> NDArray[np.uint8]:
    name = f"leaf_{number:02d}.jpg"
    data = (files("punnet.sim") / "assets" / "leaves" / name).read_bytes()
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise FileFormatError(f"leaf texture {name} in the installed package can't be read; reinstall punnet")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def leaf_texture(rng: np.random.Generator, number: int) -> NDArray[np.uint8]:
    """Tint leaf photograph ``number`` at random: texture (192, 384, 3), upper face, then paler lower face."""
    if not 0 <= number < LEAF_TEXTURES:
        raise ConfigurationError(f"leaf_texture: number must be 0…{LEAF_TEXTURES - 1}, got {number}")
    upper = _photograph(number).astype(np.float64)
    mean = upper.mean(axis=(0, 1))
    # under the tunnel's diffuse light mature leaves are darker and bluer than on the photographer's table
    target = np.array((62.0, 98.0, 60.0)) * rng.uniform(0.75, 1.25) * rng.normal(1.0, 0.05, 3)
    upper = np.clip(upper * (target / mean), 0.0, 255.0)
    grey = upper.mean(axis=2, keepdims=True)
    lower = np.clip(0.55 * upper + 0.45 * grey + (34.0, 42.0, 28.0), 0.0, 255.0)
    return np.concatenate((upper, lower), axis=1).astype(np.uint8)


def _outline(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """One edge of a leaflet of length 1: positions along the midrib and half-widths, with teeth."""
    count = 2 * _TEETH
    along = np.linspace(0.0, 1.0, count + 1) ** 0.9
    half_width = 0.5 * np.sin(np.pi * np.clip(along, 0.0, 1.0) ** 1.05) ** 0.62
    tooth = np.where(np.arange(count + 1) % 2 == 1, 0.035, -0.03) * (along > 0.2) * (along < 0.99)
    half_width = np.clip(
        half_width * 0.95 + tooth + rng.normal(0.0, 0.008, count + 1) * (along < 0.99), 0.0, 0.5
    )
    half_width[0] = half_width[-1] = 0.0
    along = along + np.where(np.arange(count + 1) % 2 == 1, 0.03, 0.0) * (along > 0.2) * (along < 0.99)
    return np.clip(along, 0.0, 1.0), half_width


def _strip(
    edge: NDArray[np.int64], rib: NDArray[np.int64], position: NDArray[np.float64]
) -> list[tuple[int, int, int]]:
    """Fill between two chains of vertices with common ends, advancing whichever lags behind."""
    triangles = []
    i = j = 0
    while i < len(edge) - 1 or j < len(rib) - 1:
        edge_next = position[edge[i + 1]] if i < len(edge) - 1 else np.inf
        rib_next = position[rib[j + 1]] if j < len(rib) - 1 else np.inf
        if edge_next <= rib_next:
            triangles.append((int(rib[j]), int(edge[i]), int(edge[i + 1])))
            i += 1
        else:
            triangles.append((int(rib[j]), int(edge[i]), int(rib[j + 1])))
            j += 1
    return [t for t in triangles if len(set(t)) == 3]


def _leaflet(rng: np.random.Generator, *, width: float, fold: float, droop: float, cup: float) -> Mesh:
    """Shape a leaflet of length 1 along +x: base at the origin, folded along the midrib, tip drooping."""
    rib_along = np.linspace(0.0, 1.0, _MIDRIB_POINTS)
    left_along, left_width = _outline(rng)
    right_along, right_width = _outline(rng)
    inner = slice(1, -1)
    along = np.concatenate((rib_along, left_along[inner], right_along[inner]))
    across = np.concatenate((np.zeros(_MIDRIB_POINTS), left_width[inner], -right_width[inner]))
    rib = np.arange(_MIDRIB_POINTS)
    left = _MIDRIB_POINTS + np.arange(len(left_along) - 2)
    right = left[-1] + 1 + np.arange(len(right_along) - 2)
    triangles = []
    for side, chain in ((-1, left), (1, right)):
        edge = np.concatenate((rib[:1], chain, rib[-1:]))
        strip = _strip(edge, rib, along)
        triangles += [t[::-1] for t in strip] if side < 0 else strip
    upper = np.array(triangles)

    angle = droop * along  # the midrib bends along an arc
    x = np.where(droop != 0, np.sin(angle) / droop, along) if droop else along
    z = -(1.0 - np.cos(angle)) / droop if droop else np.zeros_like(along)
    rise = np.abs(across) * np.tan(fold) - cup * (2 * across) ** 2 * 0.25
    wave = 0.02 * np.sin(along * 9.0 + rng.uniform(0, 6)) * np.sign(across) * np.abs(across) * 4
    top = np.stack((x + rise * np.sin(angle), across * width, z + (rise + wave) * np.cos(angle)), axis=-1)
    uv = np.stack((0.25 + 0.46 * across, 0.985 - 0.97 * along), axis=-1)
    if rng.random() < 0.5:
        uv[:, 0] = 0.5 - uv[:, 0]
    normal = np.stack((np.sin(angle), np.zeros_like(angle), np.cos(angle)), axis=-1)
    vertices = np.concatenate((top, top - _THICKNESS * normal))
    faces = np.concatenate((upper, upper[:, ::-1] + len(top)))
    return Mesh(vertices, faces, np.concatenate((uv, uv + np.array((0.5, 0.0)))))


def make_leaf(rng: np.random.Generator, size: float) -> Leaf:
    """Grow a leaf whose middle leaflet is ``size`` metres long.

    Raises
    ------
    ConfigurationError
        If ``size`` is not positive.
    """
    if not size > 0:
        raise ConfigurationError(f"make_leaf: size must be positive metres, got {size}")
    leaflets = []
    for turn in (0.0, rng.normal(1.35, 0.12), rng.normal(-1.35, 0.12)):
        scale = 1.0 if turn == 0.0 else rng.uniform(0.84, 0.96)
        leaflet = _leaflet(
            rng,
            width=rng.uniform(0.84, 0.98),
            fold=rng.uniform(0.1, 0.5),
            droop=rng.uniform(0.15, 0.8),
            cup=rng.uniform(0.0, 0.25),
        )
        placed = Mesh(leaflet.vertices * scale + (0.05, 0.0, 0.0), leaflet.faces, leaflet.uv)
        R = rotation_from_vector((0.0, 0.0, turn)) @ rotation_from_vector((rng.normal(0.0, 0.15), 0.0, 0.0))
        T = np.eye(4)
        T[:3, :3] = R @ rotation_from_vector((0.0, rng.normal(0.1, 0.12), 0.0))
        leaflets.append(placed.transformed(T))
    mesh = Mesh.joined(leaflets)
    texture = leaf_texture(rng, int(rng.integers(LEAF_TEXTURES)))
    return Leaf(Mesh(mesh.vertices * size, mesh.faces, mesh.uv), texture, size)
