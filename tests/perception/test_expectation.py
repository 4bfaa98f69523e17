"""What probabilities promise, held against counting and against looking everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from punnet.perception.expectation import expected_iou, place_keypoints
from punnet.perception.metrics import KEYPOINT_SIGMAS as SIGMAS

CELLS = 28
REGION = np.array([[100.0, 50.0, 184.0, 190.0]], dtype=np.float32)
AREA = np.array([3000.0])


def expected_oks(heatmap: np.ndarray, point: np.ndarray, sigma: float) -> float:
    """By its definition: the similarity to each cell's middle, weighed by how likely the key-point lies there."""
    v, u = np.mgrid[:CELLS, :CELLS]
    sides = (REGION[0, 2:] - REGION[0, :2]) / CELLS
    x, y = REGION[0, 0] + (u + 0.5) * sides[0], REGION[0, 1] + (v + 0.5) * sides[1]
    likely = np.exp(heatmap - heatmap.max())
    distance = (x - point[0]) ** 2 + (y - point[1]) ** 2
    similarity = np.exp(-distance / (2 * (2 * sigma) ** 2 * AREA[0]))
    return float((likely / likely.sum() * similarity).sum())


def test_the_iou_to_expect_is_the_mean_over_drawn_outlines(rng: np.random.Generator) -> None:
    v, u = np.mgrid[:56, :56] / 56 - 0.5
    mask = (1 / (1 + np.exp(25 * (np.hypot(u, v) - 0.3)))).astype(np.float32)
    inside = mask > 0.5
    drawn = rng.random((4000, 56, 56), dtype=np.float32) < mask
    ious = (drawn & inside).sum(axis=(1, 2)) / (drawn | inside).sum(axis=(1, 2))
    assert expected_iou(mask[None], 0.5) == pytest.approx(ious.mean(), abs=2e-3)


def test_sure_masks_expect_everything_and_empty_ones_nothing() -> None:
    masks = np.zeros((3, 14, 14), dtype=np.float32)
    masks[0, 3:9, 4:10] = 1.0
    masks[1] = 0.3
    assert expected_iou(masks, 0.5).tolist() == [1.0, 0.0, 0.0]
    assert expected_iou(masks[:0], 0.5).shape == (0,)


@pytest.mark.parametrize("kind", range(5))
def test_a_point_lies_where_most_similarity_is_expected(rng: np.random.Generator, kind: int) -> None:
    v, u = np.mgrid[:CELLS, :CELLS]
    for _ in range(8):
        places, widths = rng.uniform(4, CELLS - 4, (3, 2)), rng.uniform(1, 4, 3)
        heatmap = np.logaddexp.reduce(
            [
                -((u - x) ** 2 + (v - y) ** 2) / (2 * w * w) - 2 * np.log(w)
                for (x, y), w in zip(places, widths, strict=True)
            ]
        ).astype(np.float32)
        maps = np.repeat(heatmap[None, None], 5, axis=1)
        points, similarity = place_keypoints(maps, REGION, AREA, SIGMAS)
        ours = expected_oks(heatmap, points[0, kind], SIGMAS[kind])
        x, y = np.linspace(100, 184, 57), np.linspace(50, 190, 57)
        best = max(expected_oks(heatmap, np.array([a, b]), SIGMAS[kind]) for a in x for b in y)
        assert ours >= 0.99 * best
        assert similarity[0, kind] == pytest.approx(ours, rel=0.05)


def test_of_two_places_the_one_with_more_around_it_is_taken() -> None:
    maps = np.full((1, 5, CELLS, CELLS), -20.0, dtype=np.float32)
    maps[0, :, 5, 5] = 0.0  # the highest cell, alone
    maps[0, :, 19:22, 19:22] = -0.5  # nine that are nearly as high
    points, similarity = place_keypoints(maps, REGION, AREA, SIGMAS)
    assert points[0, 0] == pytest.approx([100 + 20.5 * 3, 50 + 20.5 * 5], abs=0.1)
    assert (similarity < 1).all()


@given(st.integers(0, CELLS - 1), st.integers(0, CELLS - 1))
def test_a_sure_cell_is_the_point(row: int, column: int) -> None:
    maps = np.full((1, 5, CELLS, CELLS), -60.0, dtype=np.float32)
    maps[0, :, row, column] = 0.0
    points, similarity = place_keypoints(maps, REGION, AREA, SIGMAS)
    assert points[0] == pytest.approx(np.tile([103.0 - 1.5 + 3 * column, 52.5 + 5 * row], (5, 1)), abs=1e-3)
    assert similarity == pytest.approx(1.0, abs=1e-5)


def test_points_move_and_grow_with_the_region_and_no_berry_has_none(rng: np.random.Generator) -> None:
    maps = rng.normal(size=(1, 5, CELLS, CELLS)).astype(np.float32)
    points, similarity = place_keypoints(maps, REGION, AREA, SIGMAS)
    moved, same = place_keypoints(maps, 2 * REGION + 7, 4 * AREA, SIGMAS)
    assert moved == pytest.approx(2 * points + 7, abs=1e-3)
    assert same == pytest.approx(similarity, abs=1e-5)
    none, nothing = place_keypoints(maps[:0], REGION[:0], AREA[:0], SIGMAS)
    assert (none.shape, nothing.shape) == ((0, 5, 2), (0, 5))


def test_maps_may_lie_in_memory_as_a_framework_left_them(rng: np.random.Generator) -> None:
    maps = rng.normal(size=(1, CELLS, CELLS, 5)).astype(np.float32).transpose(0, 3, 1, 2)
    points, similarity = place_keypoints(maps, REGION, AREA, SIGMAS)
    again, same = place_keypoints(np.ascontiguousarray(maps), REGION, AREA, SIGMAS)
    assert (points == again).all()
    assert (similarity == same).all()
