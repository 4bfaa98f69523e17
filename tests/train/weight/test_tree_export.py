"""Trees as ONNX say what scikit-learn says, on every side of every threshold."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest

pytest.importorskip("sklearn")
pytest.importorskip("onnx")

from sklearn.ensemble import HistGradientBoostingRegressor, RandomForestRegressor

from punnet.errors import ConfigurationError
from punnet.train.weight.feature_network import FeatureNetworks, NetworkConfig
from punnet.train.weight.tree_export import (
    rounded_down,
    trees_of_boosting,
    trees_of_forest,
    weight_graph,
)


@pytest.fixture(scope="module")
def berries() -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(3)
    features = generator.uniform(0.5, 2.0, (300, 4)).astype(np.float32)
    return features, features[:, 0] * 20.0 + np.sin(4.0 * features[:, 1]) + generator.normal(0.0, 0.3, 300)


def run(graph: bytes, features: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    grams, spread = session.run(["grams", "spread"], {"features": features})
    assert grams.shape == spread.shape == (len(features), 1)
    return grams[:, 0], spread[:, 0]


def on_the_thresholds(forest: RandomForestRegressor, features: np.ndarray) -> np.ndarray:
    """Berries with a feature at a threshold of the forest, and next to it in single precision."""
    rows = []
    for estimator in forest.estimators_[:5]:
        tree = estimator.tree_
        for node in np.flatnonzero(tree.children_left >= 0)[:20]:
            near = np.float32(tree.threshold[node])
            for value in (near, np.nextafter(near, np.float32(9.0)), np.nextafter(near, np.float32(-9.0))):
                row = features[node % len(features)].copy()
                row[tree.feature[node]] = value
                rows.append(row)
    return np.array(rows)


def test_a_forest_is_the_same(berries: tuple[np.ndarray, np.ndarray]) -> None:
    features, target = berries
    forest = RandomForestRegressor(20, min_samples_leaf=2, random_state=0).fit(features, np.log(target))
    graph = weight_graph(trees_of_forest(forest), None, features=4, base=None)
    for asked in (features, on_the_thresholds(forest, features)):
        grams, spread = run(graph, asked)
        np.testing.assert_allclose(grams, np.exp(forest.predict(asked)), rtol=2e-6)
        assert (spread == 1.0).all()


def test_boosted_trees_are_the_same_times_the_base(berries: tuple[np.ndarray, np.ndarray]) -> None:
    features, target = berries
    members = [
        HistGradientBoostingRegressor(max_iter=30, max_leaf_nodes=6, max_features=0.5, random_state=seed).fit(
            features, np.log(target / features[:, 2])
        )
        for seed in range(2)
    ]
    spread = HistGradientBoostingRegressor(max_iter=10, random_state=0).fit(features, np.log(target) / 9.0)
    graph = weight_graph(trees_of_boosting(members), trees_of_boosting([spread]), features=4, base=2)
    grams, spreads = run(graph, features)
    wanted = features[:, 2] * np.exp(np.mean([member.predict(features) for member in members], axis=0))
    np.testing.assert_allclose(grams, wanted, rtol=2e-6)
    np.testing.assert_allclose(spreads, np.exp(spread.predict(features)), rtol=2e-6)


def test_a_tree_without_a_cut_is_a_constant() -> None:
    features = np.ones((50, 2), np.float32)
    flat = HistGradientBoostingRegressor(max_iter=3).fit(features, np.full(50, np.log(2.0)))
    grams, _ = run(weight_graph(trees_of_boosting([flat]), None, features=2, base=None), features)
    np.testing.assert_allclose(grams, 2.0, rtol=1e-6)


def test_thresholds_are_rounded_towards_the_smaller() -> None:
    values = np.array([0.1, -0.1, 1.0, 16777217.0, np.nextafter(1.0, 2.0), np.nextafter(1.0, 0.0)])
    rounded = rounded_down(values).astype(np.float64)
    assert (rounded <= values).all()
    assert (np.nextafter(rounded_down(values), np.float32(np.inf)).astype(np.float64) > values).all()


def test_networks_beside_the_trees_count_half(berries: tuple[np.ndarray, np.ndarray]) -> None:
    features, target = berries
    ratio = np.log(target / features[:, 2])
    trees = HistGradientBoostingRegressor(max_iter=20, random_state=0).fit(features, ratio)
    networks = FeatureNetworks(NetworkConfig(members=2, widths=(16, 8), epochs=40), 0).fit(features, ratio)
    assert np.std(networks.predict(features) - ratio) < 0.6 * np.std(ratio)
    graph = weight_graph(trees_of_boosting([trees]), None, features=4, base=2, beside=networks)
    asked = np.vstack((features, features * 5.0, -features)).astype(np.float32)
    grams, _ = run(graph, asked)
    wanted = asked[:, 2] * np.exp((trees.predict(asked) + networks.predict(asked)) / 2.0)
    np.testing.assert_allclose(grams, wanted, rtol=1e-5)


def test_networks_of_the_same_seed_are_the_same(berries: tuple[np.ndarray, np.ndarray]) -> None:
    features, target = berries
    config = NetworkConfig(members=1, widths=(8,), epochs=5)
    first, second = (FeatureNetworks(config, 3).fit(features, target).predict(features) for _ in range(2))
    assert (first == second).all()


@pytest.mark.parametrize("wrong", [{"members": 0}, {"widths": ()}, {"decay": -1.0}, {"learning_rate": 0.0}])
def test_impossible_networks_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match="networks"):
        NetworkConfig(**wrong)  # type: ignore[arg-type]
