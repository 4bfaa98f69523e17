"""A training run of a weight model: labelled sets in, a folder with the model and what it is worth out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import punnet
from punnet.data.dataset import Dataset
from punnet.errors import ConfigurationError
from punnet.outputs import write_text
from punnet.perception.detector import Detector
from punnet.train.detector.config import config_from_json, config_to_json
from punnet.train.runs import as_json, claim_run, finished_run
from punnet.train.weight.registry import FittedWeightModel, ModelSpec, Tell, model_spec
from punnet.weight.evaluation import evaluate_weights, weigh_samples
from punnet.weight.sample_split import TEST_SHARE, VALIDATION_SHARE, WeightSplit, split_groups
from punnet.weight.samples import WeightSamples, collect_samples, join_samples

__all__ = [
    "RUN_FILE",
    "TRUTH",
    "WHAT",
    "WeightRun",
    "collect_all",
    "is_weight_run",
    "load_run",
    "read_config",
    "train_weight_model",
]

RUN_FILE = "run.json"
RESULTS_FILE = "results.json"
MODEL_FOLDER, WORK_FOLDER = "model", "work"
TRUTH = "truth"
SCHEMA, WHAT = "punnet-weight-run/1", "weight run"


@dataclass(frozen=True)
class WeightRun:
    """A finished run.

    Parameters
    ----------
    folder
        Where it is.
    spec
        The model's entry in the registry.
    settings
        ``run.json``: model, config, seed, data, split.
    results
        ``results.json``: measures on validation and test.
    """

    folder: Path
    spec: ModelSpec
    settings: Mapping[str, Any]
    results: Mapping[str, Any]

    def model(self) -> FittedWeightModel:
        """The trained model."""
        return self.spec.load(self.folder / MODEL_FOLDER)


def collect_all(
    datasets: Sequence[Dataset],
    progress: Callable[[int, int], None] | None = None,
    detector: Detector | None = None,
) -> WeightSamples:
    """Samples of several sets through a detector's masks, the true ones if None.

    ``progress`` is told images done and in all.
    """
    total, done = sum(len(dataset) for dataset in datasets), 0

    def advance() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    return join_samples(
        [collect_samples(dataset, detector=detector, progress=advance) for dataset in datasets]
    )


def read_config(spec: ModelSpec, changes: Mapping[str, Any]) -> Any:
    """The model's settings with some changed.

    Raises
    ------
    ConfigurationError
        If there is no such setting, or it can't have that value.
    """
    return config_from_json(spec.config, changes)


def train_weight_model(
    spec: ModelSpec,
    config: Any,
    samples: WeightSamples,
    *,
    data: Sequence[str],
    folder: Path,
    seed: int,
    progress: Tell,
    extra: WeightSamples | None = None,
    extra_data: Sequence[str] = (),
    detected: Mapping[str, WeightSamples] | None = None,
) -> WeightRun:
    """Train, or go on with a run that was stopped; a finished run of the same settings is given as it is.

    Parameters
    ----------
    spec, config
        The model and its settings.
    samples
        All of the data: what is set aside for test and validation is parted here.
    data
        Names of the sets that ``samples`` are from, for the record.
    folder
        Of the run; made if it does not exist.
    seed
        Of everything random.
    progress
        Told how it goes.
    extra, extra_data
        Other plants, all learnt from, and names of their sets.
    detected
        The berries of ``samples`` and ``extra`` once more, as detectors see them, by the detector's name: learnt from and
        validated on besides, each plant in the part where it is anyway.

    Raises
    ------
    ConfigurationError
        If a plant of ``extra`` is in ``samples`` too.
    OutputExistsError
        If the folder holds something else, or a run with other settings.
    """
    tested = {TRUTH: split_groups(samples)}
    tested |= {name: _parted(seen, samples) for name, seen in (detected or {}).items()}
    parts = _learnt_from(tested, samples, extra)
    settings = _settings(spec, config, parts, seed) | {"data": list(data), "extra": list(extra_data)}
    if detected:
        settings["masks"] = list(tested)
    claim_run(folder, RUN_FILE, settings, what=WHAT)
    if (folder / RESULTS_FILE).is_file():
        progress(f"{folder}: {spec.name} is trained already, with these settings")
        return load_run(folder)
    for name in (WORK_FOLDER, MODEL_FOLDER):
        (folder / name).mkdir(exist_ok=True)
    model = spec.fit(
        parts.train, parts.validation, config, seed=seed, progress=progress, folder=folder / WORK_FOLDER
    )
    model.save(folder / MODEL_FOLDER)
    results = {
        name if masks == TRUTH else f"{name}, masks of {masks}": evaluate_weights(
            part,
            weigh_samples(model, part),
            estimator=spec.name,
            data=f"{' + '.join(data)}, {name}",
            masks=masks,
        ).to_json()
        for masks, seen in tested.items()
        for name, part in (("validation", seen.validation), ("test", seen.test))
        if name == "test" or not spec.learns_both
    }
    write_text(folder / RESULTS_FILE, as_json(results), force=True)
    if not any((folder / WORK_FOLDER).iterdir()):
        (folder / WORK_FOLDER).rmdir()
    return load_run(folder)


def load_run(folder: Path) -> WeightRun:
    """A finished run.

    Raises
    ------
    FileFormatError
        If the folder holds none, or it was stopped before its end.
    """
    settings, results = finished_run(folder, RUN_FILE, RESULTS_FILE, schema=SCHEMA, what=WHAT)
    return WeightRun(folder, model_spec(settings["model"]), settings, results)


def is_weight_run(folder: Path) -> bool:
    """Whether the folder is that of a weight model's run, finished or not."""
    return (folder / RUN_FILE).is_file()


def _parted(seen: WeightSamples, samples: WeightSamples) -> WeightSplit:
    """What a detector saw of the plants of ``samples``, parted like them; the other plants are learnt from."""
    known = set(samples.groups)
    own = [index for index, group in enumerate(seen.groups) if group in known]
    missed = tuple(berry for berry in seen.missed if berry.group in known)
    parts = split_groups(replace(seen.subset(own), missed=missed))
    other = seen.subset(index for index, group in enumerate(seen.groups) if group not in known)
    return replace(parts, train=join_samples([parts.train, other]))


def _learnt_from(
    tested: Mapping[str, WeightSplit], samples: WeightSamples, extra: WeightSamples | None
) -> WeightSplit:
    """Through all masks together what is learnt from and validated on, with ``extra``; through the true ones the test."""
    train = [seen.train for seen in tested.values()]
    if extra is not None:
        if both := sorted(set(samples.groups) & set(extra.groups)):
            raise ConfigurationError(f"the plant {both[0]} is in the data and in what is learnt from besides")
        train.append(extra)
    validation = join_samples([seen.validation for seen in tested.values()])
    return WeightSplit(join_samples(train), validation, tested[TRUTH].test)


def _settings(spec: ModelSpec, config: Any, parts: WeightSplit, seed: int) -> dict[str, Any]:
    named = (("train", parts.train), ("validation", parts.validation), ("test", parts.test))
    return {
        "schema": SCHEMA,
        "punnet": punnet.__version__,
        "model": spec.name,
        "config": config_to_json(config),
        "seed": seed,
        "split": {"test": TEST_SHARE, "validation": VALIDATION_SHARE},
        "berries": {name: len(part) for name, part in named},
        "plants": {name: len(set(part.groups)) for name, part in named},
        "refused": {name: len(part.missed) for name, part in named},
    }
