"""LeRobotDataset v3: where its files are, and the names of the columns that a demonstration goes into."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from punnet.errors import ConfigurationError

__all__ = [
    "ACTION",
    "BOX",
    "DATA_PATH",
    "EPISODES_PATH",
    "IMAGE",
    "INFO",
    "POINT",
    "POSE",
    "SIDECAR",
    "STATE",
    "STATS",
    "TASKS",
    "VERSION",
    "VIDEO_PATH",
    "feature_names",
    "require_pyarrow",
]

VERSION = "v3.0"
INFO, STATS, TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"

SIDECAR = "meta/punnet.json"
"""What LeRobot has no place for: ids, groups, targets, camera. LeRobot itself passes over it."""

STATE, ACTION = "observation.state", "action"
POSE, BOX, POINT = "observation.pose", "observation.target_box", "observation.target_point"
IMAGE = "observation.images.home"


def require_pyarrow(*names: str) -> list[ModuleType]:
    """``pyarrow`` and some of its modules.

    Raises
    ------
    ConfigurationError
        If it is not installed.
    """
    import importlib

    try:
        return [importlib.import_module(name) for name in ("pyarrow", *names)]
    except ImportError as error:
        raise ConfigurationError("LeRobot data need pyarrow: pip install 'punnet[lerobot]'") from error


def feature_names(feature: Any, count: int) -> tuple[str, ...]:
    """Names of a feature's numbers, whatever form they are given in; empty if they are not told."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        names = next((value for value in names.values() if isinstance(value, list)), None)
    if isinstance(names, list) and len(names) == count == len({str(name) for name in names}):
        return tuple(str(name) for name in names)
    return ()
