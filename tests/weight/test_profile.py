"""Outline and bulge along the axis, of bodies whose sizes are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from punnet.weight import BerryObservation, observe
from punnet.weight.profile import chords, measure_profile, measure_relief
from tests.weight.scenes import ellipsoid_scene, one_berry, with_keypoints

Triple = tuple[float, float, float]


def _berry(centre: Triple, half: Triple, *, keypoints: bool = True) -> BerryObservation:
    frame, mask = ellipsoid_scene(centre, half)
    berries = one_berry(mask)
    if keypoints:
        berries = with_keypoints(frame, berries, centre, half)
    observation = observe(frame, berries)[0]
    assert isinstance(observation, BerryObservation), observation
    return observation


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.4), (0.12, 0.08, 0.4), (-0.05, 0.05, 0.25)])
@pytest.mark.parametrize("keypoints", [True, False])
def test_length_and_width_of_an_ellipsoid(centre: Triple, keypoints: bool) -> None:
    profile = measure_profile(_berry(centre, (0.013, 0.018, 0.013), keypoints=keypoints))
    assert profile.length == pytest.approx(0.036, rel=0.03)
    assert profile.width == pytest.approx(0.026, rel=0.03)
    assert abs(profile.axis[1]) > 0.98
    assert np.isnan(profile.keypoint_length) == (not keypoints)


def test_key_points_complete_what_a_leaf_hides() -> None:
    centre, half = (0.0, 0.0, 0.4), (0.014, 0.018, 0.014)
    frame, mask = ellipsoid_scene(centre, half)
    assert frame.depth is not None
    depth, visible = frame.depth.copy(), mask.copy()
    middle = int(np.nonzero(mask)[1].mean())
    depth[:, middle + 4 :], visible[:, middle + 4 :] = 0.3, False
    hidden = replace(frame, depth=depth)
    berry = observe(hidden, with_keypoints(hidden, one_berry(visible), centre, half))[0]
    assert isinstance(berry, BerryObservation), berry
    profile = measure_profile(berry)
    assert np.ptp(profile.seen[:, 1]) < 0.7 * 0.028
    assert profile.width == pytest.approx(0.028, rel=0.06)
    assert profile.length == pytest.approx(0.036, rel=0.06)


@pytest.mark.parametrize("thickness", [0.012, 0.014, 0.017])
@pytest.mark.parametrize("distance", [0.25, 0.4])
def test_the_aspect_tells_how_thick_it_is(thickness: float, distance: float) -> None:
    berry = _berry((0.0, 0.0, distance), (0.014, 0.018, thickness))
    relief = measure_relief(berry, measure_profile(berry))
    assert relief.aspect == pytest.approx(thickness / 0.014, rel=0.06)
    assert abs(relief.tilt) < 0.05
    assert relief.residual < 3e-4
    assert len(relief.surface) == 13


def test_far_away_the_aspect_is_believed_less() -> None:
    near, far = (_berry((0.0, 0.0, distance), (0.014, 0.018, 0.017)) for distance in (0.25, 0.7))
    reliefs = [measure_relief(berry, measure_profile(berry)) for berry in (near, far)]
    assert reliefs[0].noise < 0.3 * reliefs[1].noise
    assert reliefs[0].believed > 2.0 * reliefs[1].believed > 0.0


def test_the_stem_is_as_long_as_it_looks() -> None:
    profile = measure_profile(_berry((0.05, 0.0, 0.4), (0.014, 0.018, 0.014)))
    assert profile.stem_length == pytest.approx(0.02, rel=0.03)
    assert profile.stem_bend == pytest.approx(0.0, abs=0.02)
    bare = measure_profile(_berry((0.05, 0.0, 0.4), (0.014, 0.018, 0.014), keypoints=False))
    assert np.isnan([bare.stem_length, bare.stem_bend]).all()


def test_chords_of_a_diamond() -> None:
    diamond = np.array([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (1.0, -1.0)])
    low, high = chords(diamond, np.array([-1.0, 0.5, 1.0, 1.75, 3.0]))
    np.testing.assert_allclose(low, [0, -0.5, -1, -0.25, 0])
    np.testing.assert_allclose(high, [0, 0.5, 1, 0.25, 0])
