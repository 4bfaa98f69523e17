"""The thesis' random forest (section 4.3.1), with and without the principal components of the berry's hull.

It learns the logarithm of the weight: what counts is the relative error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from punnet.errors import ConfigurationError
from punnet.train.weight.calibration import conformal_quantiles, predict_out_of_fold
from punnet.train.weight.feature_model import COVERAGE, FeatureModel
from punnet.train.weight.registry import ModelSpec, Tell
from punnet.train.weight.tree_export import trees_of_forest, weight_graph
from punnet.weight.features import FOREST_GROUPS, FOREST_PCA_GROUPS, feature_matrix
from punnet.weight.learned import WeightSettings
from punnet.weight.metrics import weight_errors
from punnet.weight.samples import WeightSamples

if TYPE_CHECKING:
    from sklearn.ensemble import RandomForestRegressor

__all__ = ["FOREST", "FOREST_PCA", "ForestConfig"]


@dataclass(frozen=True)
class ForestConfig:
    """Settings of a forest; of each pair of ``least_leaf`` and ``feature_share`` the best on validation is kept.

    Parameters
    ----------
    groups
        Feature groups of :mod:`punnet.weight.features`.
    trees
        How many.
    least_leaf
        Fewest berries in a leaf.
    feature_share
        Share of the features that each cut may choose from.
    folds
        Parts of the training plants, each in turn left out, whose residuals make the interval.

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    groups: tuple[str, ...]
    trees: int = 200
    least_leaf: tuple[int, ...] = (2, 4)
    feature_share: tuple[float, ...] = (0.5, 0.8, 1.0)
    folds: int = 5

    def __post_init__(self) -> None:
        if self.trees < 1 or self.folds < 2 or min(self.least_leaf, default=0) < 1:
            raise ConfigurationError("forest: trees and least_leaf must be ≥ 1, folds ≥ 2")
        if not self.feature_share or not all(0 < share <= 1 for share in self.feature_share):
            raise ConfigurationError("forest: feature_share must be shares in (0, 1]")


@dataclass(frozen=True)
class ForestPcaConfig(ForestConfig):
    """Settings of the forest with the principal components."""

    groups: tuple[str, ...] = FOREST_PCA_GROUPS


@dataclass(frozen=True)
class PlainForestConfig(ForestConfig):
    """Settings of the forest without them."""

    groups: tuple[str, ...] = FOREST_GROUPS


def fit(
    train: WeightSamples,
    validation: WeightSamples,
    config: ForestConfig,
    *,
    seed: int,
    progress: Tell,
    folder: Path,
    name: str,
) -> FeatureModel:
    """Grow a forest: settings by validation, then on both parts; one relative interval for all berries."""
    features, target = feature_matrix(train.observations, config.groups), np.log(train.grams)
    shown = feature_matrix(validation.observations, config.groups)
    best, choice = np.inf, (0, 0.0)
    for leaf, share in product(config.least_leaf, config.feature_share):
        grown = _forest(config, leaf, share, seed).fit(features, target)
        error = weight_errors(validation.grams, np.exp(grown.predict(shown))).mean_percentage
        progress(
            f"{name}: leaves of {leaf}, {100 * share:.0f}% of the features: {error:.2f}% off on validation"
        )
        if error < best:
            best, choice = error, (leaf, share)
    everything, groups = np.concatenate([features, shown]), (*train.groups, *validation.groups)
    target = np.concatenate([target, np.log(validation.grams)])
    grow = partial(_forest, config, *choice, seed)
    left_out = predict_out_of_fold(grow, everything, target, groups, folds=config.folds, seed=seed)
    residuals = target - left_out
    interval = conformal_quantiles(residuals, np.ones(len(residuals)), COVERAGE)
    forest = grow().fit(everything, target)
    graph = weight_graph(trees_of_forest(forest), None, features=features.shape[1], base=None)
    chosen = {
        "least_leaf": choice[0],
        "feature_share": choice[1],
        "trees": config.trees,
        "validation_mape": best,
    }
    return FeatureModel(graph, WeightSettings(name, config.groups, interval), chosen)


def _forest(config: ForestConfig, leaf: int, share: float, seed: int) -> RandomForestRegressor:
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor(
        n_estimators=config.trees, min_samples_leaf=leaf, max_features=share, random_state=seed, n_jobs=1
    )


FOREST = ModelSpec(
    name="forest",
    title="Random forest",
    config=PlainForestConfig,
    fit=partial(fit, name="forest"),
    load=FeatureModel.load,
    learns_both=True,
    learns_fast=True,
    thesis={0.05: 28.32, 0.20: 81.36},
)
FOREST_PCA = ModelSpec(
    name="forest_pca",
    title="Random forest with PCA",
    config=ForestPcaConfig,
    fit=partial(fit, name="forest_pca"),
    load=FeatureModel.load,
    learns_both=True,
    learns_fast=True,
    thesis={0.05: 29.63, 0.20: 81.99},
)
