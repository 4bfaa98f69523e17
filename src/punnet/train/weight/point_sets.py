"""Neighbours and samples in batches of point clouds, by plain PyTorch: no compiled extension is needed."""

from __future__ import annotations

import torch
from torch import Tensor

from punnet.errors import ShapeError

__all__ = ["farthest_points", "gather_points", "nearest_neighbours", "neighbours_within"]


def nearest_neighbours(points: Tensor, queries: Tensor, count: int) -> Tensor:
    """Indices (B, M, ``count``) of the points nearest each query, nearest first.

    A point that is a query too is its own nearest neighbour. Where there are fewer points than ``count``, the
    nearest one fills the rest.

    Parameters
    ----------
    points
        (B, N, C) coordinates or features.
    queries
        (B, M, C).
    count
        Neighbours of each.

    Raises
    ------
    ShapeError
        If the shapes don't go together or there are no points.
    """
    _check_points(points)
    if queries.dim() != 3 or queries.shape[::2] != points.shape[::2]:
        raise ShapeError(
            f"queries must be (B, M, C) like the points {tuple(points.shape)}, got {tuple(queries.shape)}"
        )
    found = min(count, points.shape[1])
    distances = torch.cdist(queries.detach(), points.detach(), compute_mode="donot_use_mm_for_euclid_dist")
    indices = distances.topk(found, dim=2, largest=False).indices
    if found == count:
        return indices
    return torch.cat((indices, indices[:, :, :1].expand(-1, -1, count - found)), dim=2)


def neighbours_within(points: Tensor, centres: Tensor, radius: float, count: int) -> Tensor:
    """Indices (B, M, ``count``) of the nearest points that lie within ``radius`` of each centre.

    Where fewer do, the nearest one fills the rest (PointNet++'s ball query, but by distance and not by the order of
    the points, which must not matter).
    """
    indices = nearest_neighbours(points, centres, count)
    offsets = gather_points(points.detach(), indices) - centres.detach()[:, :, None]
    outside = offsets.square().sum(dim=3) > radius * radius
    return torch.where(outside, indices[:, :, :1], indices)


def farthest_points(points: Tensor, count: int) -> Tensor:
    """Indices (B, ``count``) of points spread evenly: each is the farthest from those chosen before it.

    The first is the point farthest from the centroid, so that the choice depends on where the points are and not on
    their order. With fewer points than ``count`` some come again.

    Parameters
    ----------
    points
        (B, N, C).
    count
        Points to choose in each cloud.

    Raises
    ------
    ShapeError
        If there are no points.
    """
    _check_points(points)
    points = points.detach()
    batch = torch.arange(len(points), device=points.device)
    chosen = torch.empty(len(points), count, dtype=torch.long, device=points.device)
    farthest = (points - points.mean(dim=1, keepdim=True)).square().sum(dim=2).argmax(dim=1)
    gaps = torch.full(points.shape[:2], torch.inf, device=points.device)
    for index in range(count):
        chosen[:, index] = farthest
        to_last = (points - points[batch, farthest][:, None]).square().sum(dim=2)
        gaps = torch.minimum(gaps, to_last)
        farthest = gaps.argmax(dim=1)
    return chosen


def gather_points(features: Tensor, indices: Tensor) -> Tensor:
    """Rows of each cloud: ``features`` (B, N, C) at ``indices`` (B, …) → (B, …, C)."""
    batch = torch.arange(len(features), device=features.device)
    return features[batch.view(-1, *(1,) * (indices.dim() - 1)), indices]


def _check_points(points: Tensor) -> None:
    if points.dim() != 3 or not points.shape[1]:
        raise ShapeError(f"points must be (B, N, C) with N ≥ 1, got {tuple(points.shape)}")
