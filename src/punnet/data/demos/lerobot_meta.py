"""The description of a LeRobot dataset: its features, its one task, and what LeRobot has no place for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from punnet.data.demos.episode import DemonstrationSet, Episode
from punnet.data.demos.lerobot_layout import (
    ACTION,
    BOX,
    DATA_PATH,
    IMAGE,
    POINT,
    POSE,
    STATE,
    TASKS,
    VERSION,
    VIDEO_PATH,
    require_pyarrow,
)
from punnet.data.demos.lerobot_video import CODEC, PIXELS, even_size
from punnet.data.demos.trajectory import POSE_NAMES

__all__ = ["dataset_info", "sidecar_entry", "write_tasks"]


def write_tasks(folder: Path, task: str) -> None:
    """One row; the task is the index of the table, as pandas, which LeRobot reads it with, marks it."""
    pa, parquet = require_pyarrow("pyarrow.parquet")
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": stored, "metadata": None}
        for name, kind, stored in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": columns,
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": [task]})
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(pandas)}), folder / TASKS)


def dataset_info(
    demonstrations: DemonstrationSet,
    columns: dict[str, NDArray[Any]],
    size: tuple[int, int] | None,
    frames: int,
    fps: float,
    robot: str,
) -> dict[str, Any]:
    """Content of ``meta/info.json``; ``columns`` are those of any episode."""
    names: dict[str, list[str] | None] = {
        STATE: list(demonstrations.joint_names),
        ACTION: list(demonstrations.joint_names),
        POSE: list(POSE_NAMES),
        BOX: ["x0", "y0", "x1", "y1"],
        POINT: ["x", "y", "z"],
    }
    features: dict[str, Any] = {
        key: {"dtype": str(values.dtype), "shape": list(values.shape[1:]) or [1], "names": names.get(key)}
        for key, values in columns.items()
    }
    rate = int(fps) if fps == int(fps) else fps
    if size is not None:
        height, width = even_size(size)
        features[IMAGE] = {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height,
                "video.width": width,
                "video.codec": CODEC,
                "video.pix_fmt": PIXELS,
                "video.is_depth_map": False,
                "video.fps": rate,
                "video.channels": 3,
                "has_audio": False,
            },
        }
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(demonstrations),
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": f"0:{len(demonstrations)}"},
        "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if size is not None else None,
        "features": features,
    }


def sidecar_entry(episode: Episode) -> dict[str, Any]:
    """What LeRobot has no place for of an episode."""
    told: dict[str, Any] = {"id": episode.id, "target_id": episode.target_id, "group": episode.group}
    if episode.home is not None and episode.home.camera is not None:
        told["camera"] = episode.home.camera.to_json()
    if episode.home is not None and episode.home.T_base_camera is not None:
        told["T_base_camera"] = episode.home.T_base_camera.tolist()
    return told
