"""Camera effects: nothing set changes nothing, and each setting does what it says."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.sim.camera_effects import (
    NIGHT_CAMERA,
    CameraEffects,
    apply_effects,
    draw_effects,
    draw_night_effects,
)

NOTHING = CameraEffects()


@pytest.fixture(scope="module")
def picture():
    rng = np.random.default_rng(0)
    low = rng.integers(20, 160, (12, 16, 3), dtype=np.uint8)
    return np.kron(low, np.ones((8, 8, 1), dtype=np.uint8))


def applied(picture, seed=0, **settings):
    return apply_effects(picture, replace(NOTHING, **settings), np.random.default_rng(seed)).astype(float)


def test_no_effect_leaves_the_picture(picture):
    assert np.abs(applied(picture) - picture).max() <= 1


def test_gain_scales_a_channel_and_highlights_roll_off_below_white(picture):
    doubled = applied(picture // 2, gain=(2.0, 1.0, 1.0))
    assert np.abs(doubled[..., 0] - picture[..., 0] // 2 * 2).max() <= 2
    assert np.abs(doubled[..., 1] - picture[..., 1] // 2).max() <= 1
    bright = applied(np.full((8, 8, 3), 250, np.uint8))
    assert 178 < bright.mean() < 250


def test_saturation_and_haze_take_colour_away(picture):
    grey = applied(picture, saturation=0.0)
    assert np.ptp(grey, axis=-1).max() <= 1
    hazy = applied(picture, haze=0.4)
    assert hazy.std() < 0.75 * picture.std()
    assert hazy.min() > picture.min() + 50


@pytest.mark.parametrize("settings", [{"defocus": 1.2}, {"motion": (4.0, 2.0)}])
def test_blur_is_symmetric_so_masks_stay_where_they_are(settings):
    dot = np.zeros((41, 41, 3), np.uint8)
    dot[18:23, 18:23] = 170
    blurred = applied(dot, **settings)[..., 0]
    assert 0 < blurred[20, 20] < 171
    rows, columns = np.indices(blurred.shape)
    assert (blurred * rows).sum() / blurred.sum() == pytest.approx(20.0, abs=0.05)
    assert (blurred * columns).sum() / blurred.sum() == pytest.approx(20.0, abs=0.05)


def test_metering_brings_a_dark_picture_up(picture):
    assert applied(picture // 4, metering=1.0).mean() > 1.6 * (picture // 4).mean()


def test_noise_is_drawn_from_the_generator(picture):
    one, again, other = (applied(picture, seed, shot_noise=4.0, read_noise=1.0) for seed in (1, 1, 2))
    assert (one == again).all()
    assert (one != other).mean() > 0.5
    assert (one - picture).std() == pytest.approx(4.0 * np.sqrt(picture.mean() / 255), abs=0.8)


def test_drawn_settings_are_repeatable_and_keep_a_picture_a_picture(picture):
    for seed in range(20):
        effects = draw_effects(np.random.default_rng(seed))
        assert effects == draw_effects(np.random.default_rng(seed))
        assert np.hypot(*effects.motion) <= 5.0 + 1e-9
        done = apply_effects(picture, effects, np.random.default_rng(seed))
        assert done.shape == picture.shape
        assert done.dtype == np.uint8
        assert done.std() > 5


def test_night_cameras_lie_about_the_one_of_the_harvest():
    drawn = [draw_night_effects(np.random.default_rng(seed)) for seed in range(200)]
    for name in ("saturation", "gamma", "vignette", "defocus", "shot_noise", "read_noise"):
        values = [getattr(effects, name) for effects in drawn]
        assert min(values) < getattr(NIGHT_CAMERA, name) < max(values)
    gains = np.log([effects.gain for effects in drawn]) - np.log(NIGHT_CAMERA.gain)
    np.testing.assert_allclose(gains.mean(axis=0), 0.0, atol=0.06)
    assert draw_night_effects(np.random.default_rng(3)) == drawn[3]
