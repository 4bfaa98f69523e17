"""Ours: boosted trees and small networks on what a berry measures, with an interval for each berry.

Both tell by how much a berry's weight differs from that of a body of revolution with its outline, and their mean counts; a
smaller set of trees tells how far off the first may be, from what is hidden, noisy or cut off. The interval is
conformal: quantiles of the residuals of plants that were left out of the training, each over what was expected of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.train.weight.calibration import conformal_quantiles, predict_out_of_fold
from punnet.train.weight.feature_model import COVERAGE, FeatureModel
from punnet.train.weight.feature_network import FeatureNetworks, NetworkConfig
from punnet.train.weight.registry import ModelSpec, Tell
from punnet.train.weight.tree_export import trees_of_boosting, weight_graph
from punnet.weight.features import SHAPE_GROUPS, feature_matrix, feature_names
from punnet.weight.learned import WeightSettings
from punnet.weight.metrics import weight_errors
from punnet.weight.samples import WeightSamples

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingRegressor

__all__ = ["SHAPE", "ShapeConfig"]

_BASE = "revolution_ml"
_LEAST_RESIDUAL = 0.005  # so that a lucky guess has a logarithm


@dataclass(frozen=True)
class ShapeConfig:
    """Settings of ``shape``; of ``leaves`` the number that is best on validation is kept.

    Parameters
    ----------
    groups
        Feature groups of :mod:`punnet.weight.features`; they hold ``metric``.
    members
        Sets of trees, grown from other random numbers, whose answers are averaged.
    trees, learning_rate
        Of each set.
    leaves
        Most leaves of a tree.
    least_leaf
        Fewest berries in a leaf.
    feature_share
        Share of the features that each cut may choose from.
    spread_trees, spread_leaves
        Of the trees that tell the spread.
    folds
        Parts of the training plants, each in turn left out, whose residuals teach the spread and make the interval.
    networks, widths, decay, epochs
        Members and settings of :class:`~punnet.train.weight.feature_network.NetworkConfig`.

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    groups: tuple[str, ...] = SHAPE_GROUPS
    members: int = 2
    trees: int = 400
    learning_rate: float = 0.04
    leaves: tuple[int, ...] = (16, 31)
    least_leaf: int = 15
    feature_share: float = 0.25
    spread_trees: int = 120
    spread_leaves: int = 6
    folds: int = 5
    networks: int = 5
    widths: tuple[int, ...] = (96, 48)
    decay: float = 0.01
    epochs: int = 60

    def __post_init__(self) -> None:
        counts = (self.members, self.trees, self.least_leaf, self.spread_trees, *self.leaves)
        if min(counts) < 1 or min(*self.leaves, self.spread_leaves) < 2 or self.folds < 2:
            raise ConfigurationError("shape: members and trees must be ≥ 1, leaves and folds ≥ 2")
        self.network  # noqa: B018 - raises
        if not 0 < self.feature_share <= 1 or not 0 < self.learning_rate <= 1:
            raise ConfigurationError("shape: feature_share and learning_rate must be in (0, 1]")
        if _BASE not in feature_names(self.groups):
            raise ConfigurationError(f"shape: groups must hold metric, which has {_BASE}")

    @property
    def network(self) -> NetworkConfig:
        """Of the networks beside the trees."""
        return NetworkConfig(self.networks, self.widths, self.decay, self.epochs)


