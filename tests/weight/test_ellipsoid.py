"""Weighing by eye: exact bodies, invariances, hidden berries, and every kind of bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, Strawberries
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.weight import EllipsoidConfig, EllipsoidEstimator, WeightEstimator
from tests.weight.scenes import D435I, ellipsoid_grams, ellipsoid_scene, one_berry

CENTRE, HALF = (0.03, -0.02, 0.4), (0.016, 0.019, 0.016)
EXACT = EllipsoidConfig(shape_factor=1.0, thickness_factor=1.0, elongation_exponent=0.0, relief_gain=1.0)


def _grams(frame: Frame, berries: Strawberries, config: EllipsoidConfig | None = None) -> float:
    return float(EllipsoidEstimator(config).estimate(frame, berries).grams[0])


def _reason(frame: Frame, berries: Strawberries) -> str:
    estimates = EllipsoidEstimator().estimate(frame, berries)
    assert np.isnan(estimates.grams).all()
    assert np.isnan(estimates.intervals).all()
    assert estimates.reasons[0] is not None
    return estimates.reasons[0]


def test_it_is_a_weight_estimator() -> None:
    assert isinstance(EllipsoidEstimator(), WeightEstimator)


@pytest.mark.parametrize("distance", [0.2, 0.3, 0.4, 0.6])
@pytest.mark.parametrize("radius", [0.008, 0.014, 0.020])
def test_a_ball_is_weighed_right_at_any_distance(radius: float, distance: float) -> None:
    frame, mask = ellipsoid_scene((0.02, 0.01, distance), (radius,) * 3)
    assert _grams(frame, one_berry(mask), EXACT) == pytest.approx(ellipsoid_grams((radius,) * 3), rel=0.05)


def test_a_ball_near_the_corner_weighs_as_much_as_in_the_middle() -> None:
    half = (0.015,) * 3
    for centre in ((0.0, 0.0, 0.4), (0.17, 0.12, 0.4), (-0.18, -0.12, 0.4)):
        frame, mask = ellipsoid_scene(centre, half)
        assert _grams(frame, one_berry(mask), EXACT) == pytest.approx(ellipsoid_grams(half), rel=0.05)


def test_the_bulge_tells_a_thick_berry_from_a_thin_one() -> None:
    grams = {}
    for thickness in (0.013, 0.016, 0.019):
        frame, mask = ellipsoid_scene((0.0, 0.0, 0.4), (0.016, 0.016, thickness))
        grams[thickness] = _grams(frame, one_berry(mask), replace(EXACT, relief_spread=0.03))
    assert grams[0.013] < 0.9 * grams[0.016] < 0.9 * 0.9 * grams[0.019] * 1.1
    assert grams[0.013] == pytest.approx(ellipsoid_grams((0.016, 0.016, 0.013)), rel=0.1)


@given(du=st.integers(-150, 150), dv=st.integers(-120, 120))
@settings(max_examples=15, deadline=None)
def test_where_the_same_cloud_sits_in_the_picture_does_not_matter(du: int, dv: int) -> None:
    """Shift the picture and the principal point together: each pixel keeps its ray, so nothing may change."""
    frame, mask = ellipsoid_scene((0.0, 0.0, 0.4), HALF)
    assert frame.depth is not None
    shifted = Frame(
        np.roll(frame.rgb, (dv, du), axis=(0, 1)),
        np.roll(frame.depth, (dv, du), axis=(0, 1)),
        CameraIntrinsics(640, 480, 615.0, 615.0, D435I.cx + du, D435I.cy + dv),
    )
    moved = one_berry(np.roll(mask, (dv, du), axis=(0, 1)))
    assert _grams(shifted, moved) == pytest.approx(_grams(frame, one_berry(mask)), rel=1e-9)


@given(scale=st.floats(0.6, 1.4))
@settings(max_examples=10, deadline=None)
def test_weight_grows_with_the_cube_of_size_and_distance_together(scale: float) -> None:
    """A scene twice as large, twice as far away, is the same picture: only depth tells, by the cube."""
    frame, mask = ellipsoid_scene((0.0, 0.0, 0.4), HALF)
    assert frame.depth is not None
    larger = replace(frame, depth=frame.depth * np.float32(scale))
    ratio = _grams(larger, one_berry(mask)) / _grams(frame, one_berry(mask))
    assert ratio == pytest.approx(scale**3, rel=1e-3)


def test_the_sensor_costs_little_and_the_interval_holds() -> None:
    inside, errors = 0, []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        half = tuple(rng.uniform(0.012, 0.020, 1) * rng.uniform(0.93, 1.07, 3) * (1.0, 1.2, 1.0))
        frame, mask = ellipsoid_scene((rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), 0.42), half)
        assert frame.depth is not None
        seen = StereoDepthModel().apply(frame.depth, frame.rgb, rng)
        estimates = EllipsoidEstimator(EXACT).estimate(replace(frame, depth=seen), one_berry(mask))
        truth = ellipsoid_grams(half)
        inside += bool(estimates.intervals[0, 0] <= truth <= estimates.intervals[0, 1])
        errors.append(abs(estimates.grams[0] / truth - 1))
    assert inside >= 10
    assert np.mean(errors) < 0.10


def test_what_hides_a_berry_widens_its_interval_upwards() -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert frame.depth is not None
    depth, visible = frame.depth.copy(), mask.copy()
    middle = int(np.nonzero(mask)[1].mean())
    depth[:, middle + 5 :] = 0.3  # a leaf before the right half
    visible[:, middle + 5 :] = False
    free = EllipsoidEstimator().estimate(frame, one_berry(mask))
    half = EllipsoidEstimator().estimate(replace(frame, depth=depth), one_berry(visible))
    widths = [e.intervals[0, 1] / e.grams[0] for e in (free, half)]
    assert widths[1] > 1.2 * widths[0]
    assert half.intervals[0, 1] > ellipsoid_grams(HALF) * 0.9


def test_no_berries_give_no_weights() -> None:
    frame, _ = ellipsoid_scene(CENTRE, HALF)
    assert EllipsoidEstimator().estimate(frame, Strawberries.empty((480, 640))).grams.shape == (0,)


def test_what_can_not_be_observed_has_the_reason() -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert "no depth" in _reason(replace(frame, depth=None), one_berry(mask))


def test_a_mask_as_large_as_the_picture_is_no_berry() -> None:
    frame, _ = ellipsoid_scene((0.0, 0.0, 0.9), (0.4, 0.4, 0.4), wall=2.0)
    assert "no berry" in _reason(frame, one_berry(np.ones((480, 640), dtype=bool)))


@given(seed=st.integers(0, 2**32 - 1), fill=st.floats(0.0, 1.0))
@settings(max_examples=25, deadline=None)
def test_nonsense_never_raises_and_never_gives_a_wild_number(seed: int, fill: float) -> None:
    rng = np.random.default_rng(seed)
    camera = CameraIntrinsics(80, 60, 90.0, 90.0, 39.5, 29.5)
    depth = np.where(rng.random((60, 80)) < fill, rng.uniform(0.05, 3.0, (60, 80)), 0.0).astype(np.float32)
    mask = rng.random((60, 80)) < rng.random()
    estimates = EllipsoidEstimator().estimate(
        Frame(np.zeros((60, 80, 3), np.uint8), depth, camera), one_berry(mask)
    )
    if estimates.reasons[0] is None:
        assert 0.2 <= estimates.grams[0] <= 120.0
        assert estimates.intervals[0, 0] <= estimates.grams[0] <= estimates.intervals[0, 1]


@pytest.mark.parametrize(
    "setting",
    [
        {"density": 0.0},
        {"coverage": 1.0},
    ],
)
def test_settings_are_checked(setting: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError):
        EllipsoidConfig(**setting)  # type: ignore[arg-type]
