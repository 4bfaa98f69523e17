from __future__ import annotations

import numpy as np
import pytest

from punnet.errors import ShapeError
from punnet.train.weight.surface import rebuild_surface, sample_surface
from tests.train.weight.domes import dome


def test_a_dome_is_rebuilt_where_it_is() -> None:
    berry = dome(radius=0.015, length=0.02, distance=0.3)
    surface = rebuild_surface(berry.cloud)
    points = sample_surface(surface, 4000, np.random.default_rng(0))
    x, y = points[:, 0] / points[:, 2] * 0.3 / 0.015, points[:, 1] / points[:, 2] * 0.3 / 0.02
    rho = np.hypot(x - 0.1 / 30, y - 0.1 / 40)
    inner = rho < 0.8
    expected = 0.3 - 0.015 * np.sqrt(1 - rho[inner] ** 2)
    assert np.abs(points[inner, 2] - expected).max() < 2e-3
    assert np.median(np.abs(points[inner, 2] - expected)) < 5e-4


def test_smoothing_takes_the_steps_out_of_coarse_depth() -> None:
    berry = dome(distance=0.3)
    stepped = berry.cloud * (np.round(berry.cloud[:, 2] / 0.004) * 0.004 / berry.cloud[:, 2])[:, None]
    surface = rebuild_surface(stepped)
    order = np.lexsort(stepped.T)
    true = berry.cloud[order, 2]
    before = np.abs(stepped[order, 2] - true)
    after = np.abs(surface.vertices[:, 2] - true)
    assert len(surface.vertices) == len(stepped)
    assert after.mean() < 0.75 * before.mean()


def test_samples_are_even_over_the_area() -> None:
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 21), np.linspace(-0.01, 0.01, 21))
    slope = np.column_stack((x.ravel(), y.ravel(), 0.3 + 0.0 * x.ravel()))
    # A third of the points lie in one corner: evenness must not follow them.
    generator = np.random.default_rng(5)
    corner = np.column_stack((generator.uniform(0.005, 0.0099, (200, 2)), np.full(200, 0.3)))
    points = sample_surface(rebuild_surface(np.vstack((slope, corner))), 20000, generator)
    counts = np.histogram2d(points[:, 0], points[:, 1], bins=4, range=[[-0.01, 0.01]] * 2)[0]
    np.testing.assert_allclose(counts, 20000 / 16, rtol=0.15)


def test_no_triangle_spans_a_gap() -> None:
    left, right = dome(radius=0.01, length=0.012), dome(radius=0.01, length=0.012, centre=(200, 120))
    surface = rebuild_surface(np.vstack((left.cloud, right.cloud)))
    points = sample_surface(surface, 3000, np.random.default_rng(0))
    edge_left, edge_right = left.cloud[:, 0].max(), right.cloud[:, 0].min()
    assert edge_right - edge_left > 0.015
    assert not ((points[:, 0] > edge_left + 1e-3) & (points[:, 0] < edge_right - 1e-3)).any()


@pytest.mark.parametrize(
    "cloud",
    [
        np.array([[0.0, 0.0, 0.3]]),
        np.array([[0.0, 0.0, 0.3], [0.001, 0.0, 0.3]]),
        np.column_stack((np.linspace(0, 0.01, 30), np.zeros(30), np.full(30, 0.3))),
        np.repeat([[0.0, 0.0, 0.3]], 25, axis=0),
    ],
    ids=["one point", "two points", "a line", "the same point"],
)
def test_clouds_without_a_surface_give_their_points(cloud: np.ndarray) -> None:
    points = sample_surface(rebuild_surface(cloud), 64, np.random.default_rng(0))
    assert points.shape == (64, 3)
    nearest = np.linalg.norm(points[:, None] - cloud, axis=2).min(axis=1)
    assert nearest.max() < 1e-9


@pytest.mark.parametrize(
    ("cloud", "message"),
    [
        (np.empty((0, 3)), "P ≥ 1"),
        (np.zeros((4, 2)), "P ≥ 1"),
        (np.array([[0.0, 0.0, np.nan]]), "finite"),
        (np.array([[0.0, 0.0, -0.3]]), "before the camera"),
    ],
)
def test_what_is_no_cloud_is_refused(cloud: np.ndarray, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        rebuild_surface(cloud)
