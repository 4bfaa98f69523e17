"""A strawberry: shape, texture, size, mass, and what a simulator and a labeller need to know of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from punnet.sim.berry_shape import BerryForm, BerryShape, draw_shape
from punnet.sim.berry_texture import Skin, paint_berry
from punnet.sim.mesh import Mesh
from punnet.sim.ripeness import RipenessStage, draw_red_share, draw_skin

__all__ = ["MASS_RANGE", "Berry", "make_berry"]

MEAN_MASS, MASS_SPREAD, MASS_RANGE = 18.6, 5.7, (4.8, 38.9)
"""Grams: mean, standard deviation and range of 368 weighed table-top berries (Tafuro et al., ICRA 2022)."""

_MEAN_DENSITY, _DENSITY_SPREAD, _DENSITY_RANGE = 0.92, 0.03, (0.85, 1.0)
"""Grams per cubic centimetre; fruits float, hollow ones high."""

_FORM_SHARES = {BerryForm.CONIC: 0.6, BerryForm.GLOBOSE: 0.22, BerryForm.WEDGE: 0.18}

# Length over width: (median, spread of its logarithm). Tuned so that outlines seen from all sides match real ones.
_REDDENED_ELONGATION, _UNRIPE_ELONGATION = (1.32, 0.16), (1.29, 0.19)

# Length in metres of berries that still grow; later stages are drawn by mass, turning and rotten ones a little lighter.
_GROWING_LENGTHS = {RipenessStage.GREEN: (0.008, 0.027), RipenessStage.WHITE: (0.018, 0.036)}
_MASS_SHARES = {RipenessStage.TURNING: 0.9, RipenessStage.ROTTEN: 0.85}

# Against the usual calyx for a fruit of the width.
_CALYX_SIZES, _GREEN_CALYX_SIZES = (0.8, 1.45), (0.9, 1.7)


@dataclass(frozen=True, eq=False)
class Berry:
    """One berry in its own frame: origin at the calyx attachment, tip towards −z, width along x.

    Metres and grams.

    Parameters
    ----------
    mesh
        Watertight, with texture coordinates.
    stage
        Ripeness.
    length, width, depth
        Extents along z, x and y.
    volume
        Cubic metres, of the mesh.
    density
        Grams per cubic centimetre.
    centre, semi_axes
        (3,) each: the ellipsoid, along the axes, with the berry's centre of volume and second moments.
    shape, scale, skin, paint_seed
        What :attr:`texture` is painted from.
    ripeness
        Share of the skin that is red, 0 to 1.
    calyx_size
        Size of the calyx against the usual one for a fruit of this width.
    keypoints
        ``top``, ``bottom``, ``left_grasp`` (widest point towards −x) and ``right_grasp``, each (3,).
    """

    mesh: Mesh
    stage: RipenessStage
    length: float
    width: float
    depth: float
    volume: float
    density: float
    centre: NDArray[np.float64]
    semi_axes: NDArray[np.float64]
    shape: BerryShape
    scale: float
    skin: Skin
    ripeness: float
    calyx_size: float
    paint_seed: int
    keypoints: dict[str, NDArray[np.float64]]

    @cached_property
    def texture(self) -> NDArray[np.uint8]:
        """The skin, uint8 (256, 256, 3); painted on first use, as more berries are tried than kept."""
        return paint_berry(np.random.default_rng(self.paint_seed), self.shape, self.scale, self.skin)

    @property
    def mass(self) -> float:
        """Grams: volume times density."""
        return self.volume * 1e6 * self.density


def make_berry(rng: np.random.Generator, stage: RipenessStage) -> Berry:
    """Grow a berry of ``stage``, never the same twice.

    Shapes, sizes and colours are as varied as in photographs. A ripe berry's mass follows the measured distribution,
    18.6 ± 5.7 g within 4.8…38.9 g, a turning one has 90% of such a mass and a rotten one 85%; white and green ones are
    drawn by length. How much of the skin is red: :func:`punnet.sim.ripeness.draw_red_share`.
    """
    forms = list(_FORM_SHARES)
    form = forms[rng.choice(len(forms), p=list(_FORM_SHARES.values()))]
    reddened = stage >= RipenessStage.TURNING
    shape = draw_shape(rng, form, _REDDENED_ELONGATION if reddened else _UNRIPE_ELONGATION)
    density = float(np.clip(rng.normal(_MEAN_DENSITY, _DENSITY_SPREAD), *_DENSITY_RANGE))
    unit = shape.mesh()
    scale = _draw_scale(rng, stage, unit, density)
    mesh = Mesh(unit.vertices * scale, unit.faces, unit.uv)
    centre, semi_axes = _fitted_ellipsoid(mesh)
    width, depth, length = (float(extent) for extent in np.ptp(mesh.vertices, axis=0))
    ripeness = draw_red_share(rng, stage)
    return Berry(
        mesh=mesh,
        stage=stage,
        length=length,
        width=width,
        depth=depth,
        volume=mesh.volume,
        density=density,
        centre=centre,
        semi_axes=semi_axes,
        shape=shape,
        scale=scale,
        skin=draw_skin(rng, stage, ripeness),
        ripeness=ripeness,
        paint_seed=int(rng.integers(2**63)),
        calyx_size=float(
            rng.uniform(*(_GREEN_CALYX_SIZES if stage is RipenessStage.GREEN else _CALYX_SIZES))
        ),
        keypoints=_keypoints(shape, mesh, scale),
    )


def _draw_scale(rng: np.random.Generator, stage: RipenessStage, unit: Mesh, density: float) -> float:
    """Metres for one unit of the shape."""
    if stage in _GROWING_LENGTHS:
        return float(rng.uniform(*_GROWING_LENGTHS[stage]) / np.ptp(unit.vertices[:, 2]))
    mass = _draw_ripe_mass(rng) * _MASS_SHARES.get(stage, 1.0)
    return float(np.cbrt(mass * 1e-6 / density / unit.volume))


def _draw_ripe_mass(rng: np.random.Generator) -> float:
    """Grams, from the measured distribution."""
    mass = rng.normal(MEAN_MASS, MASS_SPREAD)
    while not MASS_RANGE[0] <= mass <= MASS_RANGE[1]:
        mass = rng.normal(MEAN_MASS, MASS_SPREAD)
    return float(mass)


def _fitted_ellipsoid(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre and half-axes of the solid ellipsoid with the mesh's centre of volume and second moments.

    Sums over the tetrahedra (origin, a, b, c) of volume V: ∫x = V (a+b+c)/4 and, with s = a+b+c,
    ∫x² = V (a² + b² + c² + s²)/20; a solid ellipsoid has variance (half-axis)²/5 along each axis.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    total = volume.sum()
    centre = volume @ (a + b + c) / 4.0 / total
    second = volume @ (a**2 + b**2 + c**2 + (a + b + c) ** 2) / 20.0 / total
    return np.asarray(centre), np.asarray(np.sqrt(5.0 * (second - centre**2)))


def _keypoints(shape: BerryShape, mesh: Mesh, scale: float) -> dict[str, NDArray[np.float64]]:
    vertices = mesh.vertices
    return {
        "top": shape.surface(0.0, 0.0) * scale,
        "bottom": vertices[np.argmin(vertices[:, 2])].copy(),
        "left_grasp": vertices[np.argmin(vertices[:, 0])].copy(),
        "right_grasp": vertices[np.argmax(vertices[:, 0])].copy(),
    }
