"""Configurations by name, and configurations of one's own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from punnet.errors import ConfigurationError, FileFormatError
from punnet.train.detector.config import DetectorConfig, DetectorTraining, config_from_json

__all__ = ["preset_names", "read_config"]


def preset_names() -> list[str]:
    """Names of the configurations that come with the package."""
    return sorted(
        Path(file.name).stem for file in resources.files(__name__).iterdir() if file.name.endswith(".json")
    )


def read_config(
    name: str, changes: Mapping[str, Any] | None = None
) -> tuple[DetectorConfig, DetectorTraining]:
    """Network and training settings of a preset or a JSON file ``{"detector": {…}, "training": {…}}``.

    Parameters
    ----------
    name
        Preset or path.
    changes
        Fields of the training that replace the file's; None values do not.

    Raises
    ------
    FileFormatError
        If the file is missing or not JSON.
    ConfigurationError
        If a field is unknown or has an impossible value.
    """
    preset = resources.files(__name__) / f"{name}.json"
    source = preset if name in preset_names() else Path(name)
    try:
        data = json.loads(source.read_text())
    except (OSError, ValueError) as error:
        raise FileFormatError(
            f"--config {name}: neither a JSON file nor one of {', '.join(preset_names())} ({error})"
        ) from error
    if not isinstance(data, dict) or not set(data) <= {"detector", "training"}:
        raise ConfigurationError(f"{name}: an object with 'detector' and 'training' is needed")
    if not all(isinstance(part, dict) for part in data.values()):
        raise ConfigurationError(f"{name}: 'detector' and 'training' must be objects")
    detector, training = dict(data.get("detector", {})), dict(data.get("training", {}))
    training |= {key: value for key, value in (changes or {}).items() if value is not None}
    backbone = detector.pop("backbone", "efficientnet_lite0_fpn")
    usual = DetectorConfig.for_backbone(backbone)
    config_from_json(DetectorConfig, detector)
    return (
        DetectorConfig.for_backbone(usual.backbone, **detector),
        config_from_json(DetectorTraining, training),
    )
