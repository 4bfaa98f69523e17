"""Berries: watertight, of the measured masses, with key-points and an ellipsoid that fit them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from punnet.sim.berry import MASS_RANGE, make_berry
from punnet.sim.berry_shape import BerryForm, draw_shape
from punnet.sim.ripeness import RipenessStage

STAGES = list(RipenessStage)


def welded_edges(mesh):
    """Directed edges after merging vertices at the same place."""
    _, index = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    return [(f[i], f[(i + 1) % 3]) for f in faces for i in range(3)]


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 10_000), stage=st.sampled_from(STAGES))
def test_mesh_is_closed_oriented_and_small(seed, stage):
    berry = make_berry(np.random.default_rng(seed), stage)
    edges = welded_edges(berry.mesh)
    assert len(set(edges)) == len(edges)  # no edge twice in the same direction …
    assert set(edges) == {(b, a) for a, b in edges}  # … and each once in the other
    assert berry.volume > 0  # outward
    assert len(berry.mesh.faces) <= 1600


def test_volume_is_a_little_less_than_the_convex_hull():
    # independent source: qhull; a berry is nearly convex
    for seed in range(5):
        berry = make_berry(np.random.default_rng(seed), RipenessStage.RIPE)
        hull = ConvexHull(berry.mesh.vertices).volume
        assert 0.93 * hull < berry.volume <= hull * (1 + 1e-9)


def test_ripe_masses_follow_the_measured_distribution():
    rng = np.random.default_rng(3)
    berries = [make_berry(rng, RipenessStage.RIPE) for _ in range(400)]
    masses = np.array([berry.mass for berry in berries])
    assert masses.mean() == pytest.approx(18.6, abs=1.0)
    assert masses.std() == pytest.approx(5.7, abs=0.8)
    assert MASS_RANGE[0] <= masses.min() <= masses.max() <= MASS_RANGE[1]
    lengths = np.array([berry.length for berry in berries])
    widths = np.array([berry.width for berry in berries])
    assert 0.034 < np.median(lengths) < 0.045
    assert 0.028 < np.median(widths) < 0.038
    density = np.array([berry.density for berry in berries])
    assert density.min() >= 0.85
    assert density.max() <= 1.0
    assert density.std() > 0.01


def test_real_berry_masses_lie_where_ours_do(shared_data):
    rows = (shared_data / "dyson" / "berry_weights_g.csv").read_text().splitlines()
    weight = rows[0].split(",").index("weight_g") if "weight_g" in rows[0] else 1
    real = np.array([float(row.split(",")[weight]) for row in rows[1:]])
    rng = np.random.default_rng(1)
    ours = np.array([make_berry(rng, RipenessStage.RIPE).mass for _ in range(300)])
    assert np.median(ours) == pytest.approx(np.median(real), rel=0.12)


def test_younger_berries_are_smaller():
    rng = np.random.default_rng(0)
    masses = [np.mean([make_berry(rng, stage).mass for _ in range(30)]) for stage in STAGES[:4]]
    assert masses == sorted(masses)


def test_shapes_reach_from_round_to_long():
    rng = np.random.default_rng(0)
    berries = [make_berry(rng, RipenessStage.RIPE) for _ in range(200)]
    elongation = [berry.length / berry.width for berry in berries]
    assert np.percentile(elongation, 5) < 1.05
    assert np.percentile(elongation, 95) > 1.5


def test_wedges_are_flat_and_globose_berries_rounder_than_conic_ones():
    rng = np.random.default_rng(0)
    drawn = {form: [draw_shape(rng, form, (1.32, 0.16)) for _ in range(100)] for form in BerryForm}
    for shape in drawn[BerryForm.WEDGE]:
        assert shape.depth <= 0.83 * shape.width
    for shape in drawn[BerryForm.CONIC]:
        assert shape.depth > 0.9 * shape.width
    conic, globose = (
        np.median([1.0 / shape.width for shape in drawn[f]]) for f in (BerryForm.CONIC, BerryForm.GLOBOSE)
    )
    assert globose == pytest.approx(0.88 * conic, rel=0.08)


def test_frame_and_keypoints():
    berry = make_berry(np.random.default_rng(5), RipenessStage.RIPE)
    np.testing.assert_allclose(berry.keypoints["top"], 0.0, atol=1e-12)
    assert berry.keypoints["bottom"][2] == berry.mesh.vertices[:, 2].min()
    assert berry.keypoints["left_grasp"][0] < -0.4 * berry.width
    assert berry.keypoints["right_grasp"][0] > 0.4 * berry.width
    assert berry.mass == pytest.approx(berry.volume * 1e6 * berry.density)


def test_ellipsoid_has_the_moments_of_the_solid():
    # independent source: points thrown into the hull of the berry
    berry = make_berry(np.random.default_rng(2), RipenessStage.RIPE)
    hull = ConvexHull(berry.mesh.vertices)
    rng = np.random.default_rng(0)
    points = rng.uniform(berry.mesh.vertices.min(axis=0), berry.mesh.vertices.max(axis=0), (40_000, 3))
    inside = points[(points @ hull.equations[:, :3].T + hull.equations[:, 3] <= 0).all(axis=1)]
    np.testing.assert_allclose(inside.mean(axis=0), berry.centre, atol=0.0006)
    np.testing.assert_allclose(np.sqrt(5.0) * inside.std(axis=0), berry.semi_axes, rtol=0.03)


def test_texture_says_the_stage():
    means = {}
    for stage in STAGES:
        berry = make_berry(np.random.default_rng(7), stage)
        assert berry.texture.shape == (256, 256, 3)
        assert berry.texture.dtype == np.uint8
        means[stage] = berry.texture.reshape(-1, 3).mean(axis=0)
    red, green, _ = means[RipenessStage.RIPE]
    assert red > 3.0 * green
    assert means[RipenessStage.GREEN][1] > means[RipenessStage.GREEN][0]  # green
    assert means[RipenessStage.WHITE].min() > 110  # pale
    assert means[RipenessStage.OVERRIPE][0] < 0.75 * red  # dark
    turning = make_berry(np.random.default_rng(7), RipenessStage.TURNING).texture.astype(float)
    assert (turning[..., 1] / turning[..., 0])[:40].mean() > 1.5 * (turning[..., 1] / turning[..., 0])[
        -80:
    ].mean()


def test_texture_closes_around_the_berry():
    texture = make_berry(np.random.default_rng(4), RipenessStage.RIPE).texture.astype(float)
    middle = slice(60, 200)
    across_seam = np.abs(texture[middle, 0] - texture[middle, -1]).mean()
    elsewhere = np.abs(np.diff(texture[middle], axis=1)).mean()
    assert across_seam < 2.0 * elsewhere


def test_same_generator_same_berry_another_another():
    first, again = (make_berry(np.random.default_rng(9), RipenessStage.RIPE) for _ in range(2))
    np.testing.assert_array_equal(first.mesh.vertices, again.mesh.vertices)
    np.testing.assert_array_equal(first.texture, again.texture)
    other = make_berry(np.random.default_rng(10), RipenessStage.RIPE)
    assert not np.allclose(first.mesh.vertices, other.mesh.vertices)
