"""Outlines: sizes of known shapes, wherever they are in the picture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from punnet.weight import hidden_share, measure_silhouette
from punnet.weight.silhouette import near_something_nearer, tidy_mask
from tests.weight.scenes import D435I, ellipsoid_scene


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.4), (0.17, 0.12, 0.4), (-0.18, 0.05, 0.4)])
def test_a_ball_has_the_outline_that_its_angle_gives_anywhere(centre: tuple[float, float, float]) -> None:
    radius = 0.015
    _, mask = ellipsoid_scene(centre, (radius,) * 3)
    outline = measure_silhouette(D435I, mask)
    sine = radius / np.linalg.norm(centre)
    tangent = sine / math.sqrt(1 - sine * sine)
    assert outline.area == pytest.approx(math.pi * tangent**2, rel=0.02)
    assert outline.length == pytest.approx(2 * tangent, rel=0.02)
    assert outline.width == pytest.approx(2 * tangent, rel=0.03)
    np.testing.assert_allclose(outline.R_view_camera @ outline.R_view_camera.T, np.eye(3), atol=1e-12)


def test_the_length_follows_the_axis_that_is_given() -> None:
    _, mask = ellipsoid_scene((0.0, 0.0, 0.4), (0.012, 0.020, 0.012))
    across = measure_silhouette(D435I, mask, np.array([[300.0, 240.0], [340.0, 240.0]]))
    along = measure_silhouette(D435I, mask)
    assert along.length / across.length == pytest.approx(20 / 12, rel=0.05)  # a pixel in 37
    assert along.area == pytest.approx(across.area)


def test_the_dome_is_one_in_the_middle_and_zero_outside() -> None:
    _, mask = ellipsoid_scene((0.0, 0.0, 0.4), (0.012, 0.020, 0.012))
    outline = measure_silhouette(D435I, mask)
    values = outline.dome(outline.centre + np.array([[0.0, 0.0], [0.0, 0.6 * 0.020 / 0.4], [0.1, 0.0]]))
    assert values[0] == pytest.approx(1.0)
    assert values[1] == pytest.approx(0.8, abs=0.02)  # √(1 − .6²)
    assert values[2] == 0.0


def test_a_line_of_pixels_is_measured_too() -> None:
    mask = np.zeros((480, 640), dtype=bool)
    mask[100, 200:230] = True
    assert measure_silhouette(D435I, mask).area > 0


def test_tidying_keeps_the_largest_piece() -> None:
    mask = np.zeros((50, 60), dtype=bool)
    mask[10:30, 10:30] = True
    mask[40:45, 50:55] = True  # a piece
    mask[20, 30:50] = True  # a thread
    tidy = tidy_mask(mask)
    assert tidy.sum() == 400
    assert not tidy_mask(np.zeros((5, 5), dtype=bool)).any()


def test_hidden_share_counts_only_what_is_nearer() -> None:
    depth = np.full((100, 100), 0.5, dtype=np.float32)
    mask = np.zeros((100, 100), dtype=bool)
    mask[30:70, 30:70] = True
    assert hidden_share(mask, near_something_nearer(depth, mask, 0.4)) == 0.0
    depth[:, 70:] = 0.3
    assert hidden_share(mask, near_something_nearer(depth, mask, 0.4)) == pytest.approx(0.25, abs=0.05)
    mask[:, :] = False
    mask[30:70, :40] = True  # cut by the picture's border
    near = near_something_nearer(np.full_like(depth, 0.5), mask, 0.4)
    assert hidden_share(mask, near) == pytest.approx(0.25, abs=0.06)
