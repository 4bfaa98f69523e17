"""A strawberry: shape, texture, size, mass, and what a simulator and a labeller need to know of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.sim.berry_shape import BerryForm, BerryShape, draw_shape
from punnet.sim.berry_texture import STAGE_SKINS, Skin, paint_berry
from punnet.sim.mesh import Mesh

__all__ = [
    "FORM_SHARES",
    "Berry",
    "BerryForm",
    "RipenessStage",
    "assemble_berry",
    "draw_density",
    "draw_mass",
    "make_berry",
]

MEAN_MASS, MASS_SPREAD, MASS_RANGE = 18.6, 5.7, (4.8, 38.9)
"""Grams: mean, standard deviation and range of 368 weighed table-top berries (Tafuro et al., ICRA 2022)."""

_MEAN_DENSITY, _DENSITY_SPREAD, _DENSITY_RANGE = (
    0.92,
    0.03,
    (0.85, 1.0),
)  # g/cm³; fruits float, hollow ones high
FORM_SHARES = {BerryForm.CONIC: 0.6, BerryForm.GLOBOSE: 0.22, BerryForm.WEDGE: 0.18}
"""How often each shape class grows."""


class RipenessStage(IntEnum):
    """Stages of a berry's life, by colour."""

    GREEN = 0
    WHITE = 1
    TURNING = 2
    RIPE = 3
    OVERRIPE = 4
    ROTTEN = 5

    @property
    def ripeness(self) -> float:
        """Share of the surface that is red, 0 to 1; what :attr:`Strawberries.ripeness` holds."""
        return (0.0, 0.1, 0.5, 0.95, 1.0, 1.0)[self]

    @property
    def pluckable(self) -> bool:
        """Whether it is picked: ripe, and neither over-ripe nor rotten, as the thesis has it (section 3.3.1)."""
        return self is RipenessStage.RIPE


# Length in metres of berries that still grow; later stages are drawn by mass, turning ones a little lighter.
_GROWING_LENGTHS = {RipenessStage.GREEN: (0.014, 0.028), RipenessStage.WHITE: (0.024, 0.036)}
_MASS_SHARE = {
    RipenessStage.TURNING: 0.85,
    RipenessStage.RIPE: 1.0,
    RipenessStage.OVERRIPE: 1.0,
    RipenessStage.ROTTEN: 0.9,
}


@dataclass(frozen=True, eq=False)
class Berry:
    """One berry in its own frame: origin at the calyx attachment, tip towards −z, width along x.

    Metres and grams.

    Parameters
    ----------
    mesh
        Watertight, with texture coordinates.
    stage, form
        Ripeness and shape class.
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
    form: BerryForm
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


def make_berry(
    rng: np.random.Generator,
    stage: RipenessStage,
    *,
    form: BerryForm | None = None,
    length: float | None = None,
) -> Berry:
    """Grow a berry, never the same twice.

    Without ``length``, the mass of a ripe berry follows the measured distribution, 18.6 ± 5.7 g within
    4.8…38.9 g, a turning one has 85% of such a mass, and white and green ones are drawn by length.

    Parameters
    ----------
    rng
        Source of all randomness.
    stage
        Ripeness, which sets colours and size.
    form
        Shape class; drawn if None.
    length
        Metres from the top of the shoulders to the tip; drawn if None.

    Raises
    ------
    ConfigurationError
        If ``length`` is not between 5 and 90 mm.
    """
    if length is not None and not 0.005 <= length <= 0.09:
        raise ConfigurationError(f"make_berry: length must be 0.005…0.09 m, got {length}")
    if form is None:
        forms = list(FORM_SHARES)
        form = forms[rng.choice(len(forms), p=list(FORM_SHARES.values()))]
    shape = draw_shape(rng, form)
    unit = shape.mesh()
    density = draw_density(rng)
    scale = _draw_scale(rng, stage, unit, density, length)
    return assemble_berry(
        shape,
        scale,
        stage,
        form=form,
        density=density,
        skin=STAGE_SKINS[stage],
        ripeness=stage.ripeness,
        paint_seed=int(rng.integers(2**63)),
    )


def assemble_berry(
    shape: BerryShape,
    scale: float,
    stage: RipenessStage,
    *,
    form: BerryForm,
    density: float,
    skin: Skin,
    ripeness: float,
    paint_seed: int,
    calyx_size: float = 1.0,
) -> Berry:
    """Put a berry together from all that there is to choose; draws nothing.

    ``scale`` is metres for one unit of ``shape``; ``density`` is in g/cm³.
    """
    unit = shape.mesh()
    mesh = Mesh(unit.vertices * scale, unit.faces, unit.uv)
    centre, semi_axes = _fitted_ellipsoid(mesh)
    extent = np.ptp(mesh.vertices, axis=0)
    return Berry(
        mesh=mesh,
        stage=stage,
        form=form,
        length=float(extent[2]),
        width=float(extent[0]),
        depth=float(extent[1]),
        volume=mesh.volume,
        density=density,
        centre=centre,
        semi_axes=semi_axes,
        shape=shape,
        scale=scale,
        skin=skin,
        ripeness=ripeness,
        calyx_size=calyx_size,
        paint_seed=paint_seed,
        keypoints=_keypoints(shape, mesh, scale),
    )


def draw_density(rng: np.random.Generator) -> float:
    """Draw a berry's density, g/cm³."""
    return float(np.clip(rng.normal(_MEAN_DENSITY, _DENSITY_SPREAD), *_DENSITY_RANGE))


def draw_mass(rng: np.random.Generator) -> float:
    """Draw a ripe berry's grams from the measured distribution, 18.6 ± 5.7 g within 4.8…38.9 g."""
    mass = rng.normal(MEAN_MASS, MASS_SPREAD)
    while not MASS_RANGE[0] <= mass <= MASS_RANGE[1]:
        mass = rng.normal(MEAN_MASS, MASS_SPREAD)
    return float(mass)


def _draw_scale(
    rng: np.random.Generator, stage: RipenessStage, unit: Mesh, density: float, length: float | None
) -> float:
    """Metres for one unit of the shape."""
    unit_length = float(np.ptp(unit.vertices[:, 2]))
    if length is None and stage in _GROWING_LENGTHS:
        length = float(rng.uniform(*_GROWING_LENGTHS[stage]))
    if length is not None:
        return length / unit_length
    return float(np.cbrt(draw_mass(rng) * _MASS_SHARE[stage] * 1e-6 / density / unit.volume))


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
