"""A berry's outline completed from the edges that are its own."""

from __future__ import annotations

import numpy as np
import pytest

from punnet.weight.completion import complete_outline, trace_contour
from punnet.weight.silhouette import near_something_nearer


def tapered(length: float, width: float, taper: float = 0.15, points: int = 48) -> np.ndarray:
    """(K, 2) along and across from the top, metres."""
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    u = np.cos(angle)
    across = width / 2.0 * np.sin(angle) * (1.0 - taper * u)
    return np.column_stack((length / 2.0 * (1.0 + u), across))


@pytest.mark.parametrize(("length", "width"), [(0.030, 0.024), (0.042, 0.031), (0.052, 0.045)])
def test_a_whole_outline_is_found_again(length: float, width: float) -> None:
    points = tapered(length, width)
    found = complete_outline(points, np.zeros(len(points), np.bool_), points)
    assert found.length == pytest.approx(length, rel=0.02)
    assert found.width == pytest.approx(width, rel=0.02)
    assert found.own == 1.0
    assert found.misfit < 0.03
    u = np.linspace(-1.0, 1.0, 2001)
    half = found.width / 2.0 * np.sqrt(1.0 - u**2) * (1.0 - found.taper * u)
    turned = np.pi * np.trapezoid(half**2, u) * found.length / 2.0
    assert found.volume == pytest.approx(turned, rel=1e-3)


def test_what_a_leaf_covers_is_put_back() -> None:
    """The lower two fifths are behind a leaf with a straight edge: nearer the truth than what shows, and less certain."""
    points = tapered(0.045, 0.034)
    cut = 0.027
    covered = points[:, 0] > cut
    shown = np.column_stack((np.minimum(points[:, 0], cut), points[:, 1]))
    whole = complete_outline(points, np.zeros(len(points), np.bool_), points)
    found = complete_outline(shown, covered, shown)
    assert abs(found.length - 0.045) < 0.3 * (0.045 - cut)
    assert found.uncertainty > 1.5 * whole.uncertainty
    assert found.own == pytest.approx(1.0 - covered.mean())


def test_without_edges_it_is_what_berries_are_like() -> None:
    found = complete_outline(np.empty((0, 2)), np.empty(0, np.bool_), tapered(0.04, 0.03))
    assert (found.own, found.misfit) == (0.0, 0.0)
    assert 0.03 < found.length < 0.045
    assert found.uncertainty > 0.5


def disc(shape: tuple[int, int], middle: tuple[int, int], radius: int) -> np.ndarray:
    v, u = np.indices(shape)
    return (v - middle[0]) ** 2 + (u - middle[1]) ** 2 <= radius**2


def test_a_contour_is_covered_where_something_nearer_begins_and_in_notches() -> None:
    mask = disc((120, 120), (60, 60), 30)
    depth = np.where(mask, 0.4, 0.6).astype(np.float32)
    pixels, covered = trace_contour(mask, near_something_nearer(depth, mask, 0.39))
    assert not covered.any()
    np.testing.assert_allclose(np.hypot(*(pixels - 60.0).T), 30.0, atol=1.0)
    leaf = depth.copy()
    leaf[75:] = 0.3
    shown = mask.copy()
    shown[75:] = False
    pixels, covered = trace_contour(shown, near_something_nearer(leaf, shown, 0.39))
    assert covered[pixels[:, 1] == 74].all()
    assert not covered[pixels[:, 1] < 65].any()
    bitten = mask & ~disc((120, 120), (60, 100), 20)  # a neighbour, as near
    pixels, covered = trace_contour(bitten, near_something_nearer(depth, bitten, 0.39))
    assert covered[(np.abs(pixels[:, 1] - 60.0) < 5) & (pixels[:, 0] > 60)].all()
    assert not covered[pixels[:, 0] < 60].any()


def test_the_picture_s_border_covers() -> None:
    mask = disc((100, 100), (50, 95), 25)
    near = near_something_nearer(np.full((100, 100), 0.4, np.float32), mask, 0.39)
    _, covered = trace_contour(mask, near)
    assert 0.1 < covered.mean() < 0.6
