"""``punnet evaluate``: every measure of a detector on annotated images."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import note, print_json, print_table, progress_bar, say
from punnet.cli.evaluate_planner import register_planner
from punnet.cli.evaluate_weight import register_weight
from punnet.cli.options import Force, Json

if TYPE_CHECKING:
    from punnet.perception.evaluation import Evaluation

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Measure how right it sees.", no_args_is_help=True)
    group.command(
        "detector",
        epilog="Example: punnet evaluate detector --bundle colour --data strawdi/test --split test",
    )(detector)
    register_weight(group)
    register_planner(group)
    app.add_typer(group, name="evaluate")


def detector(
    bundle: Annotated[
        str,
        typer.Option(
            "--bundle",
            "--detector",
            help="A model's name (see punnet models) or folder, or: colour.",
            show_default=False,
        ),
    ],
    data: Annotated[
        Path, typer.Option("--data", help="Annotated images: a folder, or a COCO file.", show_default=False)
    ],
    data_format: Annotated[
        str | None,
        typer.Option("--format", help="What the annotations are written in; guessed without it."),
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            "--split",
            help="Only these images: a JSON list of file names, or train or test of the fixed split of StrawDI.",
        ),
    ] = None,
    limit: Annotated[
        int | None, typer.Option("--limit", min=1, help="Only the first so many images.")
    ] = None,
    score: Annotated[
        float | None,
        typer.Option(
            "--score",
            min=0.0,
            max=0.999,
            help="Detections from here on count for all but average precision; the detector's own without it.",
        ),
    ] = None,
    ripe: Annotated[
        float | None,
        typer.Option(
            "--ripe", min=0.01, max=0.99, help="Ripeness that the colour baseline calls pluckable [0.65]."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for evaluation.json, scores.png and worst.png."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Average precision of masks and key-points, errors, confusions, what is missed, time an image.

    docs/evaluation.md says how each is measured. Images that can't be read are left out, said so, and make the
    exit code 1.
    """
    from punnet.data.formats import read_dataset
    from punnet.data.splits.part import choose_part
    from punnet.outputs import OutputFolder
    from punnet.perception import ColourConfig
    from punnet.perception.evaluation import evaluate_detector, prepare_detector
    from punnet.perception.evaluation_folder import write_evaluation

    colour = ColourConfig() if ripe is None else ColourConfig(ripe=ripe)
    eyes, settings = prepare_detector(bundle, score=score, colour=colour)
    images = read_dataset(data, data_format)
    if split is not None:
        images = choose_part(images, split)
    images = images.subset(range(len(images))[:limit])

    def measure() -> tuple[Evaluation, dict[str, Any]]:
        with progress_bar("evaluating", len(images)) as advance:
            evaluation = evaluate_detector(images, eyes, settings, data=images.name, progress=advance)
        return evaluation, evaluation.to_json() | {"split": split, "limit": limit}

    if out is None:
        _, figures = measure()
    else:
        with OutputFolder(out, force=force) as output:
            evaluation, figures = measure()
            write_evaluation(output.path, evaluation, figures, images.images, eyes)
    if as_json:
        print_json(figures)
    else:
        _print(figures)
        if out is not None:
            say(f"see {out}")
    if figures["skipped"]:
        for image in figures["skipped"]:
            note(f"left out: {image['error']}")
        note(f"{len(figures['skipped'])} of {len(images)} images left out")
        raise typer.Exit(1)


def _print(figures: dict[str, Any]) -> None:
    from punnet.perception.evaluation_tables import tables_of_evaluation

    for title, columns, rows in tables_of_evaluation(figures):
        print_table(title, columns, rows)
    ripeness, latency = figures["ripeness_error"], figures["latency"]
    if ripeness["berries"]:
        say(f"ripeness: mean error {ripeness['mean']:.3f} of 0…1, {ripeness['berries']} berries")
    machine = latency["machine"]
    say(
        f"{figures['detector']} on {figures['data']}, {figures['images']} images: "
        f"{1000 * latency['median_seconds']:.0f} ms an image, 90% within "
        f"{1000 * latency['ninety_percent_seconds']:.0f} ms ({machine['cores']} cores of {machine['processor']})"
    )
