"""What readers share: JSON that may be damaged, numbers that may be anything, photographs beside a file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.errors import FileFormatError

__all__ = [
    "IMAGE_SUFFIXES",
    "beside",
    "find_image_folder",
    "image_size",
    "integer",
    "list_images",
    "number",
    "numbers",
    "read_json",
    "read_json_with_gaps",
    "read_text",
    "require_object",
]

IMAGE_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
# Where annotation tools put the photographs, seen from the annotation file.
IMAGE_FOLDERS = ("", "images", "img", "../images", "../img", "images/default", "../images/default", "..")


def read_text(path: Path) -> str:
    """Read UTF-8 text, with or without a byte order mark.

    Raises
    ------
    FileFormatError
        If the file is missing, a folder, unreadable or no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file") from error
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: not UTF-8 text ({error})") from error
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: can't be read ({error})") from error


def read_json(path: Path) -> Any:
    """Read strict JSON: NaN and infinities, which it does not know, are faults.

    Raises
    ------
    FileFormatError
        If the file is missing, unreadable or no JSON.
    """
    return _parsed(path, _refuse_constant)


def read_json_with_gaps(path: Path) -> Any:
    """Read JSON as Python's ``json.dump`` writes measurements: NaN and infinities count as null.

    Raises
    ------
    FileFormatError
        If the file is missing, unreadable or no JSON.
    """
    return _parsed(path, lambda _: None)


def _parsed(path: Path, constant: Callable[[str], Any]) -> Any:
    try:
        return json.loads(read_text(path), parse_constant=constant)
    except FileFormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number; write null or leave the field out")


def require_object(value: Any, where: str) -> dict[str, Any]:
    """``value`` if it is a JSON object.

    Raises
    ------
    FileFormatError
        If it is anything else.
    """
    if not isinstance(value, dict):
        raise FileFormatError(f"{where}: a JSON object is needed, got {type(value).__name__}")
    return value


def number(value: Any, where: str) -> float:
    """``value`` as a finite float; text that reads as a number will do.

    Raises
    ------
    FileFormatError
        If it is anything else.
    """
    try:
        found = math.nan if isinstance(value, bool) or value is None else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise FileFormatError(f"{where}: a number is needed, got {value!r:.80}")
    return found


def integer(value: Any, where: str) -> int:
    """``value`` as an integer; ``3.0`` and ``"3"`` will do.

    Raises
    ------
    FileFormatError
        If it is anything else, or does not fit into 64 bits.
    """
    if isinstance(value, int) and not isinstance(value, bool):
        found = value
    else:
        exact = number(value, where)
        found = int(exact)
        if found != exact:
            raise FileFormatError(f"{where}: a whole number is needed, got {value!r:.80}")
    if abs(found) >= 2**63:
        raise FileFormatError(
            f"{where}: a whole number of {found.bit_length()} bits is too large; 63 are possible"
        )
    return found


def numbers(values: Any, count: int, where: str) -> list[float]:
    """``values`` as ``count`` finite floats.

    Raises
    ------
    FileFormatError
        If there are more or fewer, or one is no number.
    """
    if not isinstance(values, list | tuple) or len(values) != count:
        found = f"{len(values)} of them" if isinstance(values, list | tuple) else f"{values!r:.80}"
        raise FileFormatError(f"{where}: {count} numbers are needed, got {found}")
    return [number(value, where) for value in values]


def beside(folder: Path, name: Any, where: str) -> Path:
    """Path of a file that another file names, relative to ``folder``.

    Raises
    ------
    FileFormatError
        If the name is no usable text.
    """
    if not isinstance(name, str) or not name or "\0" in name:
        raise FileFormatError(f"{where}: the name of a file is needed, got {name!r:.80}")
    posix: str = name.replace("\\", "/")  # Windows tools write backslashes
    if ".." not in posix.split("/"):
        return folder / posix
    # The parent of a linked folder is that of the folder it leads to.
    return Path(os.path.normpath(folder.resolve() / posix))


def find_image_folder(folder: Path, names: Iterable[str]) -> Path:
    """The first folder near ``folder`` that holds one of the first few ``names``; ``folder`` itself if none does."""
    some = [name for _, name in zip(range(5), names, strict=False)]
    for place in IMAGE_FOLDERS:
        candidate = Path(os.path.normpath(folder / place))
        if any(_is_file(candidate / name) for name in some):
            return candidate
    return folder


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def list_images(folder: Path) -> list[Path]:
    """Photographs directly in ``folder``, by name."""
    return sorted(
        path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES and path.is_file()
    )


def image_size(path: Path) -> tuple[int, int]:
    """(H, W) of a photograph, turned as its EXIF orientation says: as :func:`~punnet.scene.read_image` gives it.

    Raises
    ------
    FileFormatError
        If it is missing or no image.
    """
    try:
        encoded = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: no readable image; its size is needed") from error
    image = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
    if image is None:
        raise FileFormatError(f"{path}: not an image, or damaged; its size is needed")
    return int(image.shape[0]), int(image.shape[1])
