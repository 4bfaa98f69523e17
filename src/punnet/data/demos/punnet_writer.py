"""Writing Punnet's own folder of demonstrations; :mod:`punnet.data.demos.punnet_folder` says what is in it."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import punnet
from punnet.data.demos.episode import DemonstrationSet, Episode, Photograph
from punnet.data.demos.pictures import EncodedPicture, PictureFile
from punnet.data.demos.punnet_folder import DESCRIPTION, SCHEMA, TRAJECTORIES
from punnet.data.demos.trajectory import Trajectory, WeightDistribution
from punnet.errors import OutputError, ShapeError
from punnet.outputs import OutputFolder

__all__ = ["describe_episodes", "trajectory_archive", "write_punnet_folder"]


def write_punnet_folder(
    demonstrations: DemonstrationSet, folder: str | Path, *, force: bool = False
) -> list[str]:
    """Write the set with its photographs; they are copied as they are where they are files.

    Returns
    -------
    list
        What the format has no place for: nothing.

    Raises
    ------
    OutputExistsError
        If the folder exists and ``force`` is not set, or was not made by Punnet.
    FileFormatError
        If a photograph can't be read.
    """
    with OutputFolder(folder, force=force) as output:
        for name in ("rgb", "depth"):
            (output.path / name).mkdir()
        photographs = [
            [_copy(output.path, f"{number:06d}-{k}", one) for k, one in enumerate(episode.photographs)]
            for number, episode in enumerate(demonstrations)
        ]
        (output.path / TRAJECTORIES).write_bytes(trajectory_archive(demonstrations))
        description = describe_episodes(demonstrations, photographs)
        (output.path / DESCRIPTION).write_text(json.dumps(description, indent=1, allow_nan=False) + "\n")
    return []


def describe_episodes(
    demonstrations: DemonstrationSet, photographs: list[list[dict[str, Any]]]
) -> dict[str, Any]:
    """``demonstrations.json`` of a set whose photographs lie where the entries say."""
    return {
        "schema": SCHEMA,
        "punnet": punnet.__version__,
        "complete": True,
        "joint_names": list(demonstrations.joint_names),
        "info": _plain(demonstrations.info),
        "episodes": [
            _entry(episode, places) for episode, places in zip(demonstrations, photographs, strict=True)
        ],
    }


def _entry(episode: Episode, photographs: list[dict[str, Any]]) -> dict[str, Any]:
    entry: dict[str, Any] = {"id": episode.id, "target_id": episode.target_id}
    if episode.group is not None:
        entry["group"] = episode.group
    if episode.movement.clock == "phase":
        entry["clock"] = "phase"
    if episode.target is not None:
        entry["box"] = [round(float(value), 3) for value in episode.target.box]
        if episode.target.picking_point is not None:
            entry["picking_point"] = [round(float(value), 6) for value in episode.target.picking_point]
    entry["photographs"] = photographs
    if episode.extra:
        entry["extra"] = _plain(episode.extra)
    return entry


def _copy(folder: Path, stem: str, photograph: Photograph) -> dict[str, Any]:
    """Put a photograph into the folder; its entry."""
    picture = photograph.picture
    if isinstance(picture, PictureFile) and photograph.size is not None:
        name = f"rgb/{stem}{picture.path.suffix.lower()}"
        _copy_file(picture.path, folder / name)
    elif isinstance(picture, EncodedPicture):
        is_png = picture.content.startswith(b"\x89PNG")
        name = f"rgb/{stem}{'.png' if is_png else '.jpg'}"
        (folder / name).write_bytes(picture.content)
    else:
        name = f"rgb/{stem}.png"
        _write_image(folder / name, photograph.rgb()[:, :, ::-1])
    entry: dict[str, Any] = {"rgb": name}
    if photograph.size is not None:
        entry["size"] = list(photograph.size)
    if photograph.time:
        entry["time"] = photograph.time
    if photograph.depth_path is not None:
        entry["depth"] = f"depth/{stem}.png"
        _copy_file(photograph.depth_path, folder / entry["depth"])
        entry["depth_scale"] = photograph.depth_scale
    if photograph.camera is not None:
        entry["camera"] = photograph.camera.to_json()
    if photograph.T_base_camera is not None:
        entry["T_base_camera"] = photograph.T_base_camera.tolist()
    return entry


def _copy_file(source: Path, place: Path) -> None:
    try:
        shutil.copyfile(source, place)
    except OSError as error:
        raise OutputError(f"{source}: can't be copied to {place} ({error.strerror})") from error


def _write_image(path: Path, image: NDArray[Any]) -> None:
    done, encoded = cv2.imencode(".png", np.ascontiguousarray(image))
    if not done:
        raise OutputError(f"{path}: could not be encoded as PNG")
    path.write_bytes(encoded.tobytes())


def trajectory_archive(demonstrations: DemonstrationSet) -> bytes:
    """``trajectories.npz``: the same set gives the same bytes."""
    arrays: dict[str, NDArray[Any]] = {}
    for prefix, values, width in (("joint", "joints", len(demonstrations.joint_names)), ("pose", "poses", 7)):
        parts: list[Trajectory | None] = [getattr(episode, values) for episode in demonstrations]
        arrays[f"{prefix}_offsets"] = np.cumsum([0, *(0 if part is None else len(part) for part in parts)])
        arrays[f"{prefix}_times"] = _joined([part.times for part in parts if part is not None], (0,))
        arrays[values] = _joined([part.values for part in parts if part is not None], (0, width))
    arrays |= _weight_arrays(demonstrations)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def _joined(parts: list[NDArray[np.float64]], empty: tuple[int, ...]) -> NDArray[np.float64]:
    return np.concatenate(parts) if parts else np.zeros(empty)


def _weight_arrays(demonstrations: DemonstrationSet) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}
    for space in ("joint", "task"):
        weights: list[WeightDistribution | None] = [
            getattr(episode, f"{space}_weights") for episode in demonstrations
        ]
        known = [one for one in weights if one is not None]
        if not known:
            continue
        widths = {one.width for one in known}
        if len(known) < len(weights) or len(widths) > 1 or len({one.mean.shape for one in known}) > 1:
            raise ShapeError(
                f"{demonstrations.name}: {len(known)} of {len(weights)} episodes have {space} weights, or their "
                "bases differ; all episodes must have them, of one basis, or none"
            )
        arrays[f"{space}_weight_mean"] = np.stack([one.mean for one in known])
        arrays[f"{space}_weight_covariance"] = np.stack([one.covariance for one in known])
        arrays[f"{space}_basis_width"] = np.array(widths.pop())
    return arrays


def _plain(value: Any) -> Any:
    """JSON can hold it; what it can't is written in words."""
    if isinstance(value, dict):
        return {str(name): _plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else repr(value)
    return value if value is None or isinstance(value, str | int) else repr(value)
