"""Take the images that a list names out of a data set."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

from punnet.data.dataset import Dataset
from punnet.data.splits.splitting import apply_split, read_split
from punnet.errors import FileFormatError

__all__ = ["FIXED_PARTS", "choose_part"]

TEST = "test"
FIXED_PARTS = ("train", TEST)
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
    SplitError
        If an image of the list is not in the data set.
    """
    if split in FIXED_PARTS:
        text = files("punnet.data.splits").joinpath(FIXED_SPLIT).read_text(encoding="utf-8")
        wanted = json.loads(text)["parts"][split]
        where = f"{split} of the fixed split of StrawDI's test images"
    else:
        wanted, where = _read_list(Path(split)), split
    return dataset.subset(apply_split(dataset, {TEST: wanted}, where).parts[TEST])


def _read_list(path: Path) -> list[str | int]:
    if not path.is_file():
        raise FileFormatError(
            f"{path}: no such file; a split is {' or '.join(FIXED_PARTS)} (of StrawDI) or a JSON list of file names"
        )
    try:
        names = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if isinstance(names, dict):
        names = read_split(path).get(TEST)
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(name, str | int) and not isinstance(name, bool) for name in names)
    ):
        raise FileFormatError(
            f"{path}: needs a list of file names or image ids, or an object 'parts' with such a list as '{TEST}'"
        )
    return names
