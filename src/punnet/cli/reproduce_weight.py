"""``punnet reproduce fig-4-12``: every weight model of the thesis, and ours, trained and measured alike."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import counted_progress, note, print_json, progress_bar, say, whisper
from punnet.cli.options import Json, OutFolder, Seed
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.data import Dataset
    from punnet.weight.samples import WeightSamples

__all__ = ["fig_4_12"]

QUICK_IMAGES = 531
"""A third of Dataset-1."""


def fig_4_12(
    out: OutFolder,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            help="Images with depth, camera, masks and weights; without it Dataset-1 is simulated first.",
            show_default=False,
        ),
    ] = None,
    extra: Annotated[
        list[str] | None,
        typer.Option(
            "--extra",
            help="Images of other plants, from which models that learn fast (forests, shape) learn besides.",
        ),
    ] = None,
    models: Annotated[
        list[str] | None, typer.Option("--model", "-m", help="Only this model; may be given more than once.")
    ] = None,
    short: Annotated[
        list[str] | None,
        typer.Option(
            "--short", help="Train this model with its short settings; may be given more than once."
        ),
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="Short settings for all models and, without --data, a third of the images."
        ),
    ] = False,
    detectors: Annotated[
        list[str] | None,
        typer.Option(
            "--masks", help="Measure on the masks of this detector too; may be given more than once."
        ),
    ] = None,
    workers: Annotated[int, typer.Option("--workers", "-j", min=1, help="Models trained at a time.")] = 1,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Figure 4.12: percentage of correct weights of every model, the thesis' beside ours; table and bar chart.

    Runs are kept in the folder: a command that was stopped goes on, and what is trained is not trained again.
    """
    from time import monotonic

    from punnet.cli.train_weight import collect, need_training

    need_training()
    from punnet.bundle import list_bundles
    from punnet.data.formats import read_dataset
    from punnet.train.weight.figure_4_12 import (
        TRUTH,
        claim_folder,
        reproduce_figure_4_12,
        table_4_12,
        write_figure,
    )
    from punnet.train.weight.registry import MODELS
    from punnet.weight.choosing import load_weight_estimator
    from punnet.weight.sample_split import images_of_part

    names = models or list(MODELS)
    if unknown := sorted({*names, *(short or [])} - MODELS.keys()):
        raise ConfigurationError(f"no weight model '{unknown[0]}'; there are {', '.join(MODELS)}")
    claim_folder(out)
    place = _simulated(out, seed, QUICK_IMAGES if quick else None) if data is None else data
    dataset = read_dataset(place)
    tested = images_of_part(dataset, "test")
    samples = {TRUTH: _samples(dataset, None)} | {name: _samples(tested, name) for name in detectors or []}
    shipped = [manifest.name for manifest in list_bundles() if manifest.kind == "weight"]
    figure = reproduce_figure_4_12(
        samples,
        data=dataset.name,
        folder=out,
        seed=seed,
        quick=list(MODELS) if quick else short or [],
        models=names,
        bundles={f"{name}, as shipped": load_weight_estimator(name) for name in shipped},
        extra=collect(extra) if extra else None,
        extra_data=[Path(source).name for source in extra or []],
        workers=workers,
        progress=whisper,
        clock=monotonic,
    )
    write_figure(figure, out)
    if as_json:
        print_json(figure.to_json())
    else:
        say(table_4_12(figure).markdown())
        note(f"ours / the thesis'; see {out}")
    for name, why in figure.failed.items():
        note(f"{name} left out: {why}")
    skipped = samples[TRUTH].skipped
    for line in skipped:
        note(f"left out: {line}")
    if figure.failed or skipped:
        raise typer.Exit(1)


def _simulated(out: Path, seed: int, images: int | None) -> Path:
    """Dataset-1 in the figure's folder, made now if it is not there."""
    import json

    from punnet.sim.dataset_factory import simulate_dataset
    from punnet.sim.protocols import DATASET_1

    place = out / DATASET_1.name
    description = place / "data.json"
    if description.is_file() and json.loads(description.read_text()).get("complete"):
        return place
    wanted = images or DATASET_1.images
    with counted_progress("simulating") as progress:
        simulate_dataset(
            place,
            images=wanted,
            seed=seed,
            protocol=DATASET_1.name,
            progress=lambda done: progress(done, wanted),
        )
    return place


def _samples(dataset: Dataset, detector: str | None) -> WeightSamples:
    from punnet.perception.choosing import load_detector
    from punnet.weight.samples import collect_samples

    what = "looking at berries" if detector is None else f"looking at berries, masks of {detector}"
    eyes = None if detector is None else load_detector(detector)
    with progress_bar(what, len(dataset)) as advance:
        return collect_samples(dataset, detector=eyes, progress=advance)
