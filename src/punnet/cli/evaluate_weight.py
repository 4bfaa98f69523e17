"""``punnet evaluate weight``: every measure of a weight estimator on berries of known weight."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import note, print_json, print_table, progress_bar, say
from punnet.cli.options import Json
from punnet.errors import ConfigurationError, FileFormatError

if TYPE_CHECKING:
    from punnet.data import Dataset
    from punnet.weight.evaluation import WeightEvaluation

__all__ = ["register_weight"]

TRUTH = "truth"


def register_weight(group: typer.Typer) -> None:
    """Add the command to the group ``evaluate``."""
    group.command(
        "weight",
        epilog="Example: punnet evaluate weight --bundle weight-shape --data dataset-1 --masks truth --masks sim-fast",
    )(weight)


def weight(
    data: Annotated[
        Path,
        typer.Option(
            "--data", help="Images with depth, camera, masks and weights of berries.", show_default=False
        ),
    ],
    bundle: Annotated[
        str | None,
        typer.Option(
            "--bundle",
            "--estimator",
            help="A model's name (see punnet models) or folder, or: ellipsoid. What weighs by default without it.",
            show_default=False,
        ),
    ] = None,
    run: Annotated[
        Path | None, typer.Option("--run", help="Folder of punnet train weight, in place of a bundle.")
    ] = None,
    part: Annotated[
        str,
        typer.Option(
            "--part",
            help="Plants of the set: test, which no training learns from; validation, train; all, for data that no "
            "model was trained on.",
        ),
    ] = "test",
    masks: Annotated[
        list[str] | None,
        typer.Option(
            "--masks",
            help="Whose masks are weighed: truth, or a detector's name. May be given more than once.",
            show_default="truth",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Percentage of correct weights, errors and intervals: over all, by what hides a berry, by distance.

    Berries that can't be weighed, or that the detector misses, count as wrong.
    """
    if bundle is not None and run is not None:
        raise ConfigurationError("--bundle and --run name two estimators; give one of them")
    from punnet.data.formats import read_dataset

    name, weigher = _weigher(bundle, run)
    dataset = read_dataset(data)
    evaluations, skipped = [], 0
    for whose in masks or [TRUTH]:
        evaluation, left_out = _evaluate(weigher, name, dataset, part, whose)
        evaluations.append(evaluation)
        skipped = max(skipped, left_out)
    if as_json:
        print_json({"evaluations": [evaluation.to_json() for evaluation in evaluations]})
    else:
        for evaluation in evaluations:
            _print(evaluation)
    if skipped:
        note(f"{skipped} images left out")
        raise typer.Exit(1)


def _weigher(bundle: str | None, run: Path | None) -> tuple[str, Any]:
    if run is not None:
        from punnet.cli.train_weight import need_training

        need_training()
        from punnet.train.weight.training import load_run

        trained = load_run(run)
        return trained.spec.name, trained.model()
    from punnet.weight.choosing import load_weight_estimator

    estimator = load_weight_estimator(bundle)
    return estimator.name, estimator


def _evaluate(
    weigher: Any, name: str, dataset: Dataset, part: str, masks: str
) -> tuple[WeightEvaluation, int]:
    from punnet.perception.choosing import load_detector
    from punnet.weight.evaluation import evaluate_weights, weigh_samples
    from punnet.weight.sample_split import images_of_part
    from punnet.weight.samples import collect_samples

    detector = None if masks == TRUTH else load_detector(masks)
    images = images_of_part(dataset, part)
    with progress_bar(f"looking at berries, masks of {masks}", len(images)) as advance:
        samples = collect_samples(images, detector=detector, progress=advance)
    for line in samples.skipped:
        note(f"left out: {line}")
    if not len(samples):
        raise FileFormatError(
            f"{dataset.name}: no berry of known weight that can be seen in its part '{part}'; see --part"
        )
    told = dataset.name if part == "all" else f"{dataset.name}, {part}"
    evaluation = evaluate_weights(
        samples, weigh_samples(weigher, samples), estimator=name, data=told, masks=masks
    )
    return evaluation, len(samples.skipped)


def _print(evaluation: WeightEvaluation) -> None:
    from punnet.weight.evaluation import DISTANCES, OCCLUDED_FROM
    from punnet.weight.metrics import PCW_TOLERANCES

    names = {
        "all": "all",
        "free": f"less than {100 * OCCLUDED_FROM:.0f}% hidden",
        "occluded": f"{100 * OCCLUDED_FROM:.0f}% hidden and more",
        **{name: f"{name} ({_between(*limits)})" for name, limits in DISTANCES.items()},
    }
    columns = (
        "berries",
        "n>",
        *(f"@{tolerance:.2f}>" for tolerance in PCW_TOLERANCES),
        "MAPE>",
        "RMSE, g>",
        "bias, g>",
        "in interval>",
    )
    print_table(
        f"{evaluation.estimator} on {evaluation.data}, masks: {evaluation.masks}",
        columns,
        [
            (
                names[part.name],
                str(part.errors.count + part.errors.missing),
                *(f"{part.pcw[tolerance]:.1f}" for tolerance in PCW_TOLERANCES),
                f"{part.errors.mean_percentage:.1f}%",
                f"{part.errors.root_mean_square:.2f}",
                f"{part.errors.bias:+.2f}",
                "" if part.coverage is None else f"{part.coverage.inside:.1f}%",
            )
            for part in evaluation.parts
        ],
    )
    if evaluation.nominal is not None:
        say(
            f"{100 * evaluation.nominal:.0f}% intervals hold the true weight, by weight: "
            + ", ".join(f"{band} {c.inside:.0f}%" for band, c in evaluation.coverage_by_weight.items())
        )
    if evaluation.whole.errors.missing:
        weighed = evaluation.whole.pcw_weighed
        say(
            f"of the {evaluation.whole.errors.count} with an estimate: "
            + ", ".join(
                f"{weighed[tolerance]:.1f}% within {100 * tolerance:.0f}%" for tolerance in PCW_TOLERANCES
            )
        )
    for reason, count in evaluation.refused.items():
        say(f"without an estimate, counted as wrong: {count} berries: {reason}")


def _between(near: float, far: float) -> str:
    if near == 0.0:
        return f"under {far:g} m"
    return f"{near:g} m and more" if far > 100 else f"{near:g} to {far:g} m"
