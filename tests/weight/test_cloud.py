"""The berry's own points: edges, leaks and leaves in front left out; the bulge measured."""

from __future__ import annotations

import numpy as np
import pytest

from punnet.weight import berry_points, relief_height
from punnet.weight.cloud import depth_layer
from tests.weight.scenes import D435I, ellipsoid_scene

CENTRE, HALF = (0.03, -0.02, 0.4), (0.014, 0.018, 0.014)


def test_the_cloud_lies_on_the_berry() -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert frame.depth is not None
    cloud, dropped = berry_points(D435I, frame.depth, mask)
    assert 0.75 * mask.sum() < len(cloud) < mask.sum()
    np.testing.assert_allclose((((cloud - CENTRE) / HALF) ** 2).sum(axis=1), 1.0, atol=1e-3)
    assert dropped == {"no reading": 0, "edge": mask.sum() - len(cloud), "other layer": 0, "outlier": 0}


def test_a_leak_to_the_background_and_a_leaf_in_front_are_left_out() -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert frame.depth is not None
    depth = frame.depth.copy()
    rows, columns = np.nonzero(mask)
    depth[rows.min() : rows.min() + 15] = 0.36  # a leaf
    leaking = mask.copy()
    leaking[rows.max() - 20 : rows.max(), columns.min() - 25 : columns.min()] = True
    cloud, dropped = berry_points(D435I, depth, leaking)
    assert len(cloud) > 500
    assert dropped["other layer"] > 500
    assert len(cloud) + sum(dropped.values()) == leaking.sum()
    assert np.abs((((cloud - CENTRE) / HALF) ** 2).sum(axis=1) - 1.0).max() < 1e-3


def test_no_reading_gives_an_empty_cloud() -> None:
    _, mask = ellipsoid_scene(CENTRE, HALF)
    assert berry_points(D435I, np.zeros((480, 640), np.float32), mask)[0].shape == (0, 3)


def test_layers() -> None:
    near, far = np.linspace(0.40, 0.41, 300), np.linspace(0.50, 0.53, 200)
    low, high = depth_layer(np.concatenate((far, near)))
    assert low == pytest.approx(0.40, abs=1e-3)
    assert high == pytest.approx(0.41, abs=1e-3)
    assert np.isnan(depth_layer(np.zeros(0))).all()


def test_the_bulge_is_found_under_tilt_noise_and_steps() -> None:
    rng = np.random.default_rng(0)
    xy = rng.uniform(-1, 1, (4000, 2))
    rho = np.linalg.norm(xy, axis=1)
    xy, dome = xy[rho < 1], np.sqrt(1 - rho[rho < 1] ** 2)
    z = 0.4 + 0.003 * xy[:, 0] - 0.015 * dome + rng.normal(0, 7e-4, len(dome))
    points = np.column_stack((xy * 0.015, np.round(z, 3)))
    assert relief_height(points, dome) == pytest.approx(0.015, rel=0.03)
    points[:, 2] = 0.4 + 0.2 * xy[:, 0]
    assert relief_height(points, dome) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(relief_height(points[:10], dome[:10]))


def test_stray_readings_off_the_surface_are_left_out() -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    assert frame.depth is not None
    depth = frame.depth.copy()
    rows, columns = (int(part.mean()) for part in np.nonzero(mask))
    depth[rows, columns : columns + 6] += 0.010  # in the berry's layer, but not on its skin
    cloud, dropped = berry_points(D435I, depth, mask)
    assert dropped["outlier"] == 6
    np.testing.assert_allclose((((cloud - CENTRE) / HALF) ** 2).sum(axis=1), 1.0, atol=1e-3)
