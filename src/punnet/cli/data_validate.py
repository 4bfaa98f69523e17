"""``punnet data validate``: what is wrong with a set of labelled images."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import counted, counted_progress, note, print_json, print_table, say
from punnet.cli.data_options import ClassMapping, DataFormat, DataPath, class_map_of
from punnet.cli.options import Json

if TYPE_CHECKING:
    from punnet.data.class_names import ClassMap
    from punnet.data.faults import FaultReport
    from punnet.data.fixing import Change
    from punnet.data.raw_coco import RawCoco

__all__ = ["validate"]


def validate(
    path: DataPath,
    images: Annotated[
        Path | None,
        typer.Option("--images", help="Folder of the photographs, if not near the file.", show_default=False),
    ] = None,
    data_format: DataFormat = None,
    class_map: ClassMapping = None,
    fix: Annotated[
        bool, typer.Option("--fix", help="Repair what needs no guessing, into the new file --out.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The new COCO file, with --fix.", show_default=False)
    ] = None,
    most: Annotated[int, typer.Option("--most", min=0, help="List no more faults than this.")] = 30,
    as_json: Json = False,
) -> None:
    """Find what is wrong: missing images, wrong sizes, damaged masks, key-points outside boxes, and more.

    Exit code 1 if there is a fault, or with --fix if one is left. A file is never overwritten.
    """
    from punnet.data.raw_coco import RawCoco
    from punnet.data.validation import validate_coco

    if fix != (out is not None):
        raise typer.BadParameter("--fix and --out NEW.json go together")
    meaning = class_map_of(class_map)
    raw = _open(path, images, data_format, meaning)
    changes: list[Change] = []
    if out is not None:
        from punnet.data.fixing import fix_coco

        fixed, changes = fix_coco(raw)
        raw = RawCoco(raw.path, fixed, raw.image_folder)
        _write(raw, out)
    with counted_progress("checking photographs") as progress:
        report = validate_coco(raw, class_map=meaning, progress=progress)
    if as_json:
        print_json(
            report.to_json() | ({"changes": [c.to_json() for c in changes], "out": str(out)} if fix else {})
        )
    else:
        _print(report, changes, out, most)
    if report.faults:
        raise typer.Exit(1)


def _open(path: Path, images: Path | None, data_format: str | None, class_map: ClassMap | None) -> RawCoco:
    """The COCO file as it stands; of any other format, what its reader makes of it."""
    from punnet.data.coco import dataset_to_coco
    from punnet.data.formats import read_dataset
    from punnet.data.raw_coco import RawCoco, find_coco_file, open_raw_coco
    from punnet.errors import FileFormatError

    if data_format in (None, "coco", "psd", "strawdi"):
        try:
            return open_raw_coco(find_coco_file(path), images)
        except FileFormatError:
            if data_format is not None or not path.is_dir():
                raise
    dataset = read_dataset(path, data_format, class_map=class_map)
    return RawCoco(path, dataset_to_coco(dataset, path), path)


def _write(raw: RawCoco, out: Path) -> None:
    import copy

    from punnet.data.fixing import rebase
    from punnet.errors import OutputExistsError
    from punnet.outputs import require_suffix, write_text

    require_suffix(out, ".json")
    # Inside a folder where photographs lie in a folder of their own, names stay as they are.
    data = raw.data
    if out.resolve().parent != raw.path.resolve().parent:
        data = rebase(
            copy.deepcopy(data), raw.path.resolve().parent, raw.image_folder.resolve(), out.resolve().parent
        )
    if out.exists():
        raise OutputExistsError(f"{out}: exists; a repaired file replaces none: give --out another name")
    write_text(out, json.dumps(data) + "\n")


def _print(report: FaultReport, changes: list[Change], out: Path | None, most: int) -> None:
    from punnet.data.faults import FAULTS

    for change in changes[:most]:
        say(str(change))
    if len(changes) > most:
        say(f"… and {len(changes) - most} more changes; --json lists all")
    if out is not None:
        say(f"wrote {out}, {len(changes)} changes; {report.path} is as it was")
    if not report.faults:
        say(f"{report.path}: no fault in {report.images} images and {report.annotations} annotations")
        return
    for fault in report.faults[:most]:
        say(f"{fault.where}: {fault.severity}: {fault.code}: {fault.message}")
    if len(report.faults) > most:
        say(f"… and {len(report.faults) - most} more; --json lists all, punnet data view --serve shows them")
    print_table(
        "",
        ("fault", "severity", "times>"),
        [(code, str(FAULTS[code]), str(count)) for code, count in report.by_code.items()],
    )
    note(
        f"{report.path}: {counted(report.errors, 'error')} and {counted(report.warnings, 'warning')} in "
        f"{report.images} images and {report.annotations} annotations"
    )
