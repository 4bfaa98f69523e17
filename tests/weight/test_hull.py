"""Hulls of bodies whose components are known, in any order, density and layering."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from punnet.errors import ShapeError
from punnet.weight import hull as hull_module
from punnet.weight.hull import hull_components


def _box(half: tuple[float, float, float]) -> np.ndarray:
    return np.array(np.meshgrid(*((-h, h) for h in half)), dtype=float).reshape(3, -1).T


def test_a_box() -> None:
    """Surface of a box a × b × c (half): the variance along x is Σ over faces of its second moment, over the area."""
    a, b, c = half = (0.02, 0.015, 0.01)
    found = hull_components(_box(half))
    faces = np.array([b * c, a * c, a * b]) * 8.0
    second = [
        (faces[0] * a**2 + (faces[1] + faces[2]) * a**2 / 3),
        (faces[1] * b**2 + (faces[0] + faces[2]) * b**2 / 3),
        (faces[2] * c**2 + (faces[0] + faces[1]) * c**2 / 3),
    ]
    np.testing.assert_allclose(found.deviations, np.sqrt(np.array(second) / faces.sum()), rtol=1e-9)
    np.testing.assert_allclose(found.extents, 2 * np.array(half), rtol=1e-9)
    np.testing.assert_allclose(found.directions, np.eye(3), atol=1e-9)
    assert found.area == pytest.approx(faces.sum())
    assert found.volume == pytest.approx(8 * a * b * c)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_turning_the_body_turns_the_components(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3)) * (0.02, 0.012, 0.006)
    R = Rotation.random(random_state=seed).as_matrix()
    still, turned = hull_components(points), hull_components(points, R)
    np.testing.assert_allclose(turned.deviations, still.deviations, rtol=1e-6)
    alike = np.abs(np.einsum("ij,ij->i", turned.directions, still.directions @ R.T))
    np.testing.assert_allclose(alike, 1.0, atol=1e-6)
    largest = np.take_along_axis(turned.directions, np.abs(turned.directions).argmax(axis=1)[:, None], axis=1)
    assert (largest > 0).all()


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_order_and_inner_points_do_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(80, 3)) * (0.02, 0.012, 0.006)
    more = rng.permutation(np.vstack((points, points[:40] * 0.3)))
    here, there = hull_components(points), hull_components(more)
    for name in ("directions", "deviations", "extents", "area", "volume"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), rtol=1e-6, atol=1e-9)


def test_looking_at_layers_one_by_one_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    xy = rng.uniform(-0.015, 0.015, (2000, 2))
    z = np.round(0.4 + 15.0 * (xy**2).sum(axis=1), 3)  # whole millimetres, as depth cameras give them
    points = np.column_stack((xy, z))
    layered = hull_components(points)
    monkeypatch.setattr(hull_module, "_MOST_LAYERED", 10**9)
    whole = hull_components(points)
    assert layered.volume == pytest.approx(whole.volume, rel=1e-6)
    np.testing.assert_allclose(layered.deviations, whole.deviations, rtol=1e-6)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((3, 3)),
        np.ones((50, 3)),
        np.column_stack((np.random.default_rng(0).random((50, 2)), np.full(50, 0.4))),
        np.zeros((5, 2)),
        np.full((5, 3), np.nan),
    ],
)
def test_what_has_no_hull_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ShapeError, match="hull"):
        hull_components(points)
