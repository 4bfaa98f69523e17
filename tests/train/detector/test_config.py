"""Settings: there and back, and every fault named."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from punnet.errors import ConfigurationError, FileFormatError
from punnet.train.detector.config import (
    BACKBONES,
    DetectorConfig,
    DetectorTraining,
    LossWeights,
    Source,
    config_from_json,
    config_to_json,
)
from punnet.train.detector.presets import preset_names, read_config


@pytest.mark.parametrize(
    "config",
    [
        *(DetectorConfig.for_backbone(name) for name in BACKBONES),
        DetectorTraining(loss=LossWeights(mask=2.0), crop=(64, 96)),
        Source(Path("berries"), weight=3.0, scale=(0.2, 0.4), images=("1.png", 7)),
    ],
    ids=lambda config: getattr(config, "backbone", type(config).__name__),
)
def test_settings_survive_json(config: Any) -> None:
    text = json.dumps(config_to_json(config))
    assert config_from_json(type(config), json.loads(text)) == config


@pytest.mark.parametrize(
    ("kind", "data", "said"),
    [
        (DetectorConfig, {"backbone": "vgg"}, "backbone must be one of resnet50_fpn"),
        (DetectorConfig, {"widht": 3}, "no field widht; there are backbone"),
        (DetectorConfig, {"channels": "many"}, 'channels must be like 64, got "many"'),
        (DetectorConfig, {"channels": True}, "channels must be like 64, got true"),
        (DetectorConfig, {"channels": 0}, "channels must be positive"),
        (DetectorConfig, {"pretrained": 1}, "pretrained must be like true"),
        (DetectorConfig, {"region_size": 30}, "multiple of 4"),
        (DetectorConfig, {"positive_share": 1.5}, "at most 1"),
        (DetectorConfig, {"region_margin": -0.1}, "region_margin must be at least 0"),
        (DetectorTraining, {"crop": [100, 96]}, "crop must be two multiples of 32"),
        (DetectorTraining, {"crop": [96]}, "crop must be two multiples of 32"),
        (DetectorTraining, {"crop": ["a", "b"]}, "crop must be two multiples of 32"),
        (DetectorTraining, {"steps": 0}, "steps must be positive"),
        (DetectorTraining, {"learning_rate": float("nan")}, "learning_rate must be positive"),
        (DetectorTraining, {"averaging": 1.0}, "averaging must lie in"),
        (DetectorTraining, {"precision": "64"}, "precision must be one of 32-true"),
        (DetectorTraining, {"seed": -1}, "seed must be at least 0"),
        (DetectorTraining, {"loss": {"masks": 1.0}}, "no field masks"),
        (DetectorTraining, {"loss": {"mask": "high"}}, "mask must be like 1.0"),
        (Source, {"path": "x", "weight": 0}, "weight must be positive"),
        (Source, {"path": "x", "scale": [1.0, 0.5]}, "0 < least ≤ most"),
        (Source, {"path": "x", "images": []}, "list of images is empty"),
    ],
)
def test_faults_are_named(kind: type, data: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        config_from_json(kind, data)
    assert said in str(caught.value)


def test_every_loss_weight_is_a_term() -> None:
    terms = {"objectness", "proposal_box", "classes", "box", "mask", "keypoint", "visibility", "ripeness"}
    assert {item.name for item in dataclasses.fields(LossWeights)} == terms


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_read(name: str) -> None:
    config, training = read_config(name, {"steps": 7, "seed": None})
    assert config.backbone in BACKBONES
    assert training.steps == 7
    assert training.seed == read_config(name)[1].seed


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text('{"detector": {"backbone": "resnet50_fpn", "channels": 32}, "training": {"batch": 2}}')
    config, training = read_config(str(path))
    assert (config.backbone, config.channels, config.box_units) == ("resnet50_fpn", 32, 1024)
    assert training.batch == 2


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("not json", FileFormatError),
        ("[]", ConfigurationError),
        ('{"detecter": {}}', ConfigurationError),
        ('{"detector": 3}', ConfigurationError),
        ('{"detector": {"backbone": ["a"]}}', ConfigurationError),
        ('{"training": {"steps": "many"}}', ConfigurationError),
    ],
)
def test_bad_files_are_refused(text: str, error: type[Exception], tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(text)
    with pytest.raises(error):
        read_config(str(path))


def test_a_missing_file_is_told_with_the_presets() -> None:
    with pytest.raises(FileFormatError, match="sim-fast"):
        read_config("nowhere.json")
