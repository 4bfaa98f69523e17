"""Trees of scikit-learn, and networks beside them, to one ONNX graph that gives grams and how far off they may be.

ONNX compares in single precision: a feature x of that precision is at most the threshold t just when it is at most the
largest number of that precision that is not above t, so thresholds are rounded down and no berry takes another path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.train.weight.feature_network import FeatureNetworks, network_nodes

if TYPE_CHECKING:
    import onnx
    from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor

__all__ = [
    "FEATURES_INPUT",
    "GRAMS_OUTPUT",
    "SPREAD_OUTPUT",
    "Tree",
    "TreeSum",
    "rounded_down",
    "trees_of_boosting",
    "trees_of_forest",
    "weight_graph",
]

FEATURES_INPUT, GRAMS_OUTPUT, SPREAD_OUTPUT = "features", "grams", "spread"

_OPSET, _OPSET_OF_TREES = 17, 3
_IR_VERSION = 8  # what that opset came with: older runtimes refuse a newer one


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes of one tree, the root first; children of a leaf are not looked at.

    Parameters
    ----------
    feature, threshold
        (N,) a berry goes left if this feature is at most the threshold.
    left, right
        (N,) numbers of the children.
    leaf
        (N,) whether a node has none.
    value
        (N,) what a leaf adds.
    """

    feature: NDArray[np.int64]
    threshold: NDArray[np.float64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    leaf: NDArray[np.bool_]
    value: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TreeSum:
    """The sum of what trees say, above a start."""

    start: float
    trees: tuple[Tree, ...]


def trees_of_forest(forest: RandomForestRegressor) -> TreeSum:
    """The mean over a fitted random forest, as a sum."""
    trees = []
    for estimator in forest.estimators_:
        nodes = estimator.tree_
        leaf = nodes.children_left < 0
        trees.append(
            Tree(
                np.where(leaf, 0, nodes.feature),
                nodes.threshold,
                nodes.children_left,
                nodes.children_right,
                leaf,
                nodes.value[:, 0, 0] / len(forest.estimators_),
            )
        )
    return TreeSum(0.0, tuple(trees))


def trees_of_boosting(members: Sequence[HistGradientBoostingRegressor]) -> TreeSum:
    """The mean over fitted boosted trees, as a sum."""
    trees = []
    for member in members:
        for (predictor,) in member._predictors:
            nodes = predictor.nodes
            trees.append(
                Tree(
                    nodes["feature_idx"].astype(np.int64),
                    nodes["num_threshold"],
                    nodes["left"].astype(np.int64),
                    nodes["right"].astype(np.int64),
                    nodes["is_leaf"].astype(np.bool_),
                    nodes["value"] / len(members),
                )
            )
    start = float(np.mean([np.ravel(member._baseline_prediction)[0] for member in members]))
    return TreeSum(start, tuple(trees))


def weight_graph(
    weight: TreeSum,
    spread: TreeSum | None,
    *,
    features: int,
    base: int | None,
    beside: FeatureNetworks | None = None,
) -> bytes:
    """An ONNX file from ``features`` (N, F) to ``grams`` (N, 1) and ``spread`` (N, 1).

    Parameters
    ----------
    weight
        Says the logarithm of (grams / the base column), of grams if there is none.
    spread
        Says the logarithm of the relative error that is expected; 1 for every berry if None.
    features
        F.
    base
        Column that is multiplied with e to what the trees say: a volume or a weight.
    beside
        Networks that say the same, whose mean with the trees counts.
    """
    import onnx
    from onnx import TensorProto, helper

    factor = GRAMS_OUTPUT if base is None else "factor"
    nodes, constants = [_ensemble(weight, "said" if beside is None else "trees")], []
    if beside is not None:
        told, held = network_nodes(beside, FEATURES_INPUT, "networks")
        constants += held
        nodes += [*told, helper.make_node("Mean", ["trees", "networks"], ["said"])]
    nodes.append(helper.make_node("Exp", ["said"], [factor]))
    if base is not None:
        constants.append(helper.make_tensor("column", TensorProto.INT64, [1], [base]))
        nodes += [
            helper.make_node("Gather", [FEATURES_INPUT, "column"], ["base"], axis=1),
            helper.make_node("Mul", ["base", factor], [GRAMS_OUTPUT]),
        ]
    if spread is None:
        constants.append(helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0]))
        nodes.append(helper.make_node("Mul", [GRAMS_OUTPUT, "zero"], ["expected"]))
    else:
        nodes.append(_ensemble(spread, "expected"))
    nodes.append(helper.make_node("Exp", ["expected"], [SPREAD_OUTPUT]))
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["berries", 1])
        for name in (GRAMS_OUTPUT, SPREAD_OUTPUT)
    ]
    inputs = [helper.make_tensor_value_info(FEATURES_INPUT, TensorProto.FLOAT, ["berries", features])]
    model = helper.make_model(
        helper.make_graph(nodes, "weight", inputs, outputs, constants),
        opset_imports=[helper.make_opsetid("", _OPSET), helper.make_opsetid("ai.onnx.ml", _OPSET_OF_TREES)],
        producer_name="punnet",
    )
    model.ir_version = _IR_VERSION
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _ensemble(trees: TreeSum, output: str) -> onnx.NodeProto:
    """One node that adds up trees."""
    from onnx import helper

    columns: dict[str, list[Any]] = {
        name: []
        for name in (
            *("nodes_treeids", "nodes_nodeids", "nodes_featureids", "nodes_modes", "nodes_values"),
            *("nodes_truenodeids", "nodes_falsenodeids"),
            *("target_treeids", "target_nodeids", "target_ids", "target_weights"),
        )
    }
    for number, tree in enumerate(trees.trees):
        count, leaves = len(tree.leaf), np.flatnonzero(tree.leaf)
        columns["nodes_treeids"] += [number] * count
        columns["nodes_nodeids"] += range(count)
        columns["nodes_featureids"] += np.where(tree.leaf, 0, tree.feature).tolist()
        columns["nodes_modes"] += np.where(tree.leaf, "LEAF", "BRANCH_LEQ").tolist()
        columns["nodes_values"] += np.where(tree.leaf, 0.0, rounded_down(tree.threshold)).tolist()
        columns["nodes_truenodeids"] += np.where(tree.leaf, 0, tree.left).tolist()
        columns["nodes_falsenodeids"] += np.where(tree.leaf, 0, tree.right).tolist()
        columns["target_treeids"] += [number] * len(leaves)
        columns["target_nodeids"] += leaves.tolist()
        columns["target_ids"] += [0] * len(leaves)
        columns["target_weights"] += tree.value[leaves].tolist()
    node = helper.make_node(
        "TreeEnsembleRegressor", [FEATURES_INPUT], [output], name=output, domain="ai.onnx.ml"
    )
    settings = {"n_targets": 1, "base_values": [trees.start], "post_transform": "NONE"}
    for name, value in {**columns, **settings}.items():
        node.attribute.append(helper.make_attribute(name, value))
    return node


def rounded_down(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """The largest numbers of single precision that are not above ``values``."""
    near = values.astype(np.float32)
    below = np.nextafter(near, np.float32(-np.inf))
    return np.where(near.astype(np.float64) > values, below, near)
