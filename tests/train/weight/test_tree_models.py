"""Forests and ``shape``: they learn, say the same from disk, and their intervals hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sklearn")
pytest.importorskip("onnx")

from punnet.errors import ConfigurationError, FileFormatError
from punnet.train.weight.feature_model import FeatureModel
from punnet.train.weight.forest import FOREST, FOREST_PCA, ForestPcaConfig, PlainForestConfig
from punnet.train.weight.registry import MODELS, ModelSpec, model_spec
from punnet.train.weight.shape import SHAPE, ShapeConfig
from punnet.weight.metrics import weight_errors
from punnet.weight.samples import join_samples
from tests.train.weight.domes import domes

TRAIN, VALIDATION, TEST = domes(110, 1), domes(20, 2), domes(30, 3)
VALIDATION = replace(VALIDATION, groups=tuple(f"other {name}" for name in VALIDATION.groups))
SMALL: dict[str, tuple[ModelSpec, Any]] = {
    "forest": (FOREST, PlainForestConfig(trees=20, least_leaf=(1,), feature_share=(0.6,), folds=3)),
    "forest_pca": (FOREST_PCA, ForestPcaConfig(trees=20, least_leaf=(1, 3), feature_share=(0.6,), folds=3)),
    "shape": (
        SHAPE,
        ShapeConfig(members=2, trees=60, learning_rate=0.1, leaves=(4, 8), least_leaf=5, folds=3),
    ),
}


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, FeatureModel]:
    models = {}
    for name, (spec, config) in SMALL.items():
        said: list[str] = []
        folder = tmp_path_factory.mktemp(name)
        models[name] = spec.fit(TRAIN, VALIDATION, config, seed=0, progress=said.append, folder=folder)
        assert any("validation" in line for line in said)
    return models  # type: ignore[return-value]


@pytest.mark.parametrize("name", SMALL)
def test_it_weighs_berries_that_it_has_not_seen(fitted: dict[str, FeatureModel], name: str) -> None:
    grams = fitted[name].predict(TEST.observations)
    average = np.full(len(TEST), TRAIN.grams.mean())
    error = weight_errors(TEST.grams, grams).mean_percentage
    assert error < 0.4 * weight_errors(TEST.grams, average).mean_percentage
    if name == "shape":
        assert error < 6.0


@pytest.mark.parametrize("name", SMALL)
def test_intervals_hold_the_truth(fitted: dict[str, FeatureModel], name: str) -> None:
    estimates = fitted[name].weigh(TEST.observations)
    low, high = estimates.intervals.T
    assert (low < estimates.grams).all()
    assert (estimates.grams < high).all()
    assert ((low <= TEST.grams) & (TEST.grams <= high)).mean() >= 0.7
    assert estimates.coverage == 0.9


def test_detected_berries_are_calibrated_apart(tmp_path: Path) -> None:
    wrong = np.random.default_rng(5).normal(1.0, 0.15, (len(TRAIN), 4))
    found = tuple(
        replace(berry, score=0.9, box=berry.box * side)
        for berry, side in zip(TRAIN.observations, wrong, strict=True)
    )
    grams = TRAIN.grams * np.random.default_rng(6).normal(1.0, 0.1, len(TRAIN))
    both = join_samples([TRAIN, replace(TRAIN, observations=found, grams=grams)])
    spec, config = SMALL["shape"]
    model = spec.fit(both, VALIDATION, config, seed=0, progress=str, folder=tmp_path)
    assert isinstance(model, FeatureModel)
    seen = replace(TEST.observations[0], score=0.9)
    estimates = model.weigh([TEST.observations[0], seen])
    annotated, detected = np.diff(np.log(estimates.intervals), axis=1)[:, 0]
    assert detected > 1.5 * annotated
    assert model.settings.detected is not None


@pytest.mark.parametrize("name", SMALL)
def test_it_says_the_same_from_disk_and_alone(
    fitted: dict[str, FeatureModel], name: str, tmp_path: Path
) -> None:
    fitted[name].save(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.onnx", "weight.json"]
    again = SMALL[name][0].load(tmp_path)
    together = fitted[name].predict(TEST.observations)
    np.testing.assert_array_equal(again.predict(TEST.observations), together)
    alone = [again.predict([berry])[0] for berry in TEST.observations[:4]]
    np.testing.assert_allclose(alone, together[:4], rtol=1e-6)


def test_the_same_seed_gives_the_same_model(fitted: dict[str, FeatureModel], tmp_path: Path) -> None:
    spec, config = SMALL["shape"]
    again = spec.fit(TRAIN, VALIDATION, config, seed=0, progress=str, folder=tmp_path)
    assert isinstance(again, FeatureModel)
    assert again.graph == fitted["shape"].graph
    assert again.settings == fitted["shape"].settings


def test_a_damaged_folder_is_named(fitted: dict[str, FeatureModel], tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no trained weight model"):
        FeatureModel.load(tmp_path)
    fitted["forest"].save(tmp_path)
    (tmp_path / "weight.json").write_text("{")
    with pytest.raises(FileFormatError, match="train it anew"):
        FeatureModel.load(tmp_path)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ShapeConfig(leaves=(1,)), "leaves"),
        (lambda: ShapeConfig(feature_share=0.0), "feature_share"),
        (lambda: ShapeConfig(groups=("box",)), "metric"),
        (lambda: PlainForestConfig(trees=0), "trees"),
        (lambda: PlainForestConfig(feature_share=(2.0,)), "feature_share"),
    ],
)
def test_impossible_settings_are_refused(make: Any, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        make()


def test_every_name_of_the_registry_leads_to_its_model() -> None:
    for name in MODELS:
        spec = model_spec(name)
        assert spec.name == name
        spec.config(**spec.quick)  # settings that exist
        assert spec.thesis or name == "shape"
    with pytest.raises(ConfigurationError, match="no weight model 'tree'"):
        model_spec("tree")
