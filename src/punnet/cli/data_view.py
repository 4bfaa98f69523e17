"""``punnet data view``: labelled images as contact sheets, or as a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import counted_progress, note, print_json, say, track
from punnet.cli.data_options import ClassMapping, DataFormat, DataPath, class_map_of
from punnet.cli.options import Force, Json

if TYPE_CHECKING:
    from punnet.data.gallery import Gallery

__all__ = ["view"]


def view(
    path: DataPath,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for contact sheets, or a PNG or JPEG for one.", show_default=False
        ),
    ] = None,
    serve: Annotated[
        bool, typer.Option("--serve", help="Show them in the browser, on this machine.")
    ] = False,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="With --serve; 0 takes any.")] = 8020,
    columns: Annotated[int, typer.Option("--columns", min=1, help="Photographs across a sheet.")] = 4,
    rows: Annotated[int, typer.Option("--rows", min=1, help="Photographs down a sheet.")] = 4,
    cell: Annotated[int, typer.Option("--cell", min=64, help="Longest side of each, pixels.")] = 480,
    data_format: DataFormat = None,
    class_map: ClassMapping = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Show masks, key-points (filled visible, hollow hidden by itself, crossed hidden by other), classes and ids.

    The path may also be what punnet detect wrote, or a folder of bare photographs. With --serve, faults are shown too,
    and Ctrl-C ends it.
    """
    from punnet.data.gallery import open_gallery, open_images

    if serve == (out is not None):
        raise typer.BadParameter("give either --out or --serve")
    if serve:
        with counted_progress("checking photographs") as progress:
            gallery = open_gallery(path, data_format, class_map=class_map_of(class_map), progress=progress)
        _serve(gallery, port)
        return
    from punnet.data.contact_sheet import (
        PICTURE_SUFFIXES,
        SheetLayout,
        write_contact_sheets,
        write_one_sheet,
    )
    from punnet.outputs import OutputFolder

    assert out is not None
    dataset, left_out = open_images(path, data_format, class_map=class_map_of(class_map))
    layout = SheetLayout(columns, rows, cell)
    if out.suffix.lower() in PICTURE_SUFFIXES and not out.is_dir():
        sheets = [write_one_sheet(dataset, out, layout, force=force)]
    else:
        with OutputFolder(out, force=force) as output:
            pages = layout.pages(len(dataset))
            sheets = list(track(write_contact_sheets(dataset, output, layout), pages, "drawing"))
    if as_json:
        print_json({"out": str(out), "images": len(dataset), "sheets": [sheet.name for sheet in sheets]})
    else:
        many = "sheet" if len(sheets) == 1 else "sheets"
        say(f"{len(dataset)} images on {len(sheets)} {many}; see {out}")
    for message in left_out:
        note(f"left out: {message}")
    if left_out:
        raise typer.Exit(1)


def _serve(gallery: Gallery, port: int) -> None:
    from punnet.data.viewer import GalleryServer

    if gallery.left_out:
        note(f"{gallery.left_out} entries can't be read and are not shown; punnet data validate says why")
    with GalleryServer(gallery, port) as server:
        say(f"{len(gallery.items)} photographs at {server.url}  (Ctrl-C ends)")
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            note("stopped")
