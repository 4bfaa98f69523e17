"""Figure 4.12 of the thesis: every weight model trained and measured alike, the thesis' figures beside ours."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib

from punnet.data.thesis_tables import BETWEEN_NUMBERS, NOTHING, MarkdownTable
from punnet.errors import OutputExistsError, PunnetError
from punnet.outputs import MARKER_FILE, write_text
from punnet.train.weight.registry import MODELS, Tell, model_spec
from punnet.train.weight.training import read_config, train_weight_model
from punnet.weight.evaluation import WeightEvaluation, evaluate_weights, weigh_samples
from punnet.weight.metrics import PCW_TOLERANCES
from punnet.weight.sample_split import part_of
from punnet.weight.samples import WeightSamples

__all__ = ["Figure412", "FigureRow", "claim_folder", "reproduce_figure_4_12", "table_4_12", "write_figure"]

JSON_FILE, TABLE_FILE, CHART_FILE = "fig-4-12.json", "fig-4-12.md", "fig-4-12.png"
MODELS_FOLDER = "models"
TRUTH = "truth"


@dataclass(frozen=True)
class FigureRow:
    """One model of the figure.

    Parameters
    ----------
    name, title
        In the registry, or of a bundle; and as the figure prints it.
    evaluations
        By whose masks were weighed: ``truth``, or a detector's name.
    learnt
        Berries that it learnt from, views counted; None for a bundle.
    thesis
        Percentage of correct weights by tolerance, as far as the thesis gives it.
    seconds
        What training took in this run; NaN for what was trained before.
    """

    name: str
    title: str
    evaluations: Mapping[str, WeightEvaluation]
    learnt: int | None
    thesis: Mapping[float, float]
    seconds: float


@dataclass(frozen=True)
class Figure412:
    """The whole figure.

    Parameters
    ----------
    rows
        Models in the order of the thesis, ours last.
    failed
        Why models are missing, by name.
    settings
        What it was made with.
    """

    rows: tuple[FigureRow, ...]
    failed: Mapping[str, str]
    settings: Mapping[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "settings": dict(self.settings),
            "failed": dict(self.failed),
            "rows": [
                {
                    "name": row.name,
                    "title": row.title,
                    "learnt_berries": row.learnt,
                    "seconds": None if math.isnan(row.seconds) else round(row.seconds, 1),
                    "thesis": {f"{tolerance:.2f}": value for tolerance, value in row.thesis.items()},
                    "evaluations": {masks: found.to_json() for masks, found in row.evaluations.items()},
                }
                for row in self.rows
            ],
        }


@dataclass(frozen=True)
class _Lesson:
    """What all models learn from, and how; fields as in :func:`reproduce_figure_4_12`."""

    samples: WeightSamples
    data: str
    folder: Path
    seed: int
    quick: tuple[str, ...]
    extra: WeightSamples | None
    extra_data: tuple[str, ...]


@dataclass(frozen=True)
class _Measured:
    """Evaluates an estimator on the test berries through each masks."""

    tests: Mapping[str, WeightSamples]
    data: str

    def __call__(self, name: str, weigher: Any) -> dict[str, WeightEvaluation]:
        return {
            masks: evaluate_weights(
                test, weigh_samples(weigher, test), estimator=name, data=self.data, masks=masks
            )
            for masks, test in self.tests.items()
        }


def claim_folder(folder: Path) -> None:
    """Make the figure's folder, or find that it is one.

    Raises
    ------
    OutputExistsError
        If it holds something else.
    """
    marker = folder / MARKER_FILE
    if folder.exists() and not marker.is_file() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputExistsError(f"{folder}: exists and holds no figure 4.12; give another folder")
    if not marker.is_file():
        write_text(marker, json.dumps({"made_by": "punnet", "figure": "4.12"}) + "\n")


def reproduce_figure_4_12(
    samples: Mapping[str, WeightSamples],
    *,
    data: str,
    folder: Path,
    seed: int,
    quick: Sequence[str] = (),
    models: Sequence[str] = tuple(MODELS),
    bundles: Mapping[str, Any] | None = None,
    extra: WeightSamples | None = None,
    extra_data: Sequence[str] = (),
    workers: int = 1,
    progress: Tell,
    clock: Callable[[], float],
) -> Figure412:
    """Train what is not trained yet, and measure everything on the plants that were set aside.

    Parameters
    ----------
    samples
        The data set by whose masks it is seen: ``truth`` (what is learnt from), and detectors' names.
    data
        Its name.
    folder
        Runs go to ``models/`` in it; finished ones with the same settings are not trained again.
    seed
        Of everything random.
    quick
        Models that are trained with their short settings.
    models
        Names of the registry.
    bundles
        Estimators to show besides, by title.
    extra, extra_data
        Other plants, and names of their sets: learnt from besides by models that learn fast.
    workers
        Models trained at a time, with one thread each; one alone has all threads.
    progress
        Told how it goes; with several workers it has to be a function of a module.
    clock
        Seconds, for how long training takes.
    """
    tests = {masks: part_of(seen, "test") for masks, seen in samples.items()}
    measured = _Measured(tests, f"{data}, test")
    lesson = _Lesson(samples[TRUTH], data, folder, seed, tuple(quick), extra, tuple(extra_data))
    with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        made = joblib.Parallel(batch_size=1)(
            joblib.delayed(_trained_row)(name, lesson, measured, progress, clock) for name in models
        )
    rows = [row for row in made if isinstance(row, FigureRow)]
    failed = {name: why for name, why in zip(models, made, strict=True) if isinstance(why, str)}
    for title, estimator in (bundles or {}).items():
        rows.append(FigureRow(estimator.name, title, measured(estimator.name, estimator), None, {}, math.nan))
    settings = {
        "data": data,
        "extra": list(extra_data),
        "seed": seed,
        "models": list(models),
        "quick": list(quick),
    }
    return Figure412(tuple(rows), failed, settings)


def _trained_row(
    name: str, lesson: _Lesson, measured: _Measured, progress: Tell, clock: Callable[[], float]
) -> FigureRow | str:
    """A model's row, trained if it is not yet; or why there is none."""
    try:
        spec = model_spec(name)
        short = bool(spec.quick) and name in lesson.quick
        begun = clock()
        run = train_weight_model(
            spec,
            read_config(spec, spec.quick if short else {}),
            lesson.samples,
            data=[lesson.data],
            folder=lesson.folder / MODELS_FOLDER / name,
            seed=lesson.seed,
            progress=progress,
            extra=lesson.extra if spec.learns_fast else None,
            extra_data=lesson.extra_data if spec.learns_fast else (),
        )
        seconds = clock() - begun
    except PunnetError as error:
        progress(f"{name} left out: {error}")
        return str(error)
    learnt = run.settings["berries"]["train"] + run.settings["berries"]["validation"]
    title = f"{spec.title}, short training" if short else spec.title
    return FigureRow(name, title, measured(name, run.model()), learnt, spec.thesis, seconds)


