from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.perception.axis import berry_axis, filled_hull, find_stem, fruit_keypoints
from punnet.perception.keypoints import KeypointConfig

UP = np.array([0.0, -1.0])


def ellipse(angle_deg: float = 0.0, long: int = 40, short: int = 26) -> np.ndarray:
    mask = np.zeros((160, 160), np.uint8)
    cv2.ellipse(mask, (80, 80), (short, long), angle_deg, 0, 360, 1, cv2.FILLED)
    return mask


def test_upright_ellipse() -> None:
    mask = ellipse()
    axis = berry_axis(mask, np.zeros_like(mask), UP)
    assert axis.centre == pytest.approx([80, 80], abs=0.5)
    assert axis.up == pytest.approx([0, -1], abs=0.02)
    expected = [[80, 40], [80, 120], [54, 80], [106, 80]]
    assert np.abs(fruit_keypoints(mask, axis) - expected).max() < 2


@settings(max_examples=20, deadline=None)
@given(st.floats(-50, 50))
def test_axis_leans_the_way_the_fruit_does(angle: float) -> None:
    mask = ellipse(angle)
    axis = berry_axis(mask, np.zeros_like(mask), UP)
    lean = np.degrees(np.arctan2(axis.up[0], -axis.up[1]))
    assert np.linalg.norm(axis.up) == pytest.approx(1)
    # Between gravity and the fruit's own axis, never beyond either.
    assert min(0, angle) - 2 <= lean <= max(0, angle) + 2


def test_calyx_pulls_the_axis() -> None:
    mask = ellipse(long=30, short=30)
    leaf = np.zeros_like(mask)
    cv2.circle(leaf, (115, 60), 14, 1, cv2.FILLED)
    leaf &= 1 - mask
    axis = berry_axis(mask, leaf, UP)
    assert axis.up[0] > 0.3
    assert 0 < axis.calyx_evidence <= 1


def test_sepals_over_the_fruit_do_not_bend_the_axis() -> None:
    mask = ellipse()
    cv2.ellipse(mask, (88, 44), (10, 14), 0, 0, 360, 0, cv2.FILLED)
    axis = berry_axis(mask, np.zeros_like(mask), UP)
    assert abs(axis.up[0]) < 0.1
    assert fruit_keypoints(mask, axis)[0] == pytest.approx([80, 43], abs=5)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_shape_gives_finite_points_in_its_hull(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = np.zeros((40, 40), np.uint8)
    for _ in range(rng.integers(1, 4)):
        u, v, width, height = rng.integers(5, 30), rng.integers(5, 30), rng.integers(1, 9), rng.integers(1, 9)
        mask[v : v + height, u : u + width] = 1
    axis = berry_axis(mask, np.zeros_like(mask), UP)
    points = fruit_keypoints(mask, axis)
    v, u = np.nonzero(filled_hull(mask))
    assert np.isfinite(points).all()
    assert (points >= [u.min() - 1.5, v.min() - 1.5]).all()
    assert (points <= [u.max() + 1.5, v.max() + 1.5]).all()


def test_left_is_left_in_the_image_of_an_upright_berry() -> None:
    mask = ellipse()
    assert berry_axis(mask, np.zeros_like(mask), UP).left == pytest.approx([-1, 0], abs=0.02)


def test_stem_that_leads_to_the_calyx_beats_a_nearer_one() -> None:
    leaf = np.zeros((100, 100), np.uint8)
    cv2.line(leaf, (50, 60), (62, 20), 1, 2)
    leaf[:, 46:48] = 1
    leaf[30:60, 46:48] = 0
    stem = find_stem(leaf, np.array([50.0, 60.0]), np.array([50.0, 24.0]), reach=20, thickness=6)
    assert stem is not None
    assert stem[0] == pytest.approx(61, abs=1.5)


def test_leaves_and_nothing_are_no_stem() -> None:
    top, expected = np.array([50.0, 60.0]), np.array([50.0, 40.0])
    assert find_stem(np.zeros((100, 100), np.uint8), top, expected, reach=15, thickness=5) is None
    assert find_stem(np.ones((100, 100), np.uint8), top, expected, reach=15, thickness=5) is None


def test_stem_is_looked_for_within_the_image_only() -> None:
    leaf = np.ones((20, 20), np.uint8)
    assert find_stem(leaf, np.array([10.0, 3.0]), np.array([10.0, -30.0]), reach=5, thickness=4) is None


def test_key_point_settings_must_be_positive() -> None:
    with pytest.raises(ConfigurationError, match="picking_height"):
        KeypointConfig(picking_height=0.0)
