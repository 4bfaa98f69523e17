"""The stereo error model: steps of disparity, error that grows with z², shadows, edges, range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from punnet.errors import ConfigurationError, ShapeError
from punnet.sim.depth_sensor import StereoDepthModel
from tests.timing import times_as_long

SIZE = (240, 320)
DARK = np.zeros((*SIZE, 3), dtype=np.uint8)
EXACT = StereoDepthModel(
    disparity_noise=0.0, depth_unit=0.0, fattening=0.0, edge_holes=0.0, random_holes=0.0, glare_holes=0.0
)


def _wall(metres: float) -> NDArray[np.float32]:
    return np.full(SIZE, metres, dtype=np.float32)


def _seen(model: StereoDepthModel, depth: NDArray[np.float32], seed: int = 0) -> NDArray[np.float32]:
    return model.apply(depth, DARK, np.random.default_rng(seed))


def test_readings_are_whole_steps_of_disparity() -> None:
    ramp = np.broadcast_to(np.linspace(0.3, 1.2, SIZE[1], dtype=np.float32), SIZE)
    seen = _seen(replace(EXACT, disparity_noise=0.08), ramp)
    disparity = EXACT.imager_focal * EXACT.baseline / seen[seen > 0].astype(np.float64)
    steps = disparity / EXACT.disparity_step
    np.testing.assert_allclose(steps, np.rint(steps), atol=2e-3)


def test_default_readings_are_whole_millimetres() -> None:
    seen = _seen(StereoDepthModel(), _wall(0.4))
    np.testing.assert_allclose(seen * 1000, np.rint(seen * 1000), atol=1e-4)


def test_without_noise_the_reading_is_within_half_a_step() -> None:
    half_step = EXACT.disparity_step / 2 * 0.4**2 / (EXACT.imager_focal * EXACT.baseline)
    np.testing.assert_allclose(_seen(EXACT, _wall(0.4)), 0.4, atol=1.01 * half_step)


def test_error_grows_with_the_square_of_the_distance() -> None:
    model = replace(EXACT, disparity_noise=0.08)
    spread = {z: float(np.std([_seen(model, _wall(z), seed) for seed in range(4)])) for z in (0.3, 0.6, 1.2)}
    assert spread[0.6] / spread[0.3] == pytest.approx(4.0, rel=0.15)
    assert spread[1.2] / spread[0.6] == pytest.approx(4.0, rel=0.15)
    assert spread[0.3] == pytest.approx(model.depth_error(0.3), rel=0.1)


def test_noise_is_alike_within_a_window() -> None:
    noise = _seen(replace(EXACT, disparity_noise=0.3), _wall(0.4)) - 0.4
    noise = noise / noise.std()
    assert float((noise[:, 1:] * noise[:, :-1]).mean()) > 0.8
    assert abs(float((noise[:, 20:] * noise[:, :-20]).mean())) < 0.15


def test_the_shadow_lies_left_of_a_near_thing_and_is_as_wide_as_its_parallax() -> None:
    depth = _wall(0.7)
    depth[80:160, 150:250] = 0.4
    seen = _seen(EXACT, depth)
    row = np.flatnonzero(seen[120] == 0)
    width = EXACT.image_focal * (EXACT.baseline + EXACT.colour_offset) * (1 / 0.4 - 1 / 0.7)
    assert row.max() == 149
    assert len(row) == pytest.approx(width, abs=1.5)
    assert (seen[20] > 0).all()  # no near thing in that row


def test_what_is_seen_past_a_thin_stem_is_kept() -> None:
    depth = _wall(0.7)
    depth[:, 200:203] = 0.4
    holes = np.flatnonzero(_seen(EXACT, depth)[120] == 0)
    assert 3 <= len(holes) <= 5
    assert (np.diff(holes) == 1).all()
    assert holes.max() < 190


def test_edges_spread_or_fail_and_leave_the_inside_alone() -> None:
    depth = _wall(0.7)
    depth[80:160, 150:250] = 0.4
    seen = _seen(replace(EXACT, fattening=0.6, edge_holes=0.5), depth)
    right = seen[81:159, 250]
    assert 0.3 < np.isclose(right, 0.4, atol=1e-3).mean() < 0.9  # took the nearer depth
    assert (np.isclose(right, 0.4, atol=1e-3) | (right == 0)).all()
    assert (seen[:, 251:253][81:159] == 0).any()
    np.testing.assert_allclose(seen[80:160, 150:250], 0.4, atol=1e-3)
    np.testing.assert_allclose(seen[:, 256:], 0.7, atol=1e-3)


def test_glare_reads_nothing_in_places() -> None:
    rgb = DARK.copy()
    rgb[100:140, 100:140] = 255
    seen = StereoDepthModel(random_holes=0.0).apply(_wall(0.4), rgb, np.random.default_rng(1))
    assert 0.3 < (seen[100:140, 100:140] == 0).mean() < 0.9
    assert (seen[:90] > 0).all()


@pytest.mark.parametrize(
    ("metres", "readable"), [(0.15, False), (0.2, True), (9.0, True), (11.0, False), (0.0, False)]
)
def test_range(metres: float, readable: bool) -> None:
    seen = _seen(replace(EXACT, max_range=10.0), _wall(metres))
    assert (seen > 0).all() if readable else (seen == 0).all()


def test_random_holes_have_their_share() -> None:
    share = np.mean([(_seen(replace(EXACT, random_holes=0.02), _wall(0.4), s) == 0).mean() for s in range(8)])
    assert share == pytest.approx(0.02, rel=0.4)


def test_a_seed_decides_everything_and_the_input_is_left_alone() -> None:
    depth = _wall(0.5)
    depth[50:90, 60:100] = 0.35
    before = depth.copy()
    first, again, other = (_seen(StereoDepthModel(), depth, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(depth, before)


@given(
    near=st.floats(0.05, 2.0),
    far=st.floats(0.0, 20.0),
    left=st.integers(0, 60),
    seed=st.integers(0, 2**32 - 1),
)
@example(near=1.0, far=1.2e-38, left=0, seed=0)
@settings(max_examples=30, deadline=None)
def test_any_scene_gives_a_legal_picture(near: float, far: float, left: int, seed: int) -> None:
    depth = np.full((48, 64), far, dtype=np.float32)
    depth[10:30, left : left + 9] = near
    rgb = np.random.default_rng(seed).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    seen = StereoDepthModel().apply(depth, rgb, np.random.default_rng(seed))
    assert seen.dtype == np.float32
    assert np.isfinite(seen).all()
    readings = seen[seen > 0]
    assert ((readings >= 0.174) & (readings <= 10.001)).all()


def test_wrong_shapes_and_values_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ShapeError, match="need depth"):
        StereoDepthModel().apply(_wall(0.4), DARK[:-1], rng)
    with pytest.raises(ShapeError, match="finite"):
        StereoDepthModel().apply(_wall(np.nan), DARK, rng)
    with pytest.raises(ShapeError, match="≥ 0"):
        StereoDepthModel().apply(_wall(-0.4), DARK, rng)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("baseline", 0.0),
        ("fattening", 1.5),
        ("max_range", 0.1),
        ("disparity_noise", -1.0),
        ("depth_unit", np.nan),
    ],
)
def test_settings_are_checked(setting: str, value: float) -> None:
    with pytest.raises(ConfigurationError, match=setting):
        replace(StereoDepthModel(), **{setting: value})


def test_a_full_picture_is_quick() -> None:
    depth = np.full((480, 640), 0.7, dtype=np.float32)
    depth[100:300, 200:400] = 0.4
    rgb, rng = np.zeros((480, 640, 3), dtype=np.uint8), np.random.default_rng(0)
    blurred = times_as_long(
        lambda: StereoDepthModel().apply(depth, rgb, rng), lambda: ndimage.gaussian_filter(depth, 2.0)
    )
    assert blurred < 6  # twice as long as a blur; milliseconds are for benchmarks/rendering.py
