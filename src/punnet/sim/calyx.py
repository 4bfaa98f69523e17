"""The calyx: green pointed sepals around the attachment of a berry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.sim.mesh import Mesh

__all__ = ["calyx_texture", "make_calyx", "sepal"]

_STATIONS = np.array([0.0, 0.3, 0.62, 1.0])
_HALF_WIDTHS = np.array([0.55, 1.0, 0.78, 0.0])
_THICKNESS = 0.0003


def sepal(
    length: float, half_width: float, azimuth: float, start: tuple[float, float], slopes: NDArray[np.float64]
) -> Mesh:
    """One two-sided sepal that leaves the axis at ``azimuth``, metres.

    Parameters
    ----------
    length, half_width
        Along its curve, and across at its widest.
    start
        (radius, height) of its base.
    slopes
        (3,) angles above the horizontal of its pieces, radians, from the base out.
    """
    steps = np.diff(_STATIONS) * length
    radius = start[0] + np.concatenate(([0.0], np.cumsum(steps * np.cos(slopes))))
    height = start[1] + np.concatenate(([0.0], np.cumsum(steps * np.sin(slopes))))
    half = _HALF_WIDTHS * half_width
    rows = []
    for r, h, w in zip(radius, height, half, strict=True):
        rows.append(((r, -w, h), (r, 0.0, h - 0.25 * w), (r, w, h)))
    front = np.array(rows).reshape(-1, 3)
    uv = np.stack(np.meshgrid((0.02, 0.5, 0.98), _STATIONS), axis=-1).reshape(-1, 2)
    triangles = []
    for row in range(len(_STATIONS) - 1):
        for column in range(2):
            a = 3 * row + column
            b, c, d = a + 1, a + 3, a + 4
            triangles.append((a, c, b))
            if row < len(_STATIONS) - 2:
                triangles.append((b, c, d))
    upper = np.array(triangles)
    # the last row has no width: its three vertices are one point, so one triangle a side is enough
    faces = np.concatenate((upper, upper[:, ::-1] + len(front)))
    vertices = np.concatenate((front, front - (0.0, 0.0, _THICKNESS)))
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return Mesh(vertices @ rotation.T, faces, np.concatenate((uv, uv)))


def make_calyx(rng: np.random.Generator, berry_width: float, *, size: float = 1.0) -> Mesh:
    """Grow a calyx for a berry ``berry_width`` metres across, in the berry's frame; ``size`` 1 is the usual.

    Broad sepals alternate with narrower ones of the epicalyx; some lie on the shoulders, some turn up.
    Texture coordinates are those of :func:`calyx_texture`: across, and from the base to the tip.
    """
    pairs = int(rng.integers(5, 7))
    reflexed = rng.uniform(-0.2, 0.7)  # how far the whole calyx turns up
    parts = []
    for number in range(2 * pairs):
        narrow = number % 2
        azimuth = 2.0 * np.pi * (number / (2 * pairs)) + rng.normal(0.0, 0.12)
        # the calyx is nearly full-grown while the fruit still swells
        length = (0.0065 + 0.26 * berry_width) * rng.uniform(0.82, 1.15) * (0.85 if narrow else 1.0) * size
        half_width = length * (rng.uniform(0.15, 0.19) if narrow else rng.uniform(0.23, 0.29))
        lift = reflexed + rng.normal(0.0, 0.3) + (0.15 if narrow else 0.0)
        curl = rng.normal(0.2, 0.4)
        slopes = np.array([0.32 + 0.4 * lift, lift - 0.12, lift - 0.55 + curl])
        slopes = np.maximum(slopes, (0.22, -0.22, -0.8))  # never into the fruit
        parts.append(
            sepal(length, half_width, azimuth, (0.03 * berry_width, 0.0006 * narrow + 0.001), slopes)
        )
    return Mesh.joined(parts)


def calyx_texture(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Paint the texture (64, 32, 3): fresh green with a pale midrib, lighter base and sometimes dry tips."""
    along = np.linspace(0.0, 1.0, 64)[:, None]
    across = np.abs(np.linspace(-1.0, 1.0, 32))[None, :]
    tone = rng.uniform(0.85, 1.12)
    base, tip = np.array((168, 188, 98.0)) * tone, np.array((92, 132, 56.0)) * tone
    blend = np.clip(along * 1.6, 0.0, 1.0)[..., None]
    colour = (1 - blend) * base + blend * tip
    colour = np.broadcast_to(colour, (64, 32, 3)) * (1.0 + 0.14 * np.exp(-((across / 0.14) ** 2)))[..., None]
    dry = np.clip((along - rng.uniform(0.86, 1.1)) / 0.08, 0.0, 1.0)[..., None]
    colour = (1 - dry) * colour + dry * np.array((122, 92, 52.0))
    colour = colour * rng.normal(1.0, 0.04, (64, 32))[..., None]
    return np.asarray(np.clip(colour, 0.0, 255.0), dtype=np.uint8)
