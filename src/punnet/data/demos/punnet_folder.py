"""Punnet's own folder of demonstrations: lossless, and what the simulator writes.

* ``demonstrations.json``: schema, what made it, names of the joints, and a list of episodes: ``id``, ``target_id``, ``group``,
  ``box`` (xyxy), ``picking_point``, ``photographs`` (paths relative to the folder), ``extra``;
* ``trajectories.npz``: the samples of all episodes one after the other. ``joint_times``, ``joints`` and
  ``joint_offsets`` (N + 1: episode n has the rows from offset n to offset n + 1, none if it has no joints), the same with
  ``pose``; weights as ``joint_weight_mean`` (N, D, B) and so on, if all episodes have them;
* ``rgb/``, ``depth/``: the photographs.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import Episode, Photograph
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.pictures import PictureFile
from punnet.data.demos.reading import Reading, number_array, target_of_box, trajectory_of
from punnet.data.demos.trajectory import Clock, Space, Trajectory, WeightDistribution
from punnet.data.reading import beside, integer, read_json, require_object
from punnet.errors import FileFormatError
from punnet.geometry import CameraIntrinsics, is_transform

__all__ = ["DESCRIPTION", "SCHEMA", "TRAJECTORIES", "is_punnet_folder", "read_punnet_folder"]

SCHEMA = "punnet-demonstrations/2"
DESCRIPTION, TRAJECTORIES = "demonstrations.json", "trajectories.npz"
Arrays = dict[str, NDArray[Any]]


def is_punnet_folder(path: Path) -> bool:
    """Whether the description is there."""
    return (path / DESCRIPTION).is_file()


def read_punnet_folder(path: str | Path) -> Reading:
    """Read the folder; photographs are opened when they are asked for."""
    path = Path(path)
    where = str(path / DESCRIPTION)
    data = require_object(read_json(path / DESCRIPTION), where)
    if data.get("schema") != SCHEMA:
        raise FileFormatError(f"{where}: schema must be {SCHEMA}, got {data.get('schema')!r:.60}")
    if data.get("complete") is False:
        raise FileFormatError(f"{where}: is not complete; start the command that made it again to go on")
    entries = data.get("episodes")
    if not isinstance(entries, list):
        raise FileFormatError(f"{where}: 'episodes' must be a list")
    arrays = _load(path / TRAJECTORIES)
    names = tuple(str(name) for name in data.get("joint_names") or ())
    camera = None if data.get("camera") is None else _camera(data["camera"], where)
    info = data.get("info")
    reading = Reading(path, info=info if isinstance(info, dict) else {})
    for number, entry in enumerate(entries):
        name = str(entry.get("id", number)) if isinstance(entry, dict) else str(number)
        with reading.episode(name, path / DESCRIPTION):
            if not isinstance(entry, dict):
                raise EpisodeRefused([("missing-field", "an object is needed")])
            reading.add(_episode(path, name, entry, number, arrays, names, camera))
    return reading


def _load(file: Path) -> Arrays:
    try:
        with np.load(file, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except FileNotFoundError as error:
        raise FileFormatError(f"{file}: no such file") from error
    except (OSError, ValueError, EOFError, KeyError, NotImplementedError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{file}: not a readable npz ({error})") from error
    except Exception as error:  # a damaged stream inside the zip
        raise FileFormatError(f"{file}: damaged ({type(error).__name__}: {error})") from error


def _episode(
    folder: Path,
    name: str,
    entry: dict[str, Any],
    number: int,
    arrays: Arrays,
    names: tuple[str, ...],
    camera: CameraIntrinsics | None,
) -> Episode:
    clock: Clock = "phase" if entry.get("clock") == "phase" else "seconds"
    photographs = entry.get("photographs") or []
    if not isinstance(photographs, list):
        raise EpisodeRefused([("missing-field", "photographs must be a list")])
    box, group = entry.get("box"), entry.get("group")
    extra = entry.get("extra")
    return Episode(
        id=name,
        joints=_trajectory(arrays, "joint", number, clock, names),
        poses=_trajectory(arrays, "task", number, clock, ()),
        photographs=tuple(_photograph(folder, name, one, camera) for one in photographs),
        target=None if box is None else target_of_box(box, point=entry.get("picking_point")),
        target_id=str(entry.get("target_id") or ""),
        group=None if group is None else str(group),
        joint_weights=_weights(arrays, "joint", number),
        task_weights=_weights(arrays, "task", number),
        extra=extra if isinstance(extra, dict) else {},
    )


def _trajectory(
    arrays: Arrays, space: Space, number: int, clock: Clock, names: tuple[str, ...]
) -> Trajectory | None:
    prefix, values = ("joint", "joints") if space == "joint" else ("pose", "poses")
    needed = (f"{prefix}_times", values, f"{prefix}_offsets")
    if missing := [name for name in needed if name not in arrays]:
        raise EpisodeRefused([("missing-field", f"{TRAJECTORIES} has no array {missing[0]}")])
    offsets = arrays[needed[2]]
    if offsets.ndim != 1 or offsets.dtype.kind not in "iu" or len(offsets) < number + 2:
        raise EpisodeRefused([("missing-field", f"{TRAJECTORIES}: {needed[2]} has no rows for this episode")])
    begin, end = int(offsets[number]), int(offsets[number + 1])
    if begin == end:
        return None
    if not 0 <= begin < end <= len(arrays[values]):
        raise EpisodeRefused([("length-mismatch", f"{TRAJECTORIES}: {values} has no rows {begin} to {end}")])
    rows = arrays[values][begin:end]
    fitting = names if rows.ndim == 2 and rows.shape[1] == len(names) else ()
    return trajectory_of(arrays[needed[0]][begin:end], rows, names=fitting, space=space, clock=clock)


def _weights(arrays: Arrays, space: Space, number: int) -> WeightDistribution | None:
    mean, covariance = arrays.get(f"{space}_weight_mean"), arrays.get(f"{space}_weight_covariance")
    width = arrays.get(f"{space}_basis_width")
    if mean is None or covariance is None or width is None:
        return None
    if min(len(mean), len(covariance)) <= number or width.shape != ():
        raise EpisodeRefused([("missing-field", f"{TRAJECTORIES}: no {space} weights for this episode")])
    return WeightDistribution(mean[number], covariance[number], float(width), space)


def _photograph(folder: Path, episode: str, entry: Any, camera: CameraIntrinsics | None) -> Photograph:
    if not isinstance(entry, dict):
        raise EpisodeRefused([("missing-field", "a photograph must be an object with 'rgb'")])
    picture = beside(folder, entry.get("rgb"), f"photograph of episode {episode}")
    if not picture.is_file():
        raise EpisodeRefused([("missing-image", f"{picture}: no such file")])
    depth = entry.get("depth")
    own = entry.get("camera")
    pose = entry.get("T_base_camera")
    T = None if pose is None else number_array(pose, "T_base_camera")
    if T is not None and not is_transform(T):
        raise EpisodeRefused([("bad-pose", "T_base_camera must be a 4×4 rigid transform")])
    time, scale = entry.get("time", 0.0), entry.get("depth_scale", 0.001)
    numbers = number_array([time, scale], "time and depth_scale of a photograph")
    return Photograph(
        PictureFile(picture),
        _size(entry.get("size"), episode),
        time=float(numbers[0]),
        depth_path=None if depth is None else beside(folder, depth, f"depth of episode {episode}"),
        depth_scale=float(numbers[1]),
        camera=camera if own is None else _camera(own, f"camera of episode {episode}"),
        T_base_camera=T,
    )


def _size(size: Any, episode: str) -> tuple[int, int] | None:
    if size is None:
        return None
    if not isinstance(size, list) or len(size) != 2:
        raise EpisodeRefused([("missing-field", f"size must be [height, width], got {size!r:.40}")])
    return integer(size[0], f"size of episode {episode}"), integer(size[1], f"size of episode {episode}")


def _camera(data: Any, where: str) -> CameraIntrinsics:
    return CameraIntrinsics.from_json(require_object(data, where), where=where)