def fit(
    train: WeightSamples,
    validation: WeightSamples,
    config: ShapeConfig,
    *,
    seed: int,
    progress: Tell,
    folder: Path,
) -> FeatureModel:
    """Grow both sets of trees: settings by validation, then on both parts, intervals by plants left out in turn."""
    column = feature_names(config.groups).index(_BASE)
    features = feature_matrix(train.observations, config.groups)
    shown = feature_matrix(validation.observations, config.groups)
    target, wanted = (
        _log_ratio(train.grams, features[:, column]),
        _log_ratio(validation.grams, shown[:, column]),
    )
    best, leaves = np.inf, 0
    for most in config.leaves:
        grown = _trees(config, most, seed).fit(features, target)
        told = np.exp(grown.predict(shown)) * shown[:, column]
        error = weight_errors(validation.grams, told).mean_percentage
        progress(f"shape: trees of {most} leaves: {error:.2f}% off on validation")
        if error < best:
            best, leaves = error, most
    progress(f"shape: residuals of {config.folds} parts left out in turn")
    everything, groups = np.concatenate([features, shown]), (*train.groups, *validation.groups)
    wanted = np.concatenate([target, wanted])
    left_out = predict_out_of_fold(
        partial(_Both, config, leaves, seed), everything, wanted, groups, folds=config.folds, seed=seed
    )
    residuals = wanted - left_out
    size = np.log(np.abs(residuals) + _LEAST_RESIDUAL)
    # Quantiles are taken over what was expected of a berry by trees that had not seen its residual.
    expected = predict_out_of_fold(
        partial(_spread_trees, config, seed), everything, size, groups, folds=config.folds, seed=seed
    )
    # Annotated berries and detected ones each have their own quantiles: together, the first would hold too many.
    sources = _sources(everything, config.groups)
    intervals = {
        name: conformal_quantiles(residuals[source], np.exp(expected[source]), COVERAGE)
        for name, source in sources.items()
    }
    for name, source in sources.items():
        progress(f"shape: {source.sum()} {name} berries of plants left out make {intervals[name]}")
    progress("shape: trees and networks on all that is not set aside for the test")
    both = _Both(config, leaves, seed).fit(everything, wanted)
    spread = _spread_trees(config, seed).fit(everything, size)
    graph = weight_graph(
        trees_of_boosting(both.trees.members),
        trees_of_boosting([spread]),
        features=features.shape[1],
        base=column,
        beside=both.networks,
    )
    chosen = {"leaves": leaves, "trees": config.trees, "members": config.members, "validation_mape": best}
    first = next(iter(intervals.values()))
    settings = WeightSettings("shape", config.groups, first, intervals.get("detected"))
    return FeatureModel(graph, settings, chosen)


@dataclass(frozen=True)
class _BoostedTrees:
    """Sets of boosted trees whose answers are averaged."""

    members: tuple[HistGradientBoostingRegressor, ...]

    def fit(self, X: NDArray[np.float32], y: NDArray[np.float64]) -> _BoostedTrees:
        for member in self.members:
            member.fit(X, y)
        return self

    def predict(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray(np.mean([member.predict(X) for member in self.members], axis=0))


class _Both:
    """Trees and networks, whose mean counts."""

    def __init__(self, config: ShapeConfig, leaves: int, seed: int) -> None:
        self.trees = _trees(config, leaves, seed)
        self.networks = FeatureNetworks(config.network, seed)

    def fit(self, X: NDArray[np.float32], y: NDArray[np.float64]) -> _Both:
        self.trees.fit(X, y)
        self.networks.fit(X, y)
        return self

    def predict(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray((self.trees.predict(X) + self.networks.predict(X)) / 2.0)


def _trees(config: ShapeConfig, leaves: int, seed: int) -> _BoostedTrees:
    from sklearn.ensemble import HistGradientBoostingRegressor

    return _BoostedTrees(
        tuple(
            HistGradientBoostingRegressor(
                max_iter=config.trees,
                learning_rate=config.learning_rate,
                max_leaf_nodes=leaves,
                min_samples_leaf=config.least_leaf,
                max_features=config.feature_share,
                early_stopping=False,
                random_state=seed + member,
            )
            for member in range(config.members)
        )
    )


def _spread_trees(config: ShapeConfig, seed: int) -> HistGradientBoostingRegressor:
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(
        max_iter=config.spread_trees,
        learning_rate=0.05,
        max_leaf_nodes=config.spread_leaves,
        min_samples_leaf=3 * config.least_leaf,
        max_features=config.feature_share,
        early_stopping=False,
        random_state=seed,
    )


def _sources(features: NDArray[np.float32], groups: tuple[str, ...]) -> dict[str, NDArray[np.bool_]]:
    """Which berries were annotated and which detected, as far as there are such and the features tell."""
    names = feature_names(groups)
    if "annotated" not in names:
        return {"all": np.ones(len(features), dtype=np.bool_)}
    annotated = features[:, names.index("annotated")] > 0
    found = {"annotated": annotated, "detected": ~annotated}
    return {name: chosen for name, chosen in found.items() if chosen.any()}


def _log_ratio(true: NDArray[np.float64], base: NDArray[np.float32]) -> NDArray[np.float64]:
    return np.asarray(np.log(true / base.astype(np.float64)))


SHAPE = ModelSpec(
    name="shape",
    title="Shape (ours)",
    config=ShapeConfig,
    fit=fit,
    load=FeatureModel.load,
    learns_both=True,
    learns_fast=True,
    quick={"members": 1, "trees": 300, "learning_rate": 0.05, "leaves": (31,), "folds": 4, "networks": 2},
)
