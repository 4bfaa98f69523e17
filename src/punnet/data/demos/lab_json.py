"""The lab's recordings: one JSON a demonstration, with ``joint_position`` and ``time``.

A folder holds the JSON files themselves, or as in the lab's data sets ``trajectories/ID.json`` with the photographs in
``color_img/ID.png``, aligned depth (16-bit PNG) in ``depth/`` and poses in ``trajectories_task/ID.json``.

Each JSON is an object with

* ``joint_position``, (T, J) radians, ``time``, (T,) seconds; without ``time`` the samples are taken as evenly spread
  over the movement, whose duration is then not known;
* if known ``pose`` (T, 7), ``box`` (xyxy pixels in the photograph), ``target`` (what repeats share) and ``configuration``
  (the plant). All else is kept as it is, but that NaN, which is no JSON, counts as null.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.demos.episode import Episode, Photograph
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.pictures import PictureFile
from punnet.data.demos.reading import Reading, number_array, target_of_box, trajectory_of
from punnet.data.demos.trajectory import Space, Trajectory
from punnet.data.reading import IMAGE_SUFFIXES, image_size, read_json_with_gaps

__all__ = ["is_lab_json", "read_lab_json"]

JOINTS, TIME, POSE = "joint_position", "time", "pose"
_KNOWN = frozenset({JOINTS, TIME, POSE, "box", "target", "configuration"})


def is_lab_json(path: Path) -> bool:
    """Whether the path is such a JSON or a folder of them; looks at the first one's start."""
    files = _files(path)
    if not files:
        return False
    try:
        with files[0].open("rb") as stream:
            start = stream.read(4096)
            return f'"{JOINTS}"'.encode() in start or f'"{JOINTS}"'.encode() in stream.read()
    except OSError:
        return False


def read_lab_json(path: str | Path) -> Reading:
    """Read one JSON, or a folder of them."""
    path = Path(path)
    reading = Reading(path)
    for file in _files(path):
        with reading.episode(file.stem, file):
            reading.add(_episode(file, path if path.is_dir() else None))
    return reading


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix == ".json" else []
    inner = path / "trajectories"
    return sorted((inner if inner.is_dir() else path).glob("*.json"))


def _episode(file: Path, folder: Path | None) -> Episode:
    data = _object(file)
    if JOINTS not in data:
        raise EpisodeRefused([("missing-field", f"no '{JOINTS}'; (T, J) radians are needed")])
    joints = _timed(data, JOINTS)
    task_file = None if folder is None else folder / "trajectories_task" / file.name
    task = _object(task_file) if task_file is not None and task_file.is_file() else data
    photograph = None if folder is None else _photograph(folder, file.stem)
    return Episode(
        id=file.stem,
        joints=joints,
        poses=_timed(task | {TIME: task.get(TIME, data.get(TIME))}, POSE) if POSE in task else None,
        photographs=() if photograph is None else (photograph,),
        target=None if data.get("box") is None else target_of_box(data["box"]),
        target_id=_label(data, "target"),
        group=_label(data, "configuration") or None,
        extra={name: value for name, value in data.items() if name not in _KNOWN},
    )


def _object(file: Path) -> dict[str, Any]:
    data = read_json_with_gaps(file)
    if not isinstance(data, dict):
        raise EpisodeRefused([("unreadable", f"a JSON object is needed, got {type(data).__name__}")])
    return data


def _timed(data: dict[str, Any], name: str) -> Trajectory:
    values = number_array(data[name], name)
    times = data.get(TIME)
    space: Space = "task" if name == POSE else "joint"
    if times is None:
        count = len(values) if values.ndim else 0
        return trajectory_of(np.linspace(0.0, 1.0, count), values, space=space, clock="phase")
    return trajectory_of(times, values, space=space)


def _label(data: dict[str, Any], name: str) -> str:
    value = data.get(name)
    return str(value) if isinstance(value, str | int) and not isinstance(value, bool) else ""


def _photograph(folder: Path, name: str) -> Photograph | None:
    for suffix in IMAGE_SUFFIXES:
        picture = folder / "color_img" / f"{name}{suffix}"
        if picture.is_file():
            depth = folder / "depth" / f"{name}.png"
            return Photograph(
                PictureFile(picture), image_size(picture), depth_path=depth if depth.is_file() else None
            )
    return None
