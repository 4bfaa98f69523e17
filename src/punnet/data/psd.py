"""PSD, real farm photographs: ``coco.json`` with polygons, five ripeness codes and five codes of clutter; ``img/``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from punnet.data.coco import open_coco
from punnet.data.coco_entries import entry_to_annotation
from punnet.data.dataset import Annotation, Dataset
from punnet.data.reading import integer
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

__all__ = ["HARDNESS_OCCLUSION", "PLUCKABLE_RIPENESS", "RIPENESS_SHARE", "psd_fields", "read_psd"]

PLUCKABLE_RIPENESS = (2, 3)
"""Codes of a berry to pick: 0 is unripe, 1 up to half, 2 up to nine tenths, 3 fully ripe, 4 rotten."""
RIPENESS_SHARE = {0: 0.0, 1: 0.5, 2: 0.9, 3: 1.0}
STAGE = {0: "green", 1: "turning", 2: "turning", 3: "ripe", 4: "rotten"}
HARDNESS_OCCLUSION = {0: 0.0, 1: 0.05, 2: 0.45, 3: 0.9}
"""Hidden share, the middle of each code: none, up to .1, .1 to .8, .8 to 1; 4 (out of reach) says nothing."""


def read_psd(folder: str | Path) -> Dataset:
    """Read a folder of PSD; pluckable is ripeness 2 or 3.

    Ripeness becomes a share (rotten: unknown) and a stage, hardness of picking a share that is hidden. The codes are
    kept as ``ripeness_code`` and ``hardness``.

    Raises
    ------
    FileFormatError
        If the file is missing, not COCO, or an annotation damaged.
    """
    folder = Path(folder)

    def read_entry(entry: dict[str, Any], identity: int, size: tuple[int, int], where: str) -> Annotation:
        code = integer(entry.get("ripeness"), f"{where}: ripeness")
        hardness = entry.get("hardness")
        rest = {name: value for name, value in entry.items() if name != "ripeness"}
        fields = psd_fields(
            code, None if hardness is None else integer(hardness, f"{where}: hardness"), where
        )
        class_index = PLUCKABLE if code in PLUCKABLE_RIPENESS else UNPLUCKABLE
        return entry_to_annotation({**rest, **fields}, identity, class_index, size, where)

    return open_coco(folder / "coco.json").dataset(folder / "img", read_entry)


def psd_fields(ripeness: int, hardness: int | None, where: str) -> dict[str, Any]:
    """Fields of Punnet's COCO dialect that say what PSD's codes say.

    Raises
    ------
    FileFormatError
        If a code is not 0 … 4.
    """
    for name, code in (("ripeness", ripeness), ("hardness", hardness)):
        if code is not None and code not in range(5):
            raise FileFormatError(f"{where}: {name} must be a code 0 … 4, got {code}")
    fields: dict[str, Any] = {"ripeness_code": ripeness, "stage": STAGE[ripeness]}
    if ripeness in RIPENESS_SHARE:
        fields["ripeness"] = RIPENESS_SHARE[ripeness]
    if hardness is not None:
        fields["hardness"] = hardness
        if hardness in HARDNESS_OCCLUSION:
            fields["occlusion"] = HARDNESS_OCCLUSION[hardness]
    return fields
