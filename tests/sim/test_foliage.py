"""Leaves and flowers: three two-sided leaflets with a photograph on each, in the frame that stems expect."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.sim.flower import make_flower
from punnet.sim.foliage import LEAF_TEXTURES, leaf_texture, make_leaf


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10_000), size=st.floats(0.02, 1.0))
def test_leaf_is_cheap_two_sided_and_in_its_frame(seed, size):
    leaf = make_leaf(np.random.default_rng(seed), size)
    assert len(leaf.mesh.faces) <= 250
    assert leaf.mesh.uv is not None
    assert leaf.mesh.uv.min() >= 0
    assert leaf.mesh.uv.max() <= 1
    corners = leaf.mesh.vertices[leaf.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / size**2
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=0.15)  # upper and lower faces cancel
    upper = leaf.mesh.uv[leaf.mesh.faces][..., 0].max(axis=1) <= 0.5
    assert normals[upper].sum(axis=0)[2] > 0.5 * np.linalg.norm(normals[upper], axis=1).sum()
    extent = leaf.mesh.vertices / size
    assert 0.7 < extent[:, 0].max() < 1.15
    assert extent[:, 0].min() > -0.7
    assert np.linalg.norm(leaf.mesh.vertices, axis=1).min() < 0.12 * size  # leaflets start at the petiole


def test_leaf_without_size_is_refused():
    with pytest.raises(ConfigurationError, match="size"):
        make_leaf(np.random.default_rng(0), 0.0)


def test_every_photograph_loads_green_with_a_paler_back():
    for number in range(LEAF_TEXTURES):
        texture = leaf_texture(np.random.default_rng(number), number).astype(float)
        assert texture.shape == (192, 384, 3)
        upper, lower = (
            texture[:, :192].reshape(-1, 3).mean(axis=0),
            texture[:, 192:].reshape(-1, 3).mean(axis=0),
        )
        assert upper[1] > max(upper[0], upper[2])
        assert lower.mean() > upper.mean()


def test_photograph_that_is_not_there_is_refused():
    with pytest.raises(ConfigurationError, match="leaf_texture"):
        leaf_texture(np.random.default_rng(0), LEAF_TEXTURES)


def test_flower_opens_upwards_white_around_yellow():
    for seed in range(6):
        flower = make_flower(np.random.default_rng(seed))
        assert 0.02 < flower.diameter < 0.035
        assert len(flower.mesh.faces) <= 260
        radius = np.linalg.norm(flower.mesh.vertices[:, :2], axis=1).max()
        assert radius == pytest.approx(flower.diameter / 2, rel=0.25)
        assert flower.mesh.vertices[:, 2].max() > abs(flower.mesh.vertices[:, 2].min())
        petal, centre = flower.texture[:, :32].mean(axis=(0, 1)), flower.texture[:, 32:64].mean(axis=(0, 1))
        assert petal.min() > 225
        assert centre[0] > 1.8 * centre[2]
