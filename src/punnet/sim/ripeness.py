"""Stages of a berry's life and the skin that goes with each, told apart by eye.

Between the berries that are picked and the younger ones lies a gap: a turning berry is red over at most 45% of its
skin, a ripe one over at least 80%.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from punnet.sim.berry_texture import Skin

__all__ = ["RipenessStage", "draw_red_share", "draw_skin"]


class RipenessStage(IntEnum):
    """Stages of a berry's life, by colour."""

    GREEN = 0
    WHITE = 1
    TURNING = 2
    RIPE = 3
    OVERRIPE = 4
    ROTTEN = 5

    @property
    def pluckable(self) -> bool:
        """Whether it is picked: ripe, and neither over-ripe nor rotten, as the thesis has it (section 3.3.1)."""
        return self is RipenessStage.RIPE


_RED_SHARES = {
    RipenessStage.GREEN: (0.0, 0.0),
    RipenessStage.WHITE: (0.0, 0.04),
    RipenessStage.TURNING: (0.12, 0.45),
    RipenessStage.RIPE: (0.80, 1.0),
    RipenessStage.OVERRIPE: (1.0, 1.0),
    RipenessStage.ROTTEN: (0.9, 1.0),
}


def draw_red_share(rng: np.random.Generator, stage: RipenessStage) -> float:
    """Draw which share of a berry's skin is red, 0 to 1."""
    return float(rng.uniform(*_RED_SHARES[stage]))


def draw_skin(rng: np.random.Generator, stage: RipenessStage, ripeness: float) -> Skin:
    """Draw colours between the extremes that varieties and photographs show, red over a share ``ripeness``."""
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


def _mixed(
    rng: np.random.Generator, one: tuple[float, ...], other: tuple[float, ...], spread: float = 4.0
) -> tuple[float, float, float]:
    """A colour between two, RGB 0–255, with a little of its own."""
    share = rng.random()
    r, g, b = (a + share * (z - a) + rng.normal(0.0, spread) for a, z in zip(one, other, strict=True))
    return (r, g, b)


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
