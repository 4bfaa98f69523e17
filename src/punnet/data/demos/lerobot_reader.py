"""Reading LeRobotDataset v3: joints from ``observation.state``, the first camera's first picture of each episode.

Poses, target boxes and grip points are taken from the columns that :mod:`punnet.data.demos.lerobot_writer` writes, if they
are there; ids, groups and camera from its ``meta/punnet.json``. LeRobot does not tell units: joints are taken as radians.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import Episode, Photograph
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.lerobot_layout import (
    BOX,
    DATA_PATH,
    INFO,
    POINT,
    POSE,
    SIDECAR,
    STATE,
    VERSION,
    VIDEO_PATH,
    feature_names,
    require_pyarrow,
)
from punnet.data.demos.pictures import EncodedPicture, VideoPicture
from punnet.data.demos.reading import Reading, number_array, target_of_box, trajectory_of
from punnet.data.reading import read_json, require_object
from punnet.errors import FileFormatError, PunnetError
from punnet.geometry import CameraIntrinsics

__all__ = ["is_lerobot", "read_lerobot"]

Row = dict[str, Any]
_PRESEEK = 0.25  # of a frame: what is asked for is the first picture not before that


def is_lerobot(path: Path) -> bool:
    """Whether ``meta/info.json`` is there."""
    return (path / INFO).is_file()


def read_lerobot(path: str | Path) -> Reading:
    """Read a dataset of version 3.

    Raises
    ------
    FileFormatError
        If it is of another version, has no joint states, or a table is damaged.
    ConfigurationError
        If pyarrow is not installed.
    """
    path = Path(path)
    info = require_object(read_json(path / INFO), str(path / INFO))
    version = info.get("codebase_version")
    if version != VERSION:
        raise FileFormatError(
            f"{path / INFO}: codebase_version is {version!r:.40}; {VERSION} is read: convert it with "
            "lerobot's script convert_dataset_v21_to_v30"
        )
    features = require_object(info.get("features"), f"{path / INFO}: features")
    if STATE not in features:
        raise FileFormatError(
            f"{path / INFO}: no feature '{STATE}'; there are {', '.join(map(str, features))}"
        )
    own = _sidecar(path)
    frames = _Frames(_wanted(features))
    reading = Reading(path, info={"lerobot": {key: info.get(key) for key in ("robot_type", "fps")}})
    for number, row in enumerate(_episode_rows(path)):
        told = own[number] if number < len(own) and isinstance(own[number], dict) else {}
        name = str(told.get("id", row.get("episode_index", number)))
        with reading.episode(name):
            reading.add(_episode(path, info, features, frames, row, told, name))
    return reading


def _sidecar(path: Path) -> list[Any]:
    if not (path / SIDECAR).is_file():
        return []
    data = read_json(path / SIDECAR)
    episodes = data.get("episodes") if isinstance(data, dict) else None
    return episodes if isinstance(episodes, list) else []


def _episode_rows(path: Path) -> Iterator[Row]:
    files = sorted((path / "meta" / "episodes").glob("chunk-*/file-*.parquet"))
    if not files:
        raise FileFormatError(f"{path}/meta/episodes: no table of episodes")
    for file in files:
        table = _table(file, None)
        for row in table.to_pylist():
            yield {name: value for name, value in row.items() if not name.startswith("stats/")}


def _table(file: Path, columns: list[str] | None) -> Any:
    _, parquet = require_pyarrow("pyarrow.parquet")
    try:
        table = parquet.read_table(file, columns=columns)
        table.validate(full=True)
    except FileNotFoundError as error:
        raise FileFormatError(f"{file}: no such file") from error
    except Exception as error:  # pyarrow's own errors, and what a damaged file makes of them
        raise FileFormatError(f"{file}: not a readable table ({type(error).__name__}: {error})") from error
    return table


class _Frames:
    """The tables of frames; the last one read is kept, as neighbouring episodes stand in one file."""

    def __init__(self, columns: list[str]) -> None:
        self.columns = columns
        self._file: Path | None = None
        self._table: Any = None
        self._episodes: NDArray[np.float64] = np.zeros(0)

    def of(self, file: Path, episode: int) -> Any:
        """The rows of an episode."""
        if file != self._file:
            self._table = _table(file, self.columns)
            self._episodes = number_array(self._table.column("episode_index").to_pylist(), "episode_index")
            self._file = file
        rows = np.flatnonzero(self._episodes == episode)
        if not len(rows):
            raise EpisodeRefused([("missing-field", f"{file}: has no row of episode {episode}")])
        return self._table.take(rows)


def _wanted(features: Row) -> list[str]:
    """Columns that are read."""
    columns = [key for key in (STATE, POSE, BOX, POINT) if key in features]
    camera = _camera_key(features)
    if camera is not None and features[camera]["dtype"] == "image":
        columns.append(camera)
    return [*columns, "timestamp", "episode_index"]


def _episode(
    path: Path, info: Row, features: Row, frames: _Frames, row: Row, told: Row, name: str
) -> Episode:
    index = row.get("episode_index")
    if not isinstance(index, int):
        raise EpisodeRefused([("missing-field", "the table of episodes has no episode_index")])
    fps = number_array(info.get("fps"), "fps")
    if fps.shape != () or not 0 < fps < 1e5:
        raise EpisodeRefused(
            [("missing-field", f"fps of {INFO} must be a positive number, got {info.get('fps')!r}")]
        )
    camera = _camera_key(features)
    file = path / _placed(info.get("data_path"), DATA_PATH, _chunk(row, "data"))
    table, wanted = frames.of(file, index), frames.columns
    states = _column(table, STATE)
    names = feature_names(features[STATE], states.shape[1] if states.ndim == 2 else -1)
    times = _column(table, "timestamp").ravel()
    if len(times) > 1 and np.allclose(np.diff(times) * float(fps), 1.0, atol=1e-2):
        times = times[0] + np.arange(len(times)) / float(fps)  # single precision has blurred them
    box, point = (_constant(table, key) if key in wanted else None for key in (BOX, POINT))
    photograph = None if camera is None else _photograph(path, info, features, row, table, camera, told)
    group = told.get("group")
    return Episode(
        id=name,
        joints=trajectory_of(times, states, names=names),
        poses=trajectory_of(times, _column(table, POSE), space="task") if POSE in wanted else None,
        photographs=() if photograph is None else (photograph,),
        target=None if box is None else target_of_box(box, point=point),
        target_id=str(told.get("target_id") or ""),
        group=None if group is None else str(group),
        extra={"tasks": row["tasks"]} if isinstance(row.get("tasks"), list) else {},
    )


def _column(table: Any, key: str) -> NDArray[np.float64]:
    return number_array(table.column(key).to_pylist(), key)


def _constant(table: Any, key: str) -> NDArray[np.float64] | None:
    """First value of a column that says the same in every frame; None where it is NaN: not known."""
    value = number_array(table.column(key)[0].as_py(), key)
    return None if np.isnan(value).any() else value


def _camera_key(features: Row) -> str | None:
    pictures = [
        key
        for key, feature in features.items()
        if isinstance(feature, dict) and feature.get("dtype") in ("video", "image") and "depth" not in key
    ]
    return pictures[0] if pictures else None


def _chunk(row: Row, prefix: str) -> dict[str, Any]:
    return {name: row.get(f"{prefix}/{name}") for name in ("chunk_index", "file_index")}


def _placed(template: Any, usual: str, values: dict[str, Any]) -> str:
    try:
        place = str(template or usual).format(**values)
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as error:
        raise EpisodeRefused(
            [("missing-field", f"no file can be told from {template!r:.80} ({error!r})")]
        ) from error
    if Path(place).is_absolute() or ".." in Path(place).parts:
        raise EpisodeRefused([("missing-field", f"the path {place!r:.80} leaves the dataset")])
    return place


def _photograph(
    path: Path, info: Row, features: Row, row: Row, table: Any, key: str, told: Row
) -> Photograph | None:
    camera, pose = _told_camera(told)
    if features[key]["dtype"] == "image":
        value = table.column(key)[0].as_py()
        content = value.get("bytes") if isinstance(value, dict) else None
        if not content:
            raise EpisodeRefused([("missing-image", f"'{key}' holds no bytes of a picture")])
        picture = EncodedPicture(content, f"{path}: {key}")
        return Photograph(picture, picture.read().shape[:2], camera=camera, T_base_camera=pose)
    size = _size(features[key], key)
    prefix = f"videos/{key}"
    file = path / _placed(info.get("video_path"), VIDEO_PATH, {"video_key": key, **_chunk(row, prefix)})
    if not file.is_file():
        raise EpisodeRefused([("missing-image", f"{file}: no such file")])
    start = number_array(row.get(f"{prefix}/from_timestamp", 0.0), "from_timestamp")
    if start.shape != () or not np.isfinite(start):
        raise EpisodeRefused([("missing-field", f"no start of the episode in the video of '{key}'")])
    time = max(0.0, float(start) - _PRESEEK / float(info["fps"]))
    # Odd sizes are padded to even ones by the writer; what was there is told beside.
    return Photograph(VideoPicture(file, time, size), size, camera=camera, T_base_camera=pose)


def _size(feature: Row, key: str) -> tuple[int, int]:
    shape = feature.get("shape")
    if not (
        isinstance(shape, list)
        and len(shape) == 3
        and all(isinstance(side, int) and side > 0 for side in shape)
    ):
        raise EpisodeRefused([("missing-field", f"'{key}' has no shape of a picture, got {shape!r:.60}")])
    return (shape[1], shape[2]) if shape[0] == 3 and shape[2] != 3 else (shape[0], shape[1])


def _told_camera(told: Row) -> tuple[CameraIntrinsics | None, NDArray[np.float64] | None]:
    try:
        camera = told.get("camera")
        intrinsics = None if camera is None else CameraIntrinsics.from_json(require_object(camera, "camera"))
        pose = told.get("T_base_camera")
        return intrinsics, None if pose is None else number_array(pose, "T_base_camera")
    except PunnetError as error:
        raise EpisodeRefused([("missing-field", f"{SIDECAR}: {error}")]) from error
