"""Calyces: around the attachment, as large as the berry asks, clear of the flesh, visible from both sides."""

import numpy as np
import pytest

from punnet.sim.berry import RipenessStage, make_berry
from punnet.sim.calyx import calyx_texture, make_calyx


@pytest.mark.parametrize("width", [0.014, 0.032])
def test_size_and_place(width):
    for seed in range(5):
        calyx = make_calyx(np.random.default_rng(seed), width)
        radius = np.linalg.norm(calyx.vertices[:, :2], axis=1)
        assert 0.2 * width < radius.max() < 1.1 * width
        assert np.linalg.norm(calyx.vertices[:, :2].mean(axis=0)) < 0.2 * width
        assert len(calyx.faces) <= 260
        assert calyx.uv is not None
        assert calyx.uv.min() >= 0
        assert calyx.uv.max() <= 1


def test_every_face_has_one_that_looks_the_other_way():
    calyx = make_calyx(np.random.default_rng(0), 0.03)
    corners = calyx.vertices[calyx.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)
    up = normals[:, 2] > 0
    assert up.sum() == len(normals) // 2


def test_most_of_it_lies_outside_the_fruit():
    hidden = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        berry = make_berry(rng, RipenessStage.RIPE)
        calyx = make_calyx(rng, berry.width)
        hidden.append(_inside(berry, calyx.vertices).mean())
    assert np.mean(hidden) < 0.15


def _inside(berry, points):
    """Points below the skin: nearer to the axis than the berry's ring at their height."""
    vertices = berry.mesh.vertices
    ring = np.argsort(vertices[:, 2])
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    skin_azimuth = np.arctan2(vertices[:, 1], vertices[:, 0])
    inside = np.zeros(len(points), dtype=bool)
    for number, point in enumerate(points):
        apart = np.abs(np.angle(np.exp(1j * (skin_azimuth[ring] - azimuth[number]))))
        near = ring[(apart < 0.12) & (np.linalg.norm(vertices[ring, :2], axis=1) > 1e-6)]
        heights, radii = vertices[near, 2], np.linalg.norm(vertices[near, :2], axis=1)
        upper = heights > heights[np.argmax(radii)]
        order = np.argsort(radii[upper])
        surface = np.interp(np.hypot(*point[:2]), radii[upper][order], heights[upper][order])
        inside[number] = point[2] < surface - 0.0005
    return inside


def test_texture_is_green():
    for seed in range(3):
        texture = calyx_texture(np.random.default_rng(seed))
        red, green, blue = texture[:50].reshape(-1, 3).mean(axis=0)
        assert green > red > blue
