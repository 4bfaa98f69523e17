"""Calyces: around the attachment, as large as the berry asks, clear of the flesh, visible from both sides."""

import numpy as np
import pytest
from scipy.interpolate import griddata

from punnet.sim.berry import make_berry
from punnet.sim.calyx import calyx_texture, make_calyx
from punnet.sim.ripeness import RipenessStage


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
    for seed in range(30):
        rng = np.random.default_rng(seed)
        berry = make_berry(rng, RipenessStage.RIPE)
        calyx = make_calyx(rng, berry.width, size=berry.calyx_size)
        hidden.append(_inside(berry, calyx.vertices).mean())
    assert np.mean(hidden) < 0.15


def _inside(berry, points):
    """Points more than half a millimetre below the skin of the shoulders."""
    shoulders = berry.mesh.vertices[berry.mesh.uv[:, 1] < 0.45]
    heights = griddata(shoulders[:, :2], shoulders[:, 2], points[:, :2])  # NaN beside the fruit
    return points[:, 2] < heights - 0.0005


def test_texture_is_green():
    for seed in range(3):
        texture = calyx_texture(np.random.default_rng(seed))
        red, green, blue = texture[:50].reshape(-1, 3).mean(axis=0)
        assert green > red > blue
