"""Berries for labelled images: shapes, sizes and colours as varied as in photographs, each stage told apart by eye.

The harvest's berries (:func:`punnet.sim.berry.make_berry`) are of one crop in one light. A detector must know more:
longer and rounder fruit, colours of many varieties, calyces of all sizes, mould. Between the stages that are picked
and those that are not lies a gap: a turning berry is red over at most 45% of its skin, a ripe one over at least 80%.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from punnet.sim.berry import (
    FORM_SHARES,
    Berry,
    RipenessStage,
    assemble_berry,
    draw_density,
    draw_mass,
)
from punnet.sim.berry_shape import BerryForm, BerryShape, draw_shape
from punnet.sim.berry_texture import Skin

__all__ = ["make_varied_berry"]

# Length over width: (median, spread of its logarithm). Tuned so that outlines seen from all sides match real ones.
_ELONGATION = {True: (1.32, 0.16), False: (1.29, 0.19)}  # by whether the fruit has turned red
_ELONGATION_RANGE = (0.88, 1.95)
_GROWING_LENGTHS = {RipenessStage.GREEN: (0.008, 0.027), RipenessStage.WHITE: (0.018, 0.036)}
_MASS_SHARE = {RipenessStage.TURNING: 0.9, RipenessStage.ROTTEN: 0.85}
_CALYX_SIZES = {RipenessStage.GREEN: (0.9, 1.7)}
_RED_SHARES = {
    RipenessStage.GREEN: (0.0, 0.0),
    RipenessStage.WHITE: (0.0, 0.04),
    RipenessStage.TURNING: (0.12, 0.45),
    RipenessStage.RIPE: (0.80, 1.0),
    RipenessStage.OVERRIPE: (1.0, 1.0),
    RipenessStage.ROTTEN: (0.9, 1.0),
}


def make_varied_berry(rng: np.random.Generator, stage: RipenessStage) -> Berry:
    """Grow a berry of ``stage``; ripe ones weigh as measured, 18.6 ± 5.7 g within 4.8…38.9 g."""
    forms = list(FORM_SHARES)
    form = forms[rng.choice(len(forms), p=list(FORM_SHARES.values()))]
    shape = _draw_varied_shape(rng, form, stage)
    density = draw_density(rng)
    unit = shape.mesh()
    if stage in _GROWING_LENGTHS:
        scale = rng.uniform(*_GROWING_LENGTHS[stage]) / float(np.ptp(unit.vertices[:, 2]))
    else:
        mass = draw_mass(rng) * _MASS_SHARE.get(stage, 1.0)
        scale = np.cbrt(mass * 1e-6 / density / unit.volume)
    ripeness = float(rng.uniform(*_RED_SHARES[stage]))
    return assemble_berry(
        shape,
        float(scale),
        stage,
        form=form,
        density=density,
        skin=_draw_skin(rng, stage, ripeness),
        ripeness=ripeness,
        paint_seed=int(rng.integers(2**63)),
        calyx_size=float(rng.uniform(*_CALYX_SIZES.get(stage, (0.8, 1.45)))),
    )


def _draw_varied_shape(rng: np.random.Generator, form: BerryForm, stage: RipenessStage) -> BerryShape:
    shape = draw_shape(rng, form)
    median, spread = _ELONGATION[stage >= RipenessStage.TURNING]
    elongation = float(np.clip(median * np.exp(rng.normal(0.0, spread)), *_ELONGATION_RANGE))
    if form is BerryForm.GLOBOSE:
        elongation = max(0.88, elongation * 0.88)
    width = 1.0 / elongation
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


def _mixed(
    rng: np.random.Generator, one: tuple[float, ...], other: tuple[float, ...], spread: float = 4.0
) -> tuple[float, float, float]:
    """A colour between two, RGB 0–255, with a little of its own."""
    share = rng.random()
    r, g, b = (a + share * (z - a) + rng.normal(0.0, spread) for a, z in zip(one, other, strict=True))
    return (r, g, b)


def _draw_skin(rng: np.random.Generator, stage: RipenessStage, ripeness: float) -> Skin:
    """Colours between the extremes that varieties and photographs show."""
    gloss = rng.uniform(0.15, 1.0)
    dimple = rng.uniform(0.22, 0.42)
    sunny = rng.uniform(0.01, 0.06)
    red = _red_height(ripeness)
    if stage is RipenessStage.GREEN:
        flesh = _mixed(rng, (142, 168, 74), (208, 210, 128))
        achene = _mixed(rng, (206, 172, 74), (140, 150, 60))
        return Skin(flesh, flesh, achene, 0.0, 0.4 * gloss, dimple, sunny)
    if stage is RipenessStage.WHITE:
        pale = _mixed(rng, (222, 220, 150), (238, 226, 190))
        blush = _mixed(rng, (236, 150, 110), (240, 190, 150))
        achene = _mixed(rng, (190, 120, 60), (196, 170, 80))
        return Skin(pale, blush, achene, red, 0.4 * gloss, dimple, sunny)
    if stage in (RipenessStage.TURNING, RipenessStage.RIPE):
        flesh = _mixed(rng, (228, 58, 34), (192, 14, 26), 6.0)
        pale = _mixed(rng, (240, 206, 138), (226, 214, 160))
        if stage is RipenessStage.RIPE:
            pale = _mixed(rng, (238, 150, 90), (240, 204, 150))
        achene = _mixed(rng, (232, 176, 76), (200, 110, 50))
        return Skin(pale, flesh, achene, red, gloss, dimple, sunny)
    flesh = _mixed(rng, (118, 8, 18), (84, 4, 14), 3.0)
    achene = _mixed(rng, (170, 110, 54), (120, 60, 40))
    rot = float(rng.uniform(0.3, 0.85)) if stage is RipenessStage.ROTTEN else 0.0
    return Skin((150, 18, 22), flesh, achene, 1.0, 0.5 * gloss, dimple, sunny, rot)


def _red_height(ripeness: float) -> float:
    """:attr:`Skin.red` that reddens a share ``ripeness`` of the skin, from the tip up.

    Up to the polar angle θ from the calyx, (1 − cos θ)/2 of a sphere's skin is pale; the paint's edge
    lies at θ/π = 1.02 − 1.05·red.
    """
    if ripeness >= 0.995:
        return 1.0
    if ripeness <= 0.0:
        return 0.0
    edge = np.arccos(np.clip(2.0 * ripeness - 1.0, -1.0, 1.0)) / np.pi
    return float((1.02 - edge) / 1.05)
