"""``punnet weigh``: grams of the berries of one RGB-D frame."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import note, print_json, print_table
from punnet.cli.eyes import detector_for_photographs
from punnet.cli.options import CameraFile, DepthFile, DetectorName, Force, Json, RgbFile

if TYPE_CHECKING:
    from punnet.scene import Frame, Strawberries
    from punnet.weight import WeightEstimates

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
    estimator: Annotated[
        str | None,
        typer.Option(
            "--estimator",
            help="A weight model's name (see punnet models) or folder, or: ellipsoid. Without it the best that comes "
            "with punnet.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for overlay.png and strawberries.json.")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Weigh berries by eye: grams with an interval, from colour, depth and the camera."""
    from punnet.errors import FileFormatError
    from punnet.outputs import OutputFolder
    from punnet.scene import Frame
    from punnet.weight.choosing import load_weight_estimator

    scale = load_weight_estimator(estimator)
    frame = Frame.from_files(rgb, depth=depth, camera=camera)
    if frame.camera is None:
        raise FileFormatError(f"{camera}: holds no camera; width, height, fx, fy, cx and cy are needed")
    berries = detector_for_photographs(detector).detect(frame)
    estimates = scale.estimate(frame, berries)
    berries = berries.with_fields(weights=estimates.grams, weight_intervals=estimates.intervals)
    if out is not None:
        with OutputFolder(out, force=force) as output:
            _write(output.path, frame, berries, estimates)
    if as_json:
        rows = berries.to_json()["berries"]
        for row, reason in zip(rows, estimates.reasons, strict=True):
            row.pop("segmentation", None)
            row["reason"] = reason
        print_json(
            {"frame": str(rgb), "estimator": scale.name, "coverage": estimates.coverage, "berries": rows}
        )
        return
    if len(berries) == 0:
        note(f"no berries in {rgb}")
        return
    print_table(
        f"by {scale.name}",
        ("berry>", "class", "grams>", f"{100 * estimates.coverage:.0f}% interval>", "why not"),
        [
            (
                str(berries.ids[i]),
                "pluckable" if berries.pluckable[i] else "unpluckable",
                "" if reason else f"{estimates.grams[i]:.1f} ± {_half_width(estimates, i):.1f}",
                "" if reason else f"{estimates.intervals[i, 0]:.1f} to {estimates.intervals[i, 1]:.1f}",
                reason or "",
            )
            for i, reason in enumerate(estimates.reasons)
        ],
    )


def _half_width(estimates: WeightEstimates, index: int) -> float:
    """Grams: half of the interval, which need not lie evenly about the estimate."""
    low, high = estimates.intervals[index]
    return float(high - low) / 2.0


def _write(folder: Path, frame: Frame, berries: Strawberries, estimates: WeightEstimates) -> None:
    import cv2

    from punnet.scene.overlay import draw_overlay

    labels = [
        "no weight" if reason else f"{estimates.grams[i]:.1f} g ({low:.0f}-{high:.0f})"
        for i, (reason, (low, high)) in enumerate(zip(estimates.reasons, estimates.intervals, strict=True))
    ]
    _, encoded = cv2.imencode(".png", draw_overlay(frame.rgb, berries, labels=labels)[:, :, ::-1])
    (folder / "overlay.png").write_bytes(encoded.tobytes())
    (folder / "strawberries.json").write_text(json.dumps(berries.to_json()) + "\n")
