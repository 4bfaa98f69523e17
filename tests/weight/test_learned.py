"""Weighing with a bundle: grams and interval by hand, and bundles that are none."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from punnet.bundle import write_bundle
from punnet.errors import BundleError
from punnet.scene import Strawberries
from punnet.weight import WeightEstimator, observe
from punnet.weight.choosing import default_weight_estimator, load_weight_estimator
from punnet.weight.features import feature_matrix, feature_names
from punnet.weight.learned import LearnedWeightEstimator, WeightSettings
from tests.weight.scenes import ellipsoid_scene, one_berry
from tests.weight.toy_model import DENSITY, SPREAD, toy_graph, toy_settings, write_toy_bundle

CENTRE, HALF = (0.03, -0.02, 0.4), (0.014, 0.018, 0.014)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toy_bundle(tmp_path_factory.mktemp("bundles") / "toy")


def test_grams_and_interval_are_those_of_the_graph(bundle: Path) -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    estimator = LearnedWeightEstimator.from_bundle(bundle)
    assert isinstance(estimator, WeightEstimator)
    assert estimator.name == "toy-scale"
    estimates = estimator.estimate(frame, one_berry(mask))
    seen = observe(frame, one_berry(mask))[0]
    assert not isinstance(seen, str)
    revolution = feature_matrix([seen], ("metric",))[0, feature_names(("metric",)).index("revolution_ml")]
    assert estimates.grams[0] == pytest.approx(DENSITY * revolution, rel=1e-5)
    low, high = (estimates.grams[0] * math.exp(q * SPREAD) for q in (-1.5, 2.0))
    np.testing.assert_allclose(estimates.intervals[0], (low, high), rtol=1e-5)
    assert (estimates.coverage, estimates.reasons) == (0.9, (None,))


def test_without_a_spread_every_interval_is_as_wide(tmp_path: Path) -> None:
    folder = write_toy_bundle(tmp_path / "toy", graph=toy_graph(spread=None))
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    estimates = LearnedWeightEstimator.from_bundle(folder).estimate(frame, one_berry(mask))
    np.testing.assert_allclose(estimates.intervals[0] / estimates.grams[0], np.exp([-1.5, 2.0]), rtol=1e-5)


def test_a_detected_berry_has_its_own_interval(tmp_path: Path) -> None:
    wider = {"kind": "split-conformal", "coverage": 0.9, "low": -3.0, "high": 4.0}
    folder = write_toy_bundle(tmp_path / "toy", settings=toy_settings(interval_detected=wider))
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    estimator = LearnedWeightEstimator.from_bundle(folder)
    assert WeightSettings.from_json(estimator.settings.to_json(), where="here") == estimator.settings
    for score, quantiles in ((1.0, (-1.5, 2.0)), (0.8, (-3.0, 4.0))):
        berry = one_berry(mask).with_fields(scores=np.array([score]))
        found = estimator.estimate(frame, berry)
        np.testing.assert_allclose(
            found.intervals[0] / found.grams[0], np.exp(SPREAD * np.array(quantiles)), rtol=1e-5
        )


def test_what_can_not_be_weighed_has_its_reason_and_its_place(bundle: Path) -> None:
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    estimator = LearnedWeightEstimator.from_bundle(bundle)
    masks = np.stack([np.zeros_like(mask), mask, np.zeros_like(mask)])
    three = Strawberries(mask.shape, np.zeros((3, 4)), masks=masks)
    estimates = estimator.estimate(frame, three)
    assert estimates.reasons == ("the mask is empty", None, "the mask is empty")
    assert np.isnan(estimates.grams).tolist() == [True, False, True]
    none = estimator.estimate(replace(frame, depth=None), three)
    assert set(none.reasons) == {"the frame has no depth"}
    assert estimator.estimate(frame, Strawberries.empty((480, 640))).grams.shape == (0,)


@pytest.mark.parametrize("density", [1e-6, 1e6, -1.0, float("nan"), float("inf")])
def test_a_wild_number_is_no_weight(tmp_path: Path, density: float) -> None:
    folder = write_toy_bundle(tmp_path / "toy", graph=toy_graph(density=density))
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    estimates = LearnedWeightEstimator.from_bundle(folder).estimate(frame, one_berry(mask))
    assert np.isnan(estimates.grams).all()
    assert "no berry's weight" in str(estimates.reasons[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"schema": "punnet-weight/9"}, "unknown here"),
        ({"feature_groups": ["colour"]}, "colour"),
        ({"feature_groups": "mask"}, "list of names"),
        ({"features": ["mask_area_m2"]}, "other names"),
        ({"interval": {"kind": "guess", "coverage": 0.9, "low": -1.0, "high": 1.0}}, "guess"),
        ({"interval": {"kind": "split-conformal", "coverage": 1.9, "low": -1.0, "high": 1.0}}, "coverage"),
        ({"interval": {"kind": "split-conformal", "coverage": 0.9, "low": 1.0, "high": 2.0}}, "low"),
        ({"interval": {"kind": "split-conformal", "coverage": 0.9, "low": "a", "high": 2.0}}, "numbers"),
        ({"interval": None}, "wrong kind"),
        ({"interval_detected": {"kind": "split-conformal"}}, "missing"),
        ({"model": 3}, "text"),
    ],
)
def test_settings_that_are_none_are_refused(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    folder = write_toy_bundle(tmp_path / "toy", settings=toy_settings(**changes))
    with pytest.raises(BundleError, match=words) as caught:
        LearnedWeightEstimator.from_bundle(folder)
    assert "weight.json" in str(caught.value)
    assert "punnet train weight" in str(caught.value)


@pytest.mark.parametrize(
    ("graph", "words"),
    [
        (b"not a graph", "can't be loaded"),
        (toy_graph(groups=("metric",)), "takes features"),
        (toy_graph(input_name="pixels"), "not a weight model's graph"),
        (toy_graph(spread=-1.0), "spread not negative"),
    ],
)
def test_graphs_that_are_none_are_refused(tmp_path: Path, graph: bytes, words: str) -> None:
    folder = write_toy_bundle(tmp_path / "toy", graph=graph)
    frame, mask = ellipsoid_scene(CENTRE, HALF)
    with pytest.raises(BundleError, match=words) as caught:
        LearnedWeightEstimator.from_bundle(folder).estimate(frame, one_berry(mask))
    assert "model.onnx" in str(caught.value)


def test_estimators_are_found_by_name_and_folder(bundle: Path, tmp_path: Path) -> None:
    assert load_weight_estimator("ellipsoid").name == "ellipsoid"
    assert load_weight_estimator(bundle).name == "toy-scale"
    assert load_weight_estimator().name == default_weight_estimator()
    with pytest.raises(BundleError, match="neither a folder nor a bundle"):
        load_weight_estimator("kitchen-scale")
    other = tmp_path / "other"
    write_bundle(other, name="o", kind="promp", files={"a.json": {}}, licence="MIT", command="made by a test")
    with pytest.raises(BundleError, match="'weight' is needed"):
        load_weight_estimator(other)
