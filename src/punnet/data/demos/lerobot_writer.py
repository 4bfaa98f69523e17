"""Writing LeRobotDataset v3: one table of frames, one of episodes, the photographs as a video.

LeRobot knows one rate for all: each movement is resampled to whole frames from its start to its end. ``action`` is the
state of the next frame, the last one repeated.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import DemonstrationSet, Episode
from punnet.data.demos.lerobot_layout import (
    ACTION,
    BOX,
    DATA_PATH,
    EPISODES_PATH,
    IMAGE,
    INFO,
    POINT,
    POSE,
    SIDECAR,
    STATE,
    STATS,
    VIDEO_PATH,
    require_pyarrow,
)
from punnet.data.demos.lerobot_meta import dataset_info, sidecar_entry, write_tasks
from punnet.data.demos.lerobot_statistics import episode_statistics, joined_statistics, picture_statistics
from punnet.data.demos.lerobot_video import encode_episode, join_videos
from punnet.errors import ConfigurationError, ShapeError
from punnet.outputs import OutputFolder

__all__ = ["TASK", "write_lerobot"]

TASK = "Reach for the marked strawberry with the separation fingers open."
EPISODES_A_VIDEO = 50
Columns = dict[str, NDArray[Any]]
Statistics = dict[str, dict[str, Any]]


def write_lerobot(
    demonstrations: DemonstrationSet,
    folder: str | Path,
    *,
    fps: float = 30.0,
    seconds: float | None = None,
    robot: str = "panda",
    task: str = TASK,
    force: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> list[str]:
    """Write the set so that the package ``lerobot`` loads it.

    Parameters
    ----------
    demonstrations
        All with joints; photographs of one size, or none.
    folder
        Made if it does not exist.
    fps
        Frames per second.
    seconds
        How long a movement takes whose source did not tell.
    robot, task
        As LeRobot names them.
    force
        Replace a folder that Punnet made earlier.
    progress
        Called with episodes done and episodes in all.

    Returns
    -------
    list
        What the format has no place for.

    Raises
    ------
    ConfigurationError
        If a duration is needed and not given, or pyarrow is not installed.
    ShapeError
        If an episode has no joints or its photograph another size than the others'.
    OutputExistsError
        If the folder exists and ``force`` is not set, or was not made by Punnet.
    """
    require_pyarrow()
    _check(demonstrations, fps, seconds)
    size = _photograph_size(demonstrations)
    with OutputFolder(folder, force=force) as output, tempfile.TemporaryDirectory(prefix="punnet-") as parts:
        (output.path / "meta").mkdir()
        tables, statistics, clips = [], [], []
        total = 0
        told_of = _targets_told(demonstrations)
        for number, episode in enumerate(demonstrations):
            columns = _columns(episode, fps, seconds, told_of)
            count = len(columns[STATE])
            told = episode_statistics(columns)
            if size is not None:
                clips.append(Path(parts) / f"{number:06d}.mp4")
                told[IMAGE] = picture_statistics(_film(episode, count, fps, clips[-1]))
            columns |= _indices(number, total, count, fps)
            told |= episode_statistics(_indices(number, total, count, fps))
            tables.append(columns)
            statistics.append(told)
            total += count
            if progress is not None:
                progress(number + 1, len(demonstrations))
        _write_data(output.path, tables)
        if size is not None:
            _write_videos(output.path, clips)
        _write_episodes(output.path, tables, statistics, fps, task, has_video=size is not None)
        write_tasks(output.path, task)
        _dump(output.path / INFO, dataset_info(demonstrations, tables[0], size, total, fps, robot))
        _dump(output.path / STATS, joined_statistics(statistics))
        _dump(
            output.path / SIDECAR,
            {"schema": "punnet-lerobot/1", "episodes": list(map(sidecar_entry, demonstrations))},
        )
    return _losses(demonstrations)


def _check(demonstrations: DemonstrationSet, fps: float, seconds: float | None) -> None:
    if not 0 < fps <= 1000:
        raise ConfigurationError(f"lerobot: fps must lie in (0, 1000], got {fps}")
    if not len(demonstrations):
        raise ConfigurationError(f"lerobot: {demonstrations.name} has no episode to write")
    for episode in demonstrations:
        if episode.joints is None:
            raise ShapeError(f"lerobot: episode '{episode.id}' has no joints, which become '{STATE}'")
        if episode.joints.clock == "phase" and seconds is None:
            raise ConfigurationError(
                f"lerobot: how long episode '{episode.id}' takes is not known; give the seconds (--seconds)"
            )
    for name in ("poses", "target"):
        having = sum(getattr(episode, name) is not None for episode in demonstrations)
        if name == "poses" and 0 < having < len(demonstrations):
            raise ShapeError(
                f"lerobot: {having} of {len(demonstrations)} episodes have poses; all must, or none"
            )


def _photograph_size(demonstrations: DemonstrationSet) -> tuple[int, int] | None:
    having = [episode.home for episode in demonstrations if episode.home is not None]
    if not having:
        return None
    sizes = {one.size if one.size is not None else one.rgb().shape[:2] for one in having}
    if len(having) < len(demonstrations) or len(sizes) > 1:
        raise ShapeError(
            f"lerobot: {len(having)} of {len(demonstrations)} episodes have a photograph, of sizes "
            f"{sorted(sizes)} (H, W); all must have one of one size, or none"
        )
    height, width = sizes.pop()
    return int(height), int(width)


def _targets_told(demonstrations: DemonstrationSet) -> dict[str, int]:
    """Columns for what is told of the targets, and their widths; none that no episode has."""
    targets = [episode.target for episode in demonstrations if episode.target is not None]
    told = {BOX: 4} if targets else {}
    return told | ({POINT: 3} if any(target.picking_point is not None for target in targets) else {})


def _columns(episode: Episode, fps: float, seconds: float | None, told_of: dict[str, int]) -> Columns:
    assert episode.joints is not None
    joints = episode.joints
    if joints.clock == "phase":
        assert seconds is not None
        joints = joints.lasting(seconds)
    count = max(2, round(joints.duration * fps) + 1)
    states = joints.resampled(count).astype(np.float32)
    columns: Columns = {STATE: states, ACTION: np.concatenate((states[1:], states[-1:]))}
    if episode.poses is not None:
        columns[POSE] = episode.poses.resampled(count).astype(np.float32)
    target = episode.target
    values = {} if target is None else {BOX: target.box, POINT: target.picking_point}
    for key, width in told_of.items():
        value = values.get(key)
        known = np.full(width, np.nan) if value is None else value
        columns[key] = np.tile(np.asarray(known, dtype=np.float32), (count, 1))
    return columns


def _indices(number: int, first: int, count: int, fps: float) -> Columns:
    frames = np.arange(count, dtype=np.int64)
    return {
        "timestamp": (frames / fps).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(count, number, dtype=np.int64),
        "index": first + frames,
        "task_index": np.zeros(count, dtype=np.int64),
    }


def _film(episode: Episode, count: int, fps: float, place: Path) -> NDArray[np.uint8]:
    """Write the clip of an episode; give its first picture."""
    pictures = [photograph.rgb() for photograph in episode.photographs]
    begin = episode.movement.times[0]
    starts = np.array([photograph.time - begin for photograph in episode.photographs])
    shown = np.maximum(np.searchsorted(starts, np.arange(count) / fps + 1e-9, side="right") - 1, 0)
    encode_episode(pictures, shown, fps, place)
    return pictures[0]


def _write_data(folder: Path, tables: list[Columns]) -> None:
    pa, parquet = require_pyarrow("pyarrow.parquet")
    place = folder / DATA_PATH.format(chunk_index=0, file_index=0)
    place.parent.mkdir(parents=True)
    arrays = {}
    for key in tables[0]:
        values = np.concatenate([columns[key] for columns in tables])
        flat = pa.array(values.ravel())
        arrays[key] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    parquet.write_table(pa.table(arrays), place)


def _write_videos(folder: Path, clips: list[Path]) -> None:
    for file, first in enumerate(range(0, len(clips), EPISODES_A_VIDEO)):
        place = folder / VIDEO_PATH.format(video_key=IMAGE, chunk_index=0, file_index=file)
        place.parent.mkdir(parents=True, exist_ok=True)
        join_videos(clips[first : first + EPISODES_A_VIDEO], place)


def _write_episodes(
    folder: Path,
    tables: list[Columns],
    statistics: list[Statistics],
    fps: float,
    task: str,
    *,
    has_video: bool,
) -> None:
    pa, parquet = require_pyarrow("pyarrow.parquet")
    rows, begin, film_begin = [], 0, 0
    for number, (columns, told) in enumerate(zip(tables, statistics, strict=True)):
        count = len(columns[STATE])
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [task],
            "length": count,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": begin,
            "dataset_to_index": begin + count,
        }
        if has_video:
            film_begin = 0 if number % EPISODES_A_VIDEO == 0 else film_begin
            row |= {
                f"videos/{IMAGE}/chunk_index": 0,
                f"videos/{IMAGE}/file_index": number // EPISODES_A_VIDEO,
                f"videos/{IMAGE}/from_timestamp": film_begin / fps,
                f"videos/{IMAGE}/to_timestamp": (film_begin + count) / fps,
            }
            film_begin += count
        for key, values in told.items():
            row |= {f"stats/{key}/{name}": value for name, value in values.items()}
        row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        rows.append(row)
        begin += count
    place = folder / EPISODES_PATH.format(chunk_index=0, file_index=0)
    place.parent.mkdir(parents=True)
    parquet.write_table(pa.Table.from_pylist(rows), place)


def _losses(demonstrations: DemonstrationSet) -> list[str]:
    lost = ["double precision"]
    if any(episode.home is not None and episode.home.depth_path is not None for episode in demonstrations):
        lost.append("depth pictures")
    if any(
        episode.joint_weights is not None or episode.task_weights is not None for episode in demonstrations
    ):
        lost.append("weights and their covariances: only their means, as trajectories")
    if any(episode.extra for episode in demonstrations):
        lost.append("further fields of the source")
    return lost


def _dump(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=4, allow_nan=False) + "\n")
