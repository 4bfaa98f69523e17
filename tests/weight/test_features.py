"""Feature vectors: what they say of known bodies, and what must not change them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.weight import BerryObservation, observe
from punnet.weight.features import (
    FEATURES,
    FOREST_GROUPS,
    FOREST_PCA_GROUPS,
    SHAPE_GROUPS,
    feature_matrix,
    feature_names,
)
from tests.weight.scenes import D435I, ellipsoid_scene, one_berry, with_keypoints

ALL = tuple(FEATURES)
CENTRE, HALF = (0.03, -0.02, 0.4), (0.014, 0.018, 0.014)
Triple = tuple[float, float, float]


def _berry(
    centre: Triple = CENTRE, half: Triple = HALF, *, keypoints: bool = True, seed: int | None = None
) -> BerryObservation:
    frame, mask = ellipsoid_scene(centre, half)
    assert frame.depth is not None
    if seed is not None:
        seen = StereoDepthModel().apply(frame.depth, frame.rgb, np.random.default_rng(seed))
        frame = replace(frame, depth=seen)
    berries = one_berry(mask)
    if keypoints:
        berries = with_keypoints(frame, berries, centre, half)
    observation = observe(frame, berries)[0]
    assert isinstance(observation, BerryObservation), observation
    return observation


def _named(berry: BerryObservation) -> dict[str, float]:
    return dict(zip(feature_names(ALL), feature_matrix([berry], ALL)[0].tolist(), strict=True))


def test_the_vectors_of_the_thesis() -> None:
    assert feature_names(FOREST_GROUPS) == (
        "box_area_m2",
        "mask_area_m2",
        "nearest_m",
        *(f"depth_{k}" for k in range(12)),
    )
    assert len(feature_names(FOREST_PCA_GROUPS)) == len(feature_names(FOREST_GROUPS)) + 12
    assert all(words for group in FEATURES.values() for words in group.values())
    assert len(set(feature_names(ALL))) == len(feature_names(ALL))


def test_an_ellipsoid_is_measured() -> None:
    found = _named(_berry())
    assert found["length_m"] == pytest.approx(0.036, rel=0.03)
    assert found["width_m"] == pytest.approx(0.028, rel=0.03)
    assert found["keypoint_length_m"] == pytest.approx(0.036, rel=0.03)
    assert found["revolution_ml"] == pytest.approx(4 / 3 * math.pi * math.prod(HALF) * 1e6, rel=0.06)
    assert found["relief_ml"] == pytest.approx(found["revolution_ml"], rel=0.05)
    assert found["distance_m"] == pytest.approx(np.linalg.norm(CENTRE), abs=2e-3)
    assert found["aspect"] == pytest.approx(1.0, abs=0.06)
    assert found["elongation"] == pytest.approx(36 / 28, rel=0.03)
    assert found["stem_length_m"] == pytest.approx(0.02, rel=0.03)
    assert found["hidden"] == found["cut"] == found["without_axis"] == 0.0
    assert found["solidity"] == pytest.approx(1.0, abs=0.04)
    assert found["direction_0_y"] > 0.9
    assert sum(found[f"depth_{k}"] for k in range(12)) == pytest.approx(1.0, abs=1e-5)
    assert found["mask_area_m2"] == pytest.approx(math.pi * HALF[0] * HALF[1], rel=0.05)
    assert found["box_area_m2"] == pytest.approx(4 * HALF[0] * HALF[1], rel=0.08)


def test_a_box_that_lies_elsewhere_does_not_count() -> None:
    berry = _berry()
    rows, columns = berry.window
    own = np.array((columns.start, rows.start, columns.stop, rows.stop), dtype=np.float64)
    tight = _named(replace(berry, box=own))["box_area_m2"]
    for box in (np.zeros(4), own + 300.0):
        assert _named(replace(berry, box=box))["box_area_m2"] == pytest.approx(tight)
    twice = own + np.array((0.0, 0.0, 0.0, rows.stop - rows.start))
    assert _named(replace(berry, box=twice))["box_area_m2"] == pytest.approx(2.0 * tight)


def test_a_berry_cut_by_the_border_is_said_to_be() -> None:
    found = _named(_berry((-0.205, 0.0, 0.4), HALF, keypoints=False))
    assert found["cut"] > 0.2
    assert found["hidden"] > 0.1
    assert found["without_axis"] == 1.0


def test_no_berries_give_no_rows() -> None:
    assert feature_matrix([], SHAPE_GROUPS).shape == (0, len(feature_names(SHAPE_GROUPS)))


def test_a_batch_is_its_berries() -> None:
    berries = [_berry(), _berry((0.0, 0.05, 0.5), (0.012, 0.015, 0.012), keypoints=False)]
    both = feature_matrix(berries, ALL)
    for berry, row in zip(berries, both, strict=True):
        np.testing.assert_array_equal(feature_matrix([berry], ALL)[0], row)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_the_order_of_the_points_does_not_matter(seed: int) -> None:
    berry = _berry(seed=seed % 3)
    mixed = replace(berry, cloud=np.random.default_rng(seed).permutation(berry.cloud))
    np.testing.assert_allclose(
        feature_matrix([mixed], ALL), feature_matrix([berry], ALL), rtol=1e-4, atol=1e-6
    )


@given(du=st.integers(-150, 150), dv=st.integers(-120, 120))
@settings(max_examples=12, deadline=None)
def test_where_the_same_cloud_sits_in_the_picture_does_not_matter(du: int, dv: int) -> None:
    """Shift the picture and the principal point together: each pixel keeps its ray, so nothing may change."""
    frame, mask = ellipsoid_scene((0.0, 0.0, 0.4), HALF)
    assert frame.depth is not None
    shifted = Frame(
        np.roll(frame.rgb, (dv, du), axis=(0, 1)),
        np.roll(frame.depth, (dv, du), axis=(0, 1)),
        CameraIntrinsics(640, 480, 615.0, 615.0, D435I.cx + du, D435I.cy + dv),
    )
    rolled = one_berry(np.roll(mask, (dv, du), axis=(0, 1)))
    here, there = observe(frame, one_berry(mask))[0], observe(shifted, rolled)[0]
    assert isinstance(here, BerryObservation)
    assert isinstance(there, BerryObservation)
    np.testing.assert_allclose(
        feature_matrix([there], ALL), feature_matrix([here], ALL), rtol=1e-4, atol=1e-6
    )


@given(x=st.floats(-0.14, 0.14), y=st.floats(-0.10, 0.10))
@settings(max_examples=12, deadline=None)
def test_a_ball_measures_the_same_anywhere_at_its_distance(x: float, y: float) -> None:
    """Other rays, another drawing of the same ball: within what a pixel of the outline makes."""
    ball = (0.016,) * 3
    z = math.sqrt(0.4**2 - x * x - y * y)
    here, there = (_named(_berry(centre, ball)) for centre in ((0.0, 0.0, 0.4), (x, y, z)))
    for name, share in (
        ("length_m", 0.03),
        ("width_m", 0.03),
        ("revolution_ml", 0.07),
        ("visible_area_m2", 0.04),
    ):
        assert there[name] == pytest.approx(here[name], rel=share), name
    assert there["distance_m"] == pytest.approx(here["distance_m"], rel=0.003)
    assert there["aspect"] == pytest.approx(here["aspect"], abs=0.06)


@pytest.mark.parametrize("groups", [(), ("box", "box"), ("colour",), ("box", "shape")])
def test_unknown_groups_are_refused(groups: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError, match="groups"):
        feature_matrix([], groups)


def test_a_damaged_observation_is_refused() -> None:
    with pytest.raises(ShapeError):
        feature_matrix([replace(_berry(), cloud=np.full((30, 3), np.nan))], ("components",))
    with pytest.raises(ShapeError, match="ripeness"):
        feature_matrix([replace(_berry(), ripeness=math.inf)], ("ripeness",))
