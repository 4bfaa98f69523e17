"""Split a data set into parts that share no plant, and write each as a COCO file."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.coco import write_coco
from punnet.data.dataset import AnnotatedImage, Dataset
from punnet.data.splits.sharing import SplitError, share_out
from punnet.errors import FileFormatError
from punnet.outputs import write_text
from punnet.scene import PLUCKABLE

__all__ = ["SPLIT_FILE", "SPLIT_SCHEMA", "Split", "apply_split", "read_split", "split_dataset", "write_split"]

SPLIT_SCHEMA = "punnet-split/1"
SPLIT_FILE = "split.json"
BY_IMAGE, BY_GROUP = "image", "group"


@dataclass(frozen=True)
class Split:
    """Which image is in which part.

    Parameters
    ----------
    parts
        Indices of images by the part's name, ascending.
    groups
        The group of each image.
    grouped_by
        What tells the groups: ``image`` (each by itself), ``group`` (the field), ``pattern …`` or ``list …``.
    seed
        What it was drawn with; None if it was not drawn.
    """

    parts: dict[str, list[int]]
    groups: tuple[str, ...]
    grouped_by: str
    seed: int | None = None

    @property
    def straddling(self) -> list[str]:
        """Groups that have images in more than one part."""
        places = Counter(group for part in self.parts.values() for group in {self.groups[i] for i in part})
        return sorted(group for group, count in places.items() if count > 1)


def split_dataset(
    dataset: Dataset, shares: Mapping[str, float], *, seed: int = 0, pattern: str | None = None
) -> Split:
    """Share a data set's images out by group; parts are alike in their count of pluckable berries.

    Groups are told by ``pattern``, else by the images' field ``group``, else each image is its own. An image that has
    no group, or does not match, is a group by itself.

    Parameters
    ----------
    dataset
        What to split.
    shares
        Share of the images of each part, summing to 1.
    seed
        Of what shuffles the groups.
    pattern
        Regular expression looked for in the file name; its first group, or all that matches, names the plant.

    Raises
    ------
    SplitError
        If the shares or the pattern are impossible, no file name matches, or a part would stay empty.
    """
    names, grouped_by = _groups(dataset, pattern)
    ripe = [sum(a.class_index == PLUCKABLE and not a.crowd for a in image.annotations) for image in dataset]
    parts = share_out(names, shares, np.random.default_rng(seed), strata=np.array(ripe, dtype=np.float64))
    return Split(parts, tuple(names), grouped_by, seed)


def _groups(dataset: Dataset, pattern: str | None) -> tuple[list[str], str]:
    if pattern is not None:
        try:
            expression = re.compile(pattern)
        except re.error as error:
            raise SplitError(f"pattern '{pattern}': not a regular expression ({error})") from error
        found = [expression.search(image.path.name) for image in dataset]
        if not any(found):
            example = dataset[0].path.name if len(dataset) else "none"
            raise SplitError(f"pattern '{pattern}': found in no file name; the first is {example}")
        keys = [_key(match) for match in found]
        return _with_singles(dataset, keys), f"pattern {pattern}"
    if any(image.group is not None for image in dataset):
        return _with_singles(dataset, [image.group for image in dataset]), BY_GROUP
    return _with_singles(dataset, [None] * len(dataset)), BY_IMAGE


def _key(match: re.Match[str] | None) -> str | None:
    if match is None:
        return None
    return str(match.group(1) or "") if match.re.groups else match.group()


def _with_singles(dataset: Dataset, keys: list[str | None]) -> list[str]:
    # A slash keeps them apart from any group's own name that happens to be equal.
    return [
        f"image/{image.id}" if key is None else str(key) for image, key in zip(dataset, keys, strict=True)
    ]


def write_split(dataset: Dataset, split: Split, folder: Path) -> list[Path]:
    """Write ``<part>.json`` (COCO; file names lead to the photographs where they are) and ``split.json``.

    Parameters
    ----------
    dataset, split
        What to write.
    folder
        An existing folder; its last place if paths are to hold.

    Returns
    -------
    list of Path
        The files.
    """
    written = [
        write_coco(dataset.subset(part), folder / f"{name}.json") for name, part in split.parts.items()
    ]
    return [*written, write_text(folder / SPLIT_FILE, json.dumps(_lists(dataset, split), indent=1) + "\n")]


def _lists(dataset: Dataset, split: Split) -> dict[str, Any]:
    unique = len({image.path.name for image in dataset}) == len(dataset)

    def label(image: AnnotatedImage) -> str | int:
        return image.path.name if unique else image.id

    return {
        "schema": SPLIT_SCHEMA,
        "name": dataset.name,
        "seed": split.seed,
        "grouped_by": split.grouped_by,
        "parts": {name: [label(dataset[i]) for i in part] for name, part in split.parts.items()},
    }


def read_split(path: str | Path) -> dict[str, list[str | int]]:
    """Lists of file names or image ids by part, of a ``split.json``.

    Raises
    ------
    FileFormatError
        If the file is missing or of another form.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file; punnet data split writes one") from error
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    parts = data.get("parts") if isinstance(data, dict) else None
    if not isinstance(parts, dict) or not parts or not all(_is_list(part) for part in parts.values()):
        raise FileFormatError(
            f"{path}: needs an object 'parts' with a list of file names or image ids for each part"
        )
    if bad := [name for name in parts if not re.fullmatch(r"[\w-]+", name) or name == "split"]:
        raise FileFormatError(f"{path}: '{bad[0]}' can't name a part; letters, digits, - and _ can")
    return parts


def _is_list(part: Any) -> bool:
    return (
        isinstance(part, list)
        and bool(part)
        and all(isinstance(name, str | int) and not isinstance(name, bool) for name in part)
    )


def apply_split(dataset: Dataset, lists: Mapping[str, list[str | int]], where: str) -> Split:
    """Split a data set as lists say; images that no list names are left out.

    Parameters
    ----------
    dataset
        What to split.
    lists
        File names or image ids by part.
    where
        The lists' file, for messages.

    Raises
    ------
    SplitError
        If a listed image is not in the data set, or is in two parts.
    """
    by_name: dict[str | int, int] = {image.path.name: i for i, image in enumerate(dataset)}
    by_name |= {image.id: i for i, image in enumerate(dataset)}
    parts: dict[str, list[int]] = {}
    owner: dict[int, str] = {}
    for part, labels in lists.items():
        if strangers := [label for label in labels if label not in by_name]:
            raise SplitError(
                f"{where}: {len(strangers)} images of part '{part}' are not in {dataset.name}, "
                f"{strangers[0]!r} among them"
            )
        parts[part] = sorted({by_name[label] for label in labels})
        for index in parts[part]:
            if index in owner:
                raise SplitError(
                    f"{where}: {dataset[index].path.name} is in both '{owner[index]}' and '{part}'; choose one"
                )
            owner[index] = part
    names, _ = _groups(dataset, None)
    return Split(parts, tuple(names), f"list {Path(where).name}")
