"""Ripeness: stages that the eye can tell apart, red over the share that the berry says."""

from itertools import pairwise

import numpy as np
import pytest

from punnet.sim.berry import make_berry
from punnet.sim.ripeness import RipenessStage, draw_red_share


def red_share(berry):
    """Share of the skin that is redder than it is green, from the painted texture alone."""
    texture = berry.texture.astype(float)
    theta = np.pi * (np.arange(len(texture)) + 0.5) / len(texture)
    red = (texture[..., 0] > 1.9 * texture[..., 1]) & (texture[..., 0] > 60)
    return float((red.mean(axis=1) * np.sin(theta)).sum() / np.sin(theta).sum())


def grown(stage, count, seed=0):
    rng = np.random.default_rng(seed)
    return [make_berry(rng, stage) for _ in range(count)]


def test_a_gap_lies_between_turning_and_ripe_berries():
    turning = [red_share(berry) for berry in grown(RipenessStage.TURNING, 25)]
    ripe = [red_share(berry) for berry in grown(RipenessStage.RIPE, 25)]
    assert max(turning) < 0.56
    assert min(ripe) > 0.66


def test_ripeness_is_the_share_of_red_skin():
    for stage in (RipenessStage.GREEN, RipenessStage.TURNING, RipenessStage.RIPE):
        for berry in grown(stage, 6, seed=1):
            assert red_share(berry) == pytest.approx(berry.ripeness, abs=0.16)


def test_red_shares_rise_with_the_stage_and_only_ripe_berries_are_picked():
    rng = np.random.default_rng(0)
    shares = {stage: [draw_red_share(rng, stage) for _ in range(40)] for stage in RipenessStage}
    growing = list(RipenessStage)[:5]
    for younger, older in pairwise(growing):
        assert max(shares[younger]) <= min(shares[older])
    assert set(shares[RipenessStage.GREEN]) == {0.0}
    assert set(shares[RipenessStage.OVERRIPE]) == {1.0}
    assert [stage.pluckable for stage in RipenessStage] == [False, False, False, True, False, False]


def test_overripe_is_darker_than_ripe_and_rot_is_less_red():
    def mean_red(stage):
        return np.mean([berry.texture[64:, :, 0].mean() for berry in grown(stage, 8)])

    def saturation(stage):
        textures = [berry.texture[64:].astype(float) for berry in grown(stage, 8)]
        return np.mean([np.ptp(texture, axis=-1).mean() for texture in textures])

    assert mean_red(RipenessStage.OVERRIPE) < 0.7 * mean_red(RipenessStage.RIPE)
    assert saturation(RipenessStage.ROTTEN) < 0.85 * saturation(RipenessStage.OVERRIPE)