def table_4_12(figure: Figure412) -> MarkdownTable:
    """Percentage of correct weights by tolerance, ours / the thesis', and the error, of all masks."""
    masks = list(figure.rows[0].evaluations) if figure.rows else []
    columns = (
        "model",
        "berries learnt from",
        *(f"PCW@{tolerance:.2f}" for tolerance in PCW_TOLERANCES),
        "MAPE",
    )
    columns += tuple(f"PCW@0.20, masks of {name}" for name in masks if name != TRUTH)
    rows = []
    for row in figure.rows:
        truth = row.evaluations[TRUTH].whole
        cells = [_beside(truth.pcw[tolerance], row.thesis.get(tolerance)) for tolerance in PCW_TOLERANCES]
        cells.append(f"{truth.errors.mean_percentage:.1f}%")
        cells += [f"{row.evaluations[name].whole.pcw[0.20]:.1f}" for name in masks if name != TRUTH]
        rows.append((row.title, NOTHING if row.learnt is None else str(row.learnt), *cells))
    return MarkdownTable("4.12", columns, tuple(rows))


def write_figure(figure: Figure412, folder: Path) -> None:
    """Write the table, the chart and every number."""
    from punnet.train.weight.chart_4_12 import draw_chart

    write_text(folder / TABLE_FILE, table_4_12(figure).markdown() + "\n", force=True)
    write_text(folder / JSON_FILE, json.dumps(figure.to_json(), indent=1, allow_nan=False) + "\n", force=True)
    draw_chart(figure, folder / CHART_FILE)


def _beside(ours: float, thesis: float | None) -> str:
    return f"{ours:.1f}{BETWEEN_NUMBERS}{NOTHING if thesis is None else f'{thesis:.1f}'}"
