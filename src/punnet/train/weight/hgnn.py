"""Higher-order graph network (Morris et al., AAAI 2019): GraphConv on the graph of a berry's surface."""

from __future__ import annotations

from torch_geometric.nn import GraphConv

from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_training import DeepRecipe, deep_spec
from punnet.train.weight.fixed_graph import GraphConfig, GraphNetwork

__all__ = ["HGNN", "HGNNConfig", "HigherOrderNetwork"]


class HGNNConfig(GraphConfig):
    """Settings of the higher-order network."""


class HigherOrderNetwork(GraphNetwork):
    """Each layer: one matrix for the node, another for the mean over its neighbours.

    The paper sums over the neighbours; every node here has as many, so the mean is the sum at another scale.
    """

    def __init__(self, config: HGNNConfig) -> None:
        super().__init__(config, lambda before, after: GraphConv(before, after, aggr="mean"))


HGNN = deep_spec(
    DeepRecipe("hgnn", HGNNConfig, HigherOrderNetwork, PointInputs),
    title="HGNN",
    quick={"epochs": 40, "points": 256},
    thesis={0.20: 46.10},
)
