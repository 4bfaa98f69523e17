"""A berry as a graph that stays as it is: points of its surface, each joined to its nearest neighbours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch_geometric.nn import MessagePassing

from punnet.train.weight.deep_config import PointConfig, PointSource
from punnet.train.weight.deep_layers import WeightNetwork, weight_head
from punnet.train.weight.point_sets import nearest_neighbours

__all__ = ["GraphConfig", "GraphNetwork", "neighbour_edges"]


@dataclass(frozen=True)
class GraphConfig(PointConfig):
    """Settings of the networks on a fixed graph.

    Parameters
    ----------
    source
        The thesis samples the nodes from the rebuilt surface.
    neighbours
        Nearest points that each point hears from.
    widths
        Of the graph convolutions.
    head
        Widths of the dense layers before the linear unit.
    """

    source: PointSource = "surface"
    neighbours: int = 12
    widths: tuple[int, ...] = (64, 128, 256)
    head: tuple[int, ...] = (256, 128)


class GraphNetwork(WeightNetwork):
    """(B, N, 4) → grams: graph convolutions, then the largest and the mean of each feature.

    Parameters
    ----------
    config
        Sizes.
    convolution
        Makes a layer of PyTorch Geometric from its widths in and out.
    """

    def __init__(self, config: GraphConfig, convolution: Callable[[int, int], MessagePassing]) -> None:
        super().__init__()
        widths = (4, *config.widths)
        self.neighbours = config.neighbours
        self.convolutions = nn.ModuleList(
            convolution(before, after) for before, after in zip(widths, config.widths, strict=False)
        )
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in config.widths)
        self.head = weight_head((2 * widths[-1], *config.head), config.dropout)

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        edges = neighbour_edges(inputs[..., :3], self.neighbours)
        nodes = inputs.flatten(end_dim=1)
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            nodes = torch.relu(norm(convolution(nodes, edges)))
        clouds = nodes.view(*inputs.shape[:2], -1)
        grams: Tensor = self.head(torch.cat((clouds.amax(dim=1), clouds.mean(dim=1)), dim=1))
        return grams


def neighbour_edges(points: Tensor, neighbours: int) -> Tensor:
    """Edges (2, B·N·k) of the k-nearest-neighbour graphs of ``points`` (B, N, C): from each neighbour to the point.

    Nodes are numbered through all clouds of the batch, as PyTorch Geometric does. A point is no neighbour of itself.
    """
    count, size = points.shape[:2]
    # The nearest is the point itself, or one at the same place.
    nearest = nearest_neighbours(points, points, neighbours + 1)[:, :, 1:]
    first = torch.arange(count, device=points.device)[:, None, None] * size
    sources = (nearest + first).reshape(-1)
    targets = torch.arange(count * size, device=points.device).repeat_interleave(neighbours)
    return torch.stack((sources, targets))
