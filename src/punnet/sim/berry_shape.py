"""The surface of one strawberry: a surface of revolution with lobes, an oval section and a bent tip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.sim.mesh import Mesh

__all__ = ["BerryForm", "BerryShape", "draw_shape"]


class BerryForm(Enum):
    """Fruit shape classes of strawberry descriptors (UPOV TG/22), the three that cover most of a crop."""

    CONIC = "conic"
    GLOBOSE = "globose"
    WEDGE = "wedge"


@dataclass(frozen=True, eq=False)
class BerryShape:
    """A berry of length 1 along −z, its calyx attachment at the origin, by polar angle θ and azimuth φ.

    Parameters
    ----------
    width, depth
        Largest diameters along x and y, in berry lengths.
    taper
        How much wider the shoulders are than the tip, 0 (sphere) to about 0.5.
    bluntness
        Exponent of the profile: 1 an ellipse, below 1 a squarer outline (the wide end of a wedge).
    lobes
        (K, 3) rows (waves around the berry, amplitude, phase): ribs and irregularities.
    bend
        Sideways shift of the tip along x and y, in berry lengths.
    shoulder
        Height of the shoulders above the calyx attachment, in berry lengths.
    """

    width: float
    depth: float
    taper: float
    bluntness: float
    lobes: NDArray[np.float64]
    bend: tuple[float, float]
    shoulder: float

    def surface(self, theta: ArrayLike, phi: ArrayLike) -> NDArray[np.float64]:
        """Points (..., 3) at polar angle θ (0 at the calyx, π at the tip) and azimuth φ (0 along x)."""
        theta, phi = np.asarray(theta, dtype=np.float64), np.asarray(phi, dtype=np.float64)
        swell = 1.0 + self.taper * np.cos(theta)
        # the widest ring must have radius 1: maximum of sin θ (1 + k cos θ)
        k = max(self.taper, 1e-9)
        widest = np.arccos((-1.0 + np.sqrt(1.0 + 8.0 * k * k)) / (4.0 * k))
        profile = np.sin(theta) * swell / (np.sin(widest) * (1.0 + k * np.cos(widest)))
        broad = np.clip(profile, 0.0, None) ** self.bluntness
        x_radius, y_radius = self.width / 2 * broad, self.depth / 2 * profile
        ribs = sum(a * np.cos(m * phi + p) for m, a, p in self.lobes)
        relief = 1.0 + ribs * np.sin(theta) ** 2
        down = (1.0 - np.cos(theta)) / 2.0
        lift = self.shoulder * np.sin(theta) ** 2 * np.exp(-(((theta - 0.75) / 0.45) ** 2)) * 2.0
        points = np.empty((*np.broadcast_shapes(theta.shape, phi.shape), 3))
        points[..., 0] = x_radius * np.cos(phi) * relief + self.bend[0] * down**2
        points[..., 1] = y_radius * np.sin(phi) * relief + self.bend[1] * down**2
        points[..., 2] = lift - down
        return points

    def mesh(self, *, rings: int = 18, segments: int = 32) -> Mesh:
        """Triangulate: watertight, texture coordinates (φ/2π, θ/π), vertices repeated at seam and poles."""
        theta = np.linspace(0.0, np.pi, rings + 2)
        phi = np.linspace(0.0, 2.0 * np.pi, segments + 1)
        grid = self.surface(theta[:, None], phi[None, :] % (2.0 * np.pi))
        grid[0] = self.surface(0.0, 0.0)
        grid[-1] = self.surface(np.pi, 0.0)
        grid[:, -1] = grid[:, 0]
        u, v = np.meshgrid(phi / (2.0 * np.pi), theta / np.pi)
        row, column = np.meshgrid(np.arange(rings + 1), np.arange(segments), indexing="ij")
        a = row * (segments + 1) + column
        b, c, d = a + 1, a + segments + 1, a + segments + 2
        upper = np.stack((a, c, d), axis=-1)[1:]  # at the poles one of the two triangles has no area
        lower = np.stack((a, d, b), axis=-1)[:-1]
        first = np.stack((a, c, d), axis=-1)[:1]
        last = np.stack((a, c, b), axis=-1)[-1:]
        faces = np.concatenate([part.reshape(-1, 3) for part in (first, upper[:-1], lower[1:], last)])
        return Mesh(grid.reshape(-1, 3), faces, np.stack((u.ravel(), v.ravel()), axis=-1))


_FORMS: dict[BerryForm, dict[str, tuple[float, float]]] = {
    BerryForm.CONIC: {
        "width": (0.74, 0.88),
        "flat": (0.92, 1.0),
        "taper": (0.26, 0.46),
        "blunt": (0.95, 1.0),
    },
    BerryForm.GLOBOSE: {
        "width": (0.86, 1.0),
        "flat": (0.93, 1.0),
        "taper": (0.06, 0.18),
        "blunt": (0.9, 1.0),
    },
    BerryForm.WEDGE: {
        "width": (0.84, 1.0),
        "flat": (0.70, 0.82),
        "taper": (0.18, 0.32),
        "blunt": (0.66, 0.8),
    },
}


_ELONGATION_RANGE = (0.88, 1.95)


def draw_shape(rng: np.random.Generator, form: BerryForm, elongation: tuple[float, float]) -> BerryShape:
    """Draw a shape of the given form, of length about 1.

    Parameters
    ----------
    rng
        Source of all randomness.
    form
        Its class.
    elongation
        Length over width: median, and spread of its logarithm; kept within 0.88…1.95. Globose berries are rounder.
    """
    shape = _draw_form(rng, form)
    median, spread = elongation
    drawn = float(np.clip(median * np.exp(rng.normal(0.0, spread)), *_ELONGATION_RANGE))
    if form is BerryForm.GLOBOSE:
        drawn = max(_ELONGATION_RANGE[0], drawn * 0.88)
    width = 1.0 / drawn
    lobes = shape.lobes.copy()
    lobes[:, 1] *= rng.uniform(0.6, 1.9)
    return replace(
        shape,
        width=width,
        depth=width * shape.depth / shape.width,
        lobes=lobes,
        taper=shape.taper * rng.uniform(0.75, 1.25),
        bend=(shape.bend[0] * 1.5, shape.bend[1] * 1.5),
    )


def _draw_form(rng: np.random.Generator, form: BerryForm) -> BerryShape:
    """Draw a regular berry of the form, from which :func:`draw_shape` departs."""
    ranges = _FORMS[form]
    width = rng.uniform(*ranges["width"])
    waves = np.array([2, 3, 4, 5, 7])
    amplitudes = np.array([0.024, 0.026, 0.020, 0.016, 0.010]) * rng.normal(0.0, 1.0, 5).clip(-1.6, 1.6)
    bend = rng.normal(0.0, 0.035, 2).clip(-0.08, 0.08)
    return BerryShape(
        width=width,
        depth=width * rng.uniform(*ranges["flat"]),
        taper=rng.uniform(*ranges["taper"]),
        bluntness=rng.uniform(*ranges["blunt"]),
        lobes=np.column_stack((waves, amplitudes, rng.uniform(0.0, 2.0 * np.pi, 5))),
        bend=(float(bend[0]), float(bend[1])),
        shoulder=rng.uniform(0.015, 0.05),
    )
