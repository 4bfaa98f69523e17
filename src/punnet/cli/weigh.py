"""``punnet weigh``: grams of the berries of one RGB-D frame."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import note, print_json, print_table
from punnet.cli.eyes import detector_for_photographs
from punnet.cli.options import CameraFile, DepthFile, DetectorName, Force, Json, RgbFile

if TYPE_CHECKING:
    from punnet.scene import Frame, Strawberries

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        epilog="Example: punnet weigh --rgb rgb.png --depth depth.png --camera camera.json --out weighed"
    )(weigh)


def weigh(
    rgb: RgbFile,
    depth: DepthFile,
    camera: CameraFile,
    detector: DetectorName = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for overlay.png and strawberries.json.")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Weigh berries by eye: grams with an interval, from colour, depth and the camera."""
    from punnet.outputs import OutputFolder
    from punnet.scene import Frame
    from punnet.weight import EllipsoidEstimator

    frame = Frame.from_files(rgb, depth=depth, camera=camera)
    berries = detector_for_photographs(detector).detect(frame)
    estimates = EllipsoidEstimator().estimate(frame, berries)
    berries = berries.with_fields(weights=estimates.grams, weight_intervals=estimates.intervals)
    if out is not None:
        with OutputFolder(out, force=force) as output:
            _write(output.path, frame, berries)
    if as_json:
        rows = berries.to_json()["berries"]
        for row, reason in zip(rows, estimates.reasons, strict=True):
            row.pop("segmentation", None)
            row["reason"] = reason
        print_json({"frame": str(rgb), "coverage": estimates.coverage, "berries": rows})
        return
    if len(berries) == 0:
        note(f"no berries in {rgb}")
        return
    print_table(
        "",
        ("berry>", "class", "grams>", f"{100 * estimates.coverage:.0f}% interval>", "why not"),
        [
            (
                str(berries.ids[i]),
                "pluckable" if berries.pluckable[i] else "unpluckable",
                _grams(estimates.grams[i]),
                "" if reason else f"{estimates.intervals[i, 0]:.1f} to {estimates.intervals[i, 1]:.1f}",
                reason or "",
            )
            for i, reason in enumerate(estimates.reasons)
        ],
    )


def _grams(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1f}"


def _write(folder: Path, frame: Frame, berries: Strawberries) -> None:
    import cv2

    from punnet.scene.overlay import draw_overlay

    _, encoded = cv2.imencode(".png", draw_overlay(frame.rgb, berries)[:, :, ::-1])
    (folder / "overlay.png").write_bytes(encoded.tobytes())
    (folder / "strawberries.json").write_text(json.dumps(berries.to_json()) + "\n")
