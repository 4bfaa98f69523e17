"""Berries for labelled images: stages that the eye can tell apart, sizes as measured."""

import numpy as np
import pytest

from punnet.sim.berry import MASS_RANGE, RipenessStage, make_berry
from punnet.sim.berry_texture import STAGE_SKINS
from punnet.sim.varied_berries import make_varied_berry


def red_share(berry):
    """Share of the skin that is redder than it is green, from the painted texture alone."""
    texture = berry.texture.astype(float)
    theta = np.pi * (np.arange(len(texture)) + 0.5) / len(texture)
    red = (texture[..., 0] > 1.9 * texture[..., 1]) & (texture[..., 0] > 60)
    return float((red.mean(axis=1) * np.sin(theta)).sum() / np.sin(theta).sum())


def grown(stage, count, seed=0):
    rng = np.random.default_rng(seed)
    return [make_varied_berry(rng, stage) for _ in range(count)]


def test_a_gap_lies_between_turning_and_ripe_berries():
    turning = [red_share(berry) for berry in grown(RipenessStage.TURNING, 25)]
    ripe = [red_share(berry) for berry in grown(RipenessStage.RIPE, 25)]
    assert max(turning) < 0.56
    assert min(ripe) > 0.66


def test_ripeness_is_the_share_of_red_skin():
    for stage in (RipenessStage.GREEN, RipenessStage.TURNING, RipenessStage.RIPE):
        for berry in grown(stage, 6, seed=1):
            assert red_share(berry) == pytest.approx(berry.ripeness, abs=0.16)


def test_overripe_is_darker_than_ripe_and_rot_is_less_red():
    def mean_red(stage):
        return np.mean([berry.texture[64:, :, 0].mean() for berry in grown(stage, 8)])

    def saturation(stage):
        textures = [berry.texture[64:].astype(float) for berry in grown(stage, 8)]
        return np.mean([np.ptp(texture, axis=-1).mean() for texture in textures])

    assert mean_red(RipenessStage.OVERRIPE) < 0.7 * mean_red(RipenessStage.RIPE)
    assert saturation(RipenessStage.ROTTEN) < 0.85 * saturation(RipenessStage.OVERRIPE)


def test_masses_of_ripe_berries_follow_the_weighed_ones():
    masses = np.array([berry.mass for berry in grown(RipenessStage.RIPE, 300)])
    assert masses.mean() == pytest.approx(18.6, abs=1.2)
    assert masses.std() == pytest.approx(5.7, abs=0.9)
    assert MASS_RANGE[0] <= masses.min() <= masses.max() <= MASS_RANGE[1]


def test_shapes_reach_from_round_to_long():
    elongation = [berry.length / berry.width for berry in grown(RipenessStage.RIPE, 200)]
    assert np.percentile(elongation, 5) < 1.05
    assert np.percentile(elongation, 95) > 1.5


def test_the_harvests_berries_keep_the_skin_of_their_stage():
    for stage in RipenessStage:
        berry = make_berry(np.random.default_rng(0), stage)
        assert berry.skin is STAGE_SKINS[stage]
        assert berry.ripeness == stage.ripeness
