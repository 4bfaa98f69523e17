"""What is seen of a berry, and every kind of input of which nothing can be said."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, Strawberries, Visibility
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.weight import BerryObservation, observe
from tests.weight.scenes import D435I, ellipsoid_scene, one_berry, with_keypoints

CENTRE, HALF = (0.03, -0.02, 0.4), (0.016, 0.019, 0.016)


def _seen(frame: Frame, berries: Strawberries) -> BerryObservation:
    observation = observe(frame, berries)[0]
    assert isinstance(observation, BerryObservation), observation
    return observation


def _reason(frame: Frame, berries: Strawberries) -> str:
    observation = observe(frame, berries)[0]
    assert isinstance(observation, str)
    return observation


def _scene() -> tuple[Frame, NDArray[np.bool_], NDArray[np.float32]]:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert frame.depth is not None
    return frame, mask, frame.depth.copy()


def test_crops_show_the_masks_box() -> None:
    frame, mask, depth = _scene()
    berry = _seen(frame, one_berry(mask))
    rows, columns = np.nonzero(mask)
    assert berry.window == (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    np.testing.assert_array_equal(berry.mask, mask[berry.window])
    np.testing.assert_array_equal(berry.depth, depth[berry.window])
    np.testing.assert_array_equal(berry.rgb, frame.rgb[berry.window])
    assert len(berry.cloud) + sum(berry.dropped.values()) == mask.sum()
    assert (berry.crop_camera.width, berry.crop_camera.height) == berry.mask.shape[::-1]


def test_the_distance_is_that_of_the_middle() -> None:
    for distance in (0.25, 0.4, 0.6):
        frame, mask = ellipsoid_scene((0.0, 0.0, distance), (0.016,) * 3)
        berry = _seen(frame, one_berry(mask))
        assert berry.distance == pytest.approx(distance, abs=0.002)
        assert berry.outline.area * berry.scale**2 == pytest.approx(math.pi * 0.016**2, rel=0.03)
        assert berry.relief == pytest.approx(0.016, rel=0.07)


def test_key_points_are_those_that_are_known() -> None:
    frame, mask, _ = _scene()
    berries = with_keypoints(frame, one_berry(mask), CENTRE, HALF)
    assert berries.visibility is not None
    codes = berries.visibility.copy()
    codes[0, 2] = Visibility.ABSENT
    berry = _seen(frame, berries.with_fields(visibility=codes, ripeness=np.array([0.8])))
    assert np.isnan(berry.keypoints[2]).all()
    assert np.isfinite(berry.keypoints[[0, 1, 3, 4]]).all()
    assert berry.ripeness == 0.8
    bare = _seen(frame, one_berry(mask))
    assert np.isnan(bare.keypoints).all()
    assert (bare.visibility == Visibility.ABSENT).all()
    assert math.isnan(bare.ripeness)


def test_a_leak_to_the_background_is_no_part_of_the_berry() -> None:
    frame, mask, _ = _scene()
    rows, columns = np.nonzero(mask)
    leaking = mask.copy()
    leaking[rows.min() : rows.min() + 30, columns.max() : columns.max() + 40] = True
    berry = _seen(frame, one_berry(leaking))
    assert berry.dropped["other layer"] > 0
    assert berry.mask.sum() == pytest.approx(mask.sum(), rel=0.02)


def test_what_is_nearer_hides() -> None:
    frame, mask, depth = _scene()
    assert _seen(frame, one_berry(mask)).hidden == 0.0
    middle = int(np.nonzero(mask)[1].mean())
    depth[:, middle + 5 :] = 0.3
    mask[:, middle + 5 :] = False
    assert 0.15 < _seen(replace(frame, depth=depth), one_berry(mask)).hidden < 0.5


def test_no_berries() -> None:
    frame, _, _ = _scene()
    assert observe(frame, Strawberries.empty((480, 640))) == []


class TestRefusals:
    """Each lack has its sentence; nothing raises."""

    def test_depth(self) -> None:
        frame, mask, depth = _scene()
        berry = one_berry(mask)
        assert "no depth" in _reason(replace(frame, depth=None), berry)
        assert "no depth reading" in _reason(replace(frame, depth=np.zeros_like(depth)), berry)
        assert "millimetres" in _reason(replace(frame, depth=depth * 1000), berry)
        assert "not within" in _reason(replace(frame, depth=depth * 20), berry)
        assert "unit" in _reason(replace(frame, depth=depth / 1000), berry)

    def test_depth_that_is_not_a_number(self) -> None:
        frame, mask, depth = _scene()
        for value in (np.nan, np.inf, -1.0):
            with pytest.raises(ShapeError, match="finite metres"):
                replace(frame, depth=np.where(mask, value, depth))
        # A frame can be spoilt after it was made: its arrays are the caller's.
        assert frame.depth is not None
        frame.depth[mask] = np.nan
        assert "no depth reading" in _reason(frame, one_berry(mask))

    def test_camera(self) -> None:
        frame, mask, _ = _scene()
        assert "intrinsics" in _reason(replace(frame, camera=None), one_berry(mask))
        with pytest.raises(ShapeError, match="1280×720"):
            replace(frame, camera=CameraIntrinsics(1280, 720, 900.0, 900.0, 640.0, 360.0))

    def test_mask(self) -> None:
        frame, mask, _ = _scene()
        berry = one_berry(mask)
        assert "no mask" in _reason(frame, berry.with_fields(masks=None))
        assert "empty" in _reason(frame, one_berry(np.zeros_like(mask)))
        assert "the mask is" in _reason(frame, one_berry(mask[:-1]))
        assert "the mask is" in _reason(frame, one_berry(np.pad(mask, ((0, 100), (0, 0)))))
        three = np.zeros_like(mask)
        rows, columns = np.nonzero(mask)
        three[rows[0], columns[0] : columns[0] + 3] = True
        assert "only 3 pixels" in _reason(frame, one_berry(three))

    def test_hardly_a_reading(self) -> None:
        frame, mask, depth = _scene()
        sparse = np.zeros_like(depth)
        row, column = (int(part.mean()) for part in np.nonzero(mask))
        sparse[row, column : column + 5] = 0.39
        assert "only 5 depth readings" in _reason(replace(frame, depth=sparse), one_berry(mask))

    def test_a_scatter_of_pixels(self) -> None:
        frame, mask, _ = _scene()
        speckled = mask.copy()
        speckled[::2], speckled[:, ::2] = False, False
        assert "hardly anything" in _reason(frame, one_berry(speckled))

    @pytest.mark.parametrize("tilt", [0.0, 2e-4])
    def test_a_flat_picture_of_a_berry(self, tilt: float) -> None:
        frame, mask, _ = _scene()
        plane = (0.4 + tilt * np.arange(640)[None, :] * np.ones((480, 1))).astype(np.float32)
        assert "flat" in _reason(replace(frame, depth=plane), one_berry(mask))
        seen = StereoDepthModel().apply(plane, frame.rgb, np.random.default_rng(0))
        assert "flat" in _reason(replace(frame, depth=seen), one_berry(mask))

    def test_a_flat_cloud_of_few_points(self) -> None:
        frame, _, depth = _scene()
        small = np.zeros_like(depth, dtype=bool)
        small[100:108, 100:108] = True  # too few for a bulge, and all at one depth
        assert "flat" in _reason(replace(frame, depth=np.full_like(depth, 0.5)), one_berry(small))

    def test_one_bad_berry_leaves_the_others(self) -> None:
        frame, mask, _ = _scene()
        both = Strawberries(mask.shape, np.zeros((2, 4)), masks=np.stack([np.zeros_like(mask), mask]))
        first, second = observe(frame, both)
        assert first == "the mask is empty"
        assert isinstance(second, BerryObservation)


@given(du=st.integers(-150, 150), dv=st.integers(-120, 120))
@settings(max_examples=15, deadline=None)
def test_where_the_same_cloud_sits_in_the_picture_does_not_matter(du: int, dv: int) -> None:
    frame, mask = ellipsoid_scene((0.0, 0.0, 0.4), HALF)
    assert frame.depth is not None
    shifted = Frame(
        np.roll(frame.rgb, (dv, du), axis=(0, 1)),
        np.roll(frame.depth, (dv, du), axis=(0, 1)),
        CameraIntrinsics(640, 480, 615.0, 615.0, D435I.cx + du, D435I.cy + dv),
    )
    here, there = _seen(frame, one_berry(mask)), _seen(shifted, one_berry(np.roll(mask, (dv, du), (0, 1))))
    np.testing.assert_allclose(there.cloud, here.cloud, atol=1e-12)
    np.testing.assert_array_equal(there.mask, here.mask)
    assert there.scale == pytest.approx(here.scale, rel=1e-12)


@given(seed=st.integers(0, 2**32 - 1), fill=st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_nonsense_never_raises(seed: int, fill: float) -> None:
    rng = np.random.default_rng(seed)
    camera = CameraIntrinsics(80, 60, 90.0, 90.0, 39.5, 29.5)
    depth = np.where(rng.random((60, 80)) < fill, rng.uniform(0.05, 3.0, (60, 80)), 0.0).astype(np.float32)
    mask = rng.random((60, 80)) < rng.random()
    berry = observe(Frame(np.zeros((60, 80, 3), np.uint8), depth, camera), one_berry(mask))[0]
    if isinstance(berry, BerryObservation):
        assert len(berry.cloud) >= 20
        assert math.isfinite(berry.scale)
    else:
        assert berry
