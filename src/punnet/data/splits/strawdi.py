"""The fixed split of StrawDI_Db1's 200 test images by which Punnet's field results are reported."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import PurePath

__all__ = ["strawdi_split"]


def strawdi_split() -> tuple[list[int], list[int]]:
    """160 image ids to train with and 40 to test with, ascending; the id is the number in the file's name.

    Drawn once with seed 3, stratified by the count of ripe berries. The two images of one plant (2290 and 2807, the
    only such pair) are in the same part.
    """
    text = files("punnet.data.splits").joinpath("strawdi_test_160_40.json").read_text(encoding="utf-8")
    parts: dict[str, list[str]] = json.loads(text)["parts"]
    train, test = (sorted(int(PurePath(name).stem) for name in parts[part]) for part in ("train", "test"))
    return train, test
