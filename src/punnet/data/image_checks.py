"""What can be wrong with the images of a COCO file: their entries, and the photographs themselves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from punnet.data.faults import Fault
from punnet.data.raw_coco import RawCoco
from punnet.data.raw_values import is_whole
from punnet.data.reading import beside, image_size
from punnet.errors import FileFormatError, PunnetError
from punnet.geometry import CameraIntrinsics

__all__ = ["Progress", "check_image_entries", "check_photographs", "name_of"]

DECODERS = 2
LONGEST_SIDE = 16_384
Progress = Callable[[int, int], None]


def check_image_entries(raw: RawCoco) -> Iterator[Fault]:
    """Yield the faults of the entries, without opening a photograph."""
    seen_ids: set[Any] = set()
    seen_names: Counter[str] = Counter()
    for position, image in enumerate(raw.images):
        if not isinstance(image, dict):
            message = f"entry {position + 1} of images is no object; remove it"
            yield Fault("image-field", message, raw.path, position=position)
            continue
        where: dict[str, Any] = {
            "file": raw.path,
            "image_id": image.get("id"),
            "file_name": name_of(image),
            "position": position,
        }
        if missing := [
            name for name, is_good in _IMAGE_FIELDS.items() if not is_good(image.get(name.partition(" ")[0]))
        ]:
            message = (
                f"{', '.join(missing)} missing or unusable; each image needs id, file_name, width and height"
            )
            yield Fault("image-field", message, **where)
        identity = image.get("id")
        if isinstance(identity, int | str):
            if identity in seen_ids:
                message = "another image has this id; give each its own, in its annotations too"
                yield Fault("duplicate-image-id", message, **where)
            seen_ids.add(identity)
        if (name := name_of(image)) is not None:
            seen_names[name] += 1
            if seen_names[name] == 2:
                yield Fault("duplicate-file-name", "is listed more than once; merge the entries", **where)


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and bool(value) and "\0" not in value


def _is_extent(value: Any) -> bool:
    return is_whole(value) and 0 < value <= LONGEST_SIDE


def _is_camera(value: Any) -> bool:
    if value is None:
        return True
    try:
        CameraIntrinsics.from_json(value, where="camera")
    except (PunnetError, TypeError, AttributeError, OverflowError):
        return False
    return True


_IMAGE_FIELDS: dict[str, Callable[[Any], bool]] = {
    "id": is_whole,
    "file_name": _is_name,
    "width": _is_extent,
    "height": _is_extent,
    "depth_path (if any)": lambda value: value is None or _is_name(value),
    "camera (if any)": _is_camera,
}


def check_photographs(raw: RawCoco, progress: Progress) -> Iterator[Fault]:
    """Yield the faults of the photographs; each is decoded once. ``progress`` is told how many of how many."""
    images = [
        (position, image)
        for position, image in enumerate(raw.images)
        if isinstance(image, dict) and name_of(image)
    ]
    # Decoding leaves Python's lock; a file cut off in the middle shows in no other way.
    with ThreadPoolExecutor(DECODERS) as pool:
        found = pool.map(lambda numbered: _photograph(numbered[1], raw), images)
        for done, ((position, image), findings) in enumerate(zip(images, found, strict=True), start=1):
            for code, message in findings:
                where: dict[str, Any] = {
                    "image_id": image.get("id"),
                    "file_name": name_of(image),
                    "position": position,
                }
                yield Fault(code, message, raw.path, **where)
            progress(done, len(images))


def _photograph(image: dict[str, Any], raw: RawCoco) -> list[tuple[str, str]]:
    findings: list[tuple[str, str]] = []
    path = beside(raw.image_folder, image["file_name"], str(raw.path))
    if not _is_file(path):
        findings.append(("missing-image", f"{path} is not there; copy it there, or give --images FOLDER"))
    else:
        try:
            height, width = image_size(path)
        except FileFormatError:
            findings.append(("unreadable-image", f"{path} is not an image, or damaged; copy it anew"))
        else:
            if (image.get("width"), image.get("height")) != (width, height):
                message = (
                    f"the file says {image.get('width')}×{image.get('height')}, the photograph is {width}×{height} "
                    "(turned as its EXIF says); correct the entry or the photograph"
                )
                findings.append(("size-mismatch", message))
    depth = image.get("depth_path")
    if _is_name(depth) and not _is_file(beside(raw.path.parent, depth, str(raw.path))):
        findings.append(("missing-depth", f"depth_path {depth} is not there; copy it there, or leave it out"))
    return findings


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file system takes
        return False


def name_of(image: dict[str, Any]) -> str | None:
    """File name of an image's entry, None if it has no usable one."""
    name = image.get("file_name")
    return name if _is_name(name) else None
