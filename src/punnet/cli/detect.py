"""``punnet detect``: find the berries of photographs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from punnet.cli.console import note, print_json, print_table, say, track
from punnet.cli.eyes import detector_for_photographs
from punnet.cli.options import DetectorName, Force, Json, OutFolder

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: punnet detect photos/ --out found --score 0.3")(detect)


def detect(
    photos: Annotated[Path, typer.Argument(help="A photograph, or a folder of them.", show_default=False)],
    out: OutFolder,
    detector: DetectorName = None,
    score: Annotated[
        float | None,
        typer.Option(
            "--score",
            min=0.0,
            max=0.999,
            help="Leave out detections less sure than this; the detector has its own default.",
            show_default=False,
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Find berries: masks, key-points and ripeness, as pictures, JSON and COCO.

    Writes overlays/*.jpg, berries/*.json and detections.json (COCO) into --out. A photograph that can't be
    read is left out, said so, and makes the exit code 1.
    """
    from punnet.outputs import OutputFolder
    from punnet.perception.batch import detect_photos, list_photos

    chosen = list_photos(photos)
    eyes = detector_for_photographs(detector, score=score)
    with OutputFolder(out, force=force) as output:
        results = []
        for result in track(detect_photos(chosen, eyes, output), len(chosen), "detecting"):
            results.append(result)
            if result.error is not None:
                note(f"left out: {result.error}")
        if all(result.error is not None for result in results):
            note("no photograph could be read")
            raise typer.Exit(1)
    left_out = sum(result.error is not None for result in results)
    if as_json:
        print_json({"out": str(out), "photos": [result.to_json() for result in results]})
    else:
        print_table(
            "",
            ("photograph", "berries>", "pluckable>", "ms>"),
            [
                (
                    result.photo.name,
                    str(result.berries),
                    str(result.pluckable),
                    f"{1000 * result.seconds:.0f}",
                )
                for result in results
                if result.error is None
            ],
        )
        found = sum(result.berries for result in results)
        say(f"{found} berries in {len(results) - left_out} photographs; see {out}")
    if left_out:
        note(f"{left_out} of {len(results)} photographs left out")
        raise typer.Exit(1)
