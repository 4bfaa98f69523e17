"""Take the images that a list names out of a data set."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from punnet.data.dataset import Dataset
from punnet.errors import ConfigurationError, FileFormatError

__all__ = ["FIXED_PARTS", "choose_part"]

FIXED_PARTS = ("train", "test")
FIXED_SPLIT = "strawdi_test_160_40.json"


def choose_part(dataset: Dataset, split: str) -> Dataset:
    """The images of a part of a data set, in the order of the data set.

    Parameters
    ----------
    dataset
        The whole.
    split
        ``train`` or ``test`` of the fixed split of StrawDI's 200 test images, or a JSON file: a list of file names or
        image ids, or an object whose ``parts`` hold such lists, of which ``test`` is taken.

    Raises
    ------
    FileFormatError
        If the file is missing or of another form.
    ConfigurationError
        If an image of the list is not in the data set, or the list is empty.
    """
    if split in FIXED_PARTS:
        text = files("punnet.data.splits").joinpath(FIXED_SPLIT).read_text(encoding="utf-8")
        wanted = json.loads(text)["parts"][split]
        where = f"{split} of the fixed split of StrawDI's test images"
    else:
        wanted, where = _read_list(Path(split)), split
    places = {image.path.name: index for index, image in enumerate(dataset)}
    ids = {image.id: index for index, image in enumerate(dataset)}
    indices = [places.get(name) if isinstance(name, str) else ids.get(name) for name in wanted]
    if strangers := [name for name, index in zip(wanted, indices, strict=True) if index is None]:
        raise ConfigurationError(
            f"{where}: {len(strangers)} of {len(wanted)} images are not in {dataset.name}, {strangers[0]!r} among them"
        )
    chosen = sorted({index for index in indices if index is not None})
    if not chosen:
        raise ConfigurationError(f"{where}: names no image")
    return dataset.subset(chosen)


def _read_list(path: Path) -> list[Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FileFormatError(
            f"{path}: no such file; a split is {' or '.join(FIXED_PARTS)} (of StrawDI) or a JSON list of file names"
        ) from error
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if isinstance(data, dict):
        parts = data.get("parts")
        data = parts.get("test") if isinstance(parts, dict) else None
    if not isinstance(data, list) or not all(
        isinstance(name, str | int) and not isinstance(name, bool) for name in data
    ):
        raise FileFormatError(
            f"{path}: must be a list of file names or image ids, or an object with such a list as parts.test"
        )
    return data
