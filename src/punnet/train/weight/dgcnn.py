"""Dynamic graph CNN (Wang et al., ACM TOG 2019): EdgeConv on neighbours found anew, in the features of each layer."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch_geometric.nn import EdgeConv

from punnet.train.weight.deep_config import PointConfig, PointSource
from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_layers import SharedLayers, WeightNetwork, weight_head
from punnet.train.weight.deep_training import DeepRecipe, deep_spec
from punnet.train.weight.fixed_graph import neighbour_edges

__all__ = ["DGCNN", "DGCNNConfig", "DynamicGraphNetwork"]


@dataclass(frozen=True)
class DGCNNConfig(PointConfig):
    """DGCNN's settings.

    Parameters
    ----------
    source
        Nodes from the rebuilt surface, as the other graph networks have them.
    neighbours
        Nearest points, in the features of each layer, that a point hears from.
    widths
        Of the EdgeConv layers.
    whole
        Width of the layer on all their outputs, before the largest and the mean are taken.
    head
        Widths of the dense layers before the linear unit.
    """

    source: PointSource = "surface"
    neighbours: int = 20
    widths: tuple[int, ...] = (64, 64, 128, 256)
    whole: int = 1024
    head: tuple[int, ...] = (512, 256)


class DynamicGraphNetwork(WeightNetwork):
    """(B, N, 4) → grams."""

    def __init__(self, config: DGCNNConfig) -> None:
        super().__init__()
        self.neighbours = config.neighbours
        widths = (4, *config.widths)
        self.convolutions = nn.ModuleList(
            EdgeConv(SharedLayers((2 * before, after), slope=0.2), aggr="max")
            for before, after in zip(widths, config.widths, strict=False)
        )
        self.whole = SharedLayers((sum(config.widths), config.whole), slope=0.2)
        self.head = weight_head((2 * config.whole, *config.head), config.dropout)

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        features = inputs
        outputs = []
        for convolution in self.convolutions:
            edges = neighbour_edges(features, self.neighbours)
            nodes = convolution(features.flatten(end_dim=1), edges)
            features = nodes.view(*inputs.shape[:2], -1)
            outputs.append(features)
        whole = self.whole(torch.cat(outputs, dim=2))
        grams: Tensor = self.head(torch.cat((whole.amax(dim=1), whole.mean(dim=1)), dim=1))
        return grams


DGCNN = deep_spec(
    DeepRecipe("dgcnn", DGCNNConfig, DynamicGraphNetwork, PointInputs),
    title="DGCNN",
    quick={"epochs": 20, "points": 256, "neighbours": 10, "widths": (32, 32, 64, 128), "whole": 512},
    thesis={0.20: 44.20},
)
