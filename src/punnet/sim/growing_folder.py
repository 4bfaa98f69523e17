"""Folders that grow plant by plant: how they are begun, gone on with, filled with pictures and JSON, and completed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.outputs import MARKER_FILE, mark, require_folder_name, told_folder_errors, write_bytes

__all__ = [
    "DEPTH_UNIT",
    "PICTURES_AND_SHARDS",
    "finish_folder",
    "json_bytes",
    "open_folder",
    "shard_path",
    "write_pictures",
]

DEPTH_UNIT = 0.001
"""Metres that one count of a depth picture stands for."""

_SHARDS = ".plants"
PICTURES_AND_SHARDS = ("rgb", "depth", _SHARDS)
"""What is in a folder of photographs while it grows: one shard, the plant's labels, says that the plant is done."""

_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 92]
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 3]


def open_folder(
    place: Path,
    file: str,
    begun: Mapping[str, Any],
    *,
    what: str,
    parts: Sequence[str],
    force: bool,
    under: str | None = None,
) -> None:
    """Make the folder, or find that it holds the beginning of the same.

    Parameters
    ----------
    place
        The folder; parents are made.
    file
        In it, for what it was begun with.
    begun
        That: plain JSON with its ``schema``, the settings that decide the folder's content, and ``complete`` if a complete
        folder is not to be gone on with.
    what
        To call such a folder in messages.
    parts
        Folders in it.
    force
        Begin such a folder anew, whatever its settings.
    under
        Key of ``begun`` under which the settings are, if they have one.

    Raises
    ------
    OutputExistsError
        If it is complete or was begun with other settings and ``force`` is not set, or is something else.
    FileFormatError
        If it is damaged, or of another schema.
    OutputError
        If it can't be made, or has the name of a file.
    """
    require_folder_name(place)
    if place.exists() and not place.is_dir():
        raise OutputError(
            f"{place}: can't be made, a file stands where a folder is needed; give another folder"
        )
    found = _read(place / file, begun["schema"], what) if (place / file).is_file() else None
    if found is None and place.is_dir() and any(place.iterdir()):
        raise OutputExistsError(f"{place}: exists and is no {what}; give another folder")
    if found is not None and force:
        shutil.rmtree(place)
    elif found is not None:
        if found.get("complete"):
            raise OutputExistsError(f"{place}: is complete; give another folder or --force to make it anew")
        if under is None:
            _require_same(place, begun, found)
        else:
            _require_same(place, begun[under], found[under] if isinstance(found.get(under), dict) else {})
        return
    with told_folder_errors(place):
        for name in parts:
            (place / name).mkdir(parents=True, exist_ok=True)
    write_bytes(place / MARKER_FILE, mark(complete=False), force=True)
    write_bytes(place / file, json_bytes(begun), force=True)


def _read(path: Path, schema: str, what: str) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error}); remove the folder") from error
    if not isinstance(found, dict) or found.get("schema") != schema:
        raise FileFormatError(f"{path}: no description of a {what} ({schema}); give another folder")
    return found


def _require_same(place: Path, wanted: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    other = [name for name in {**wanted, **found} if wanted.get(name) != found.get(name)]
    other = [name for name in other if name != "command"] or other  # it says the same in one line
    if other:
        was = ", ".join(f"{name} {found.get(name, 'not given')!r}" for name in other)
        raise OutputExistsError(
            f"{place}: was begun with {was}; go on with the same, give another folder, or --force"
        )


def shard_path(place: Path, plant: int) -> Path:
    """Where a plant's labels are while the folder grows."""
    return place / _SHARDS / f"{plant:06d}.json"


def finish_folder(place: Path) -> None:
    """Mark a folder of photographs as complete, and remove what was there for its growth only."""
    write_bytes(place / MARKER_FILE, mark(complete=True), force=True)
    shutil.rmtree(place / _SHARDS)
    for half in (*(place / "rgb").glob(".*"), *(place / "depth").glob(".*")):
        half.unlink()  # begun by a run that was killed


def write_pictures(
    folder: Path, name: str, rgb: NDArray[np.uint8], depth: NDArray[np.float32]
) -> tuple[str, str]:
    """Write colours (H, W, 3) as JPEG and depth (H, W), metres, as 16-bit PNG; their places in the folder."""
    rgb_place, depth_place = f"rgb/{name}.jpg", f"depth/{name}.png"
    write_bytes(folder / rgb_place, _encoded(".jpg", rgb[:, :, ::-1], _JPEG), force=True)
    counts = np.rint(depth / np.float32(DEPTH_UNIT)).astype(np.uint16)
    write_bytes(folder / depth_place, _encoded(".png", counts, _PNG), force=True)
    return rgb_place, depth_place


def json_bytes(value: Any) -> bytes:
    """Indented JSON; NaN is refused."""
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _encoded(suffix: str, image: NDArray[Any], options: list[int]) -> bytes:
    done, encoded = cv2.imencode(suffix, image, options)
    if not done:
        raise OutputError(f"an image of {image.shape} could not be encoded as {suffix}")
    return bytes(encoded.tobytes())
