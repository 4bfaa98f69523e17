"""``punnet data convert``: labelled images of any format in, one annotation out."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import busy, counted_progress, note, print_json, say
from punnet.cli.data_options import ClassMapping, DataFormat, DataPath, class_map_of
from punnet.cli.options import Json

if TYPE_CHECKING:
    from punnet.data.dataset import Dataset

__all__ = ["Target", "convert"]

YOLO_PARTS = {"validation": "val"}


class Target(StrEnum):
    """Formats that are written."""

    COCO = "coco"
    YOLO_SEGMENTATION = "yolo-segment"
    YOLO_POSE = "yolo-pose"


def convert(
    path: DataPath,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="A JSON file (COCO) or a folder (YOLO).", show_default=False),
    ],
    to: Annotated[Target, typer.Option("--to", help="What to write.")] = Target.COCO,
    data_format: DataFormat = None,
    class_map: ClassMapping = None,
    lists: Annotated[
        Path | None,
        typer.Option(
            "--list",
            help="YOLO: the split.json that says which image is in which part.",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
    as_json: Json = False,
) -> None:
    """Convert labelled images to COCO, masks and key-points in one annotation, or to YOLO.

    COCO names the photographs where they are, relative to the new file. What can't be read is left out, said so, and
    makes the exit code 1.
    """
    from punnet.data.lenient import read_readable, with_photographs
    from punnet.errors import ConfigurationError, FileFormatError
    from punnet.outputs import require_folder_name, require_suffix

    if lists is not None and to is Target.COCO:
        raise ConfigurationError("--list is for YOLO; punnet data split writes a COCO file for each part")
    if to is Target.COCO:
        require_suffix(out, ".json")
    else:
        require_folder_name(out)
    with busy("reading"):
        dataset, faults = read_readable(path, data_format, class_map=class_map_of(class_map))
    with counted_progress("checking photographs") as progress:
        dataset, bad = with_photographs(dataset, progress)
    left_out = [*map(str, faults), *bad]
    for message in left_out:
        note(f"left out: {message}")
    if not len(dataset):
        raise FileFormatError(f"{path}: no image is left to be written")
    parts = {"": dataset} if lists is None else _parts(dataset, lists)
    with busy("writing"):
        losses = _write(dataset if lists is None else parts, out, to, force)
    for loss in losses:
        note(f"not in YOLO: {loss}")
    if unlisted := len(dataset) - sum(map(len, parts.values())):
        note(f"{unlisted} images are in no list and were not written")
    images = [image for part in parts.values() for image in part]
    berries = sum(len(image.annotations) for image in images)
    if as_json:
        summary = {"out": str(out), "to": str(to), "images": len(images), "annotations": berries}
        print_json(summary | {"left_out": left_out, "lost": losses})
    else:
        say(f"wrote {out}: {len(images)} images, {berries} annotations")
    if left_out:
        entries = {(fault.annotation_id is None, fault.position) for fault in faults}
        note(f"{len(entries) + len(bad)} images or annotations left out")
        raise typer.Exit(1)


def _parts(dataset: Dataset, lists: Path) -> dict[str, Dataset]:
    """The parts of a ``split.json``, called as YOLO calls them."""
    from punnet.data.splits import apply_split, read_split

    chosen = apply_split(dataset, read_split(lists), str(lists))
    return {YOLO_PARTS.get(name, name): dataset.subset(part) for name, part in chosen.parts.items()}


def _write(data: Dataset | Mapping[str, Dataset], out: Path, to: Target, force: bool) -> list[str]:
    """Write it; say what the format has no place for."""
    from punnet.data import write_coco, write_yolo
    from punnet.data.dataset import Dataset

    if isinstance(data, Dataset) and to is Target.COCO:
        write_coco(data, out, force=force)
        return []
    return write_yolo(data, out, "segment" if to is Target.YOLO_SEGMENTATION else "pose", force=force)
