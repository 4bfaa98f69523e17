"""The folder ``reach``: ``index.json``, ``promp_weights.npz`` and ``img/``.

Each target is a photograph from home, a box, and weights fitted to about ten human demonstrations in joint and in task
space: the mean, and the largest eigenvalue of the covariance with its vector for each degree of freedom.
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
from punnet.data.demos.reading import Reading, number_array, target_of_box
from punnet.data.demos.thesis_zip import RECORDED_WIDTH
from punnet.data.demos.trajectory import POSE_NAMES, Space, WeightDistribution
from punnet.data.reading import beside, image_size, read_json
from punnet.errors import FileFormatError, ShapeError

__all__ = ["is_reach", "read_reach"]

SAMPLES = 100
INDEX, WEIGHTS = "index.json", "promp_weights.npz"
_ARRAYS = {"joint": ("joint_mean", "joint_cov_eig"), "task": ("task_mean", "task_cov_eig")}


def is_reach(path: Path) -> bool:
    """Whether both files are there."""
    return (path / INDEX).is_file() and (path / WEIGHTS).is_file()


def read_reach(path: str | Path) -> Reading:
    """Read the targets; what the index says of suspect pairs stands in ``extra`` and is not relied on."""
    path = Path(path)
    entries = read_json(path / INDEX)
    if not isinstance(entries, list):
        raise FileFormatError(f"{path / INDEX}: a JSON list of targets is needed")
    arrays = _load(path / WEIGHTS)
    rows = {str(name): row for row, name in enumerate(arrays["ids"])}
    reading = Reading(path, info={"basis": {"count": 8, "width": RECORDED_WIDTH}})
    for number, entry in enumerate(entries):
        name = str(entry.get("id", number)) if isinstance(entry, dict) else str(number)
        with reading.episode(name, path / INDEX):
            if not isinstance(entry, dict) or name not in rows:
                raise EpisodeRefused([("missing-field", f"no weights of id '{name}' in {WEIGHTS}")])
            reading.add(_episode(path, name, entry, arrays, rows[name]))
    return reading


def _load(file: Path) -> dict[str, NDArray[Any]]:
    needed = ("ids", *(name for names in _ARRAYS.values() for name in names))
    try:
        with np.load(file, allow_pickle=False) as data:
            arrays = {name: data[name] for name in needed}
    except KeyError as error:
        raise FileFormatError(f"{file}: no array {error}; needed are {', '.join(needed)}") from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"{file}: not a readable npz ({error})") from error
    count = len(arrays["ids"]) if arrays["ids"].ndim == 1 else -1
    for mean, eigen in _ARRAYS.values():
        shape = arrays[mean].shape
        if len(shape) != 3 or shape[0] != count or arrays[eigen].shape != (*shape[:2], shape[2] + 1):
            raise FileFormatError(
                f"{file}: {mean} and {eigen} must be ({count}, D, B) and ({count}, D, B + 1), "
                f"got {shape} and {arrays[eigen].shape}"
            )
    return arrays


def _episode(
    folder: Path, name: str, entry: dict[str, Any], arrays: dict[str, NDArray[Any]], row: int
) -> Episode:
    joint, task = _weights(arrays, row, "joint"), _weights(arrays, row, "task")
    picture = beside(folder, entry.get("image"), f"{folder / INDEX}: target {name}")
    if not picture.is_file():
        raise EpisodeRefused([("missing-image", f"{picture}: no such file")])
    x, y, width, height = _xywh(entry.get("bbox_xywh"))
    try:
        poses = task.mean_trajectory(SAMPLES)
    except ShapeError as error:
        raise EpisodeRefused([("bad-pose", str(error))]) from error
    known = {"id", "config", "image", "bbox_xywh"}
    return Episode(
        id=name,
        joints=joint.mean_trajectory(SAMPLES),
        poses=poses,
        photographs=(Photograph(PictureFile(picture), image_size(picture)),),
        target=target_of_box([x, y, x + width, y + height]),
        group=f"scene-{entry['config']}" if "config" in entry else None,
        joint_weights=joint,
        task_weights=task,
        extra={field: value for field, value in entry.items() if field not in known},
    )


def _xywh(box: Any) -> list[float]:
    values = number_array(box, "bbox_xywh")
    if values.shape != (4,):
        raise EpisodeRefused([("bad-box", f"bbox_xywh must be 4 numbers, got {box!r:.60}")])
    return [float(value) for value in values]


def _weights(arrays: dict[str, NDArray[Any]], row: int, space: Space) -> WeightDistribution:
    mean_name, eigen_name = _ARRAYS[space]
    mean = np.asarray(arrays[mean_name][row], dtype=np.float64)
    eigen = np.asarray(arrays[eigen_name][row], dtype=np.float64)
    if not (np.isfinite(mean).all() and np.isfinite(eigen).all()):
        raise EpisodeRefused([("not-finite", f"NaN or infinity in the {space} weights")])
    if space == "task" and len(mean) != len(POSE_NAMES):
        raise EpisodeRefused([("joint-count", f"task weights of 7 coordinates are needed, got {len(mean)}")])
    vectors = eigen[:, 1:]
    covariance = eigen[:, 0, None, None] * vectors[:, :, None] * vectors[:, None, :]
    return WeightDistribution(mean, covariance, RECORDED_WIDTH, space)
