from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from punnet.errors import ShapeError
from punnet.train.weight.point_sets import (
    farthest_points,
    gather_points,
    nearest_neighbours,
    neighbours_within,
)

CLOUDS = torch.from_numpy(np.random.default_rng(3).normal(size=(3, 200, 3))).float()


def test_nearest_neighbours_are_those_of_a_tree() -> None:
    queries = torch.from_numpy(np.random.default_rng(4).normal(size=(3, 50, 3))).float()
    found = nearest_neighbours(CLOUDS, queries, 12)
    for cloud, query, indices in zip(CLOUDS, queries, found, strict=True):
        np.testing.assert_array_equal(indices, cKDTree(cloud.numpy()).query(query.numpy(), k=12)[1])


def test_nearest_neighbours_hold_far_from_the_origin() -> None:
    # |a|² + |b|² − 2ab would lose millimetres here.
    near = CLOUDS[:1] * 0.01 + 100.0
    found = nearest_neighbours(near, near, 5)
    np.testing.assert_array_equal(found[0], cKDTree(near[0].numpy()).query(near[0].numpy(), k=5)[1])


def test_too_few_points_are_filled_up_with_the_nearest() -> None:
    found = nearest_neighbours(CLOUDS[:, :3], CLOUDS[:, :3], 5)
    np.testing.assert_array_equal(found[:, :, 3:], found[:, :, :1].expand(-1, -1, 2))
    assert set(found[0, 0, :3].tolist()) == {0, 1, 2}


def test_neighbours_within_a_radius_are_those_of_a_tree() -> None:
    found = neighbours_within(CLOUDS, CLOUDS[:, :40], 0.8, 200)
    for cloud, indices in zip(CLOUDS.numpy(), found, strict=True):
        expected = cKDTree(cloud).query_ball_point(cloud[:40], 0.8)
        assert [set(row.tolist()) for row in indices] == [set(row) for row in expected]


def test_farthest_points_are_those_of_the_definition() -> None:
    found = farthest_points(CLOUDS, 20)
    for cloud, indices in zip(CLOUDS.numpy().astype(np.float64), found, strict=True):
        chosen = [int(np.linalg.norm(cloud - cloud.mean(axis=0), axis=1).argmax())]
        while len(chosen) < 20:
            gaps = np.linalg.norm(cloud[:, None] - cloud[chosen], axis=2).min(axis=1)
            chosen.append(int(gaps.argmax()))
        assert indices.tolist() == chosen


def test_farthest_points_do_not_depend_on_the_order() -> None:
    order = torch.randperm(200, generator=torch.Generator().manual_seed(1))
    shuffled = CLOUDS[:, order]
    torch.testing.assert_close(
        gather_points(shuffled, farthest_points(shuffled, 15)),
        gather_points(CLOUDS, farthest_points(CLOUDS, 15)),
    )


def test_gathering_keeps_gradients() -> None:
    features = CLOUDS.clone().requires_grad_()
    gather_points(features, nearest_neighbours(features, features, 4)).sum().backward()
    assert features.grad is not None
    assert features.grad.sum() == pytest.approx(3 * 200 * 4 * 3)


@pytest.mark.parametrize("points", [torch.zeros(2, 0, 3), torch.zeros(4, 3)])
def test_no_points_are_refused(points: torch.Tensor) -> None:
    with pytest.raises(ShapeError, match="N ≥ 1"):
        farthest_points(points, 2)
    with pytest.raises(ShapeError, match="N ≥ 1"):
        nearest_neighbours(points, points, 2)


def test_queries_of_another_batch_are_refused() -> None:
    with pytest.raises(ShapeError, match="queries"):
        nearest_neighbours(CLOUDS, CLOUDS[:2], 2)
