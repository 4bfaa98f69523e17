"""Graph convolutional network (Kipf & Welling, ICLR 2017) on the graph of a berry's surface."""

from __future__ import annotations

from torch_geometric.nn import GCNConv

from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_training import DeepRecipe, deep_spec
from punnet.train.weight.fixed_graph import GraphConfig, GraphNetwork

__all__ = ["GCN", "GCNConfig", "GraphConvolutionalNetwork"]


class GCNConfig(GraphConfig):
    """Settings of the graph convolutional network."""


class GraphConvolutionalNetwork(GraphNetwork):
    """Each layer: the mean over a node and its neighbours, through one matrix."""

    def __init__(self, config: GCNConfig) -> None:
        super().__init__(config, GCNConv)


GCN = deep_spec(
    DeepRecipe("gcn", GCNConfig, GraphConvolutionalNetwork, PointInputs),
    title="GCN",
    quick={"epochs": 40, "points": 256},
    thesis={0.20: 44.30},
)
