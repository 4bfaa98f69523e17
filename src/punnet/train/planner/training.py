"""A training run of planners: demonstrations in, a folder with a bundle that plans out."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import punnet
from punnet.bundle import Manifest, load_bundle, write_bundle
from punnet.data.demos import DemonstrationSet
from punnet.errors import ConfigurationError
from punnet.movement import TrajectoryDistribution
from punnet.outputs import write_text
from punnet.planning.learned import PLANNER_FILE, BoxCamera, PlannerSettings
from punnet.planning.reaches import Reaches, reaches_from
from punnet.robot import JOINT_NAMES
from punnet.train.detector.bundling import Terms
from punnet.train.detector.config import config_to_json
from punnet.train.planner.deep import DeepPrediction
from punnet.train.planner.export import export_planner
from punnet.train.planner.fitting import AnyConfig, fit_planner
from punnet.train.planner.full import FullPrediction
from punnet.train.runs import as_json, claim_run, finished_run

__all__ = ["PlannerRun", "bundle_planner_run", "demonstrated_joints", "is_planner_run", "train_planners"]

RUN_FILE, RESULTS_FILE = "planner-run.json", "results.json"
BUNDLE_FOLDER, WORK_FOLDER = "bundle", "work"
SCHEMA, WHAT = "punnet-planner-run/1", "planner's run"


@dataclass(frozen=True)
class PlannerRun:
    """A finished run.

    Parameters
    ----------
    folder
        Where it is; ``bundle`` in it is what plans.
    settings
        Models with their configs, seed, data.
    results
        Of each model what its training gave.
    """

    folder: Path
    settings: Mapping[str, Any]
    results: Mapping[str, Any]

    @property
    def bundle(self) -> Path:
        """Folder of the bundle."""
        return self.folder / BUNDLE_FOLDER


def train_planners(
    configs: Sequence[AnyConfig],
    demonstrations: DemonstrationSet,
    *,
    data: Sequence[str],
    folder: Path,
    seed: int,
    progress: Callable[[str], None],
    unlabelled: NDArray[np.uint8] | None = None,
) -> PlannerRun:
    """Train one planner or more on the same demonstrations, or go on with a run that was stopped.

    Parameters
    ----------
    configs
        Of the planners; the first is the bundle's default.
    demonstrations
        With home photograph, target box, joints and poses.
    data
        What they are from, for the record.
    folder
        Of the run; made if it does not exist.
    seed
        Of everything random.
    progress
        Told how it goes.
    unlabelled
        (U, 128, 128, 3) further pictures for the autoencoders.

    Raises
    ------
    ConfigurationError
        If a planner comes twice, or there is too little to learn from.
    OutputExistsError
        If the folder holds something else, or a run with other settings.
    Interrupted
        At Ctrl-C; the same call goes on.
    """
    names = [config.name for config in configs]
    if len(set(names)) != len(names) or not names:
        raise ConfigurationError(f"planner: each planner once, got {', '.join(names) or 'none'}")
    reaches = reaches_from(demonstrations)
    settings = _settings(configs, reaches, data, seed, 0 if unlabelled is None else len(unlabelled))
    claim_run(folder, RUN_FILE, settings, what=WHAT)
    if (folder / RESULTS_FILE).is_file():
        progress(f"{folder}: trained already, with these settings")
        return load_planner_run(folder)
    work = folder / WORK_FOLDER
    fitted: dict[str, DeepPrediction | FullPrediction] = {}
    for config in configs:
        fitted[config.name] = fit_planner(
            config,
            reaches,
            seed=seed,
            folder=work / config.name,
            shared=work / "shared",
            progress=progress,
            unlabelled=unlabelled,
        )
    results = {name: _told(model) for name, model in fitted.items()}
    _write(folder / BUNDLE_FOLDER, folder.name, fitted, reaches, demonstrations, settings, results)
    write_text(folder / RESULTS_FILE, as_json(results), force=True)
    shutil.rmtree(work, ignore_errors=True)
    return load_planner_run(folder)


def load_planner_run(folder: Path) -> PlannerRun:
    """A finished run.

    Raises
    ------
    FileFormatError
        If the folder holds none, or it was stopped before its end.
    """
    settings, results = finished_run(folder, RUN_FILE, RESULTS_FILE, schema=SCHEMA, what=WHAT)
    return PlannerRun(folder, settings, results)


def is_planner_run(folder: Path) -> bool:
    """Whether the folder is that of a planner's run, finished or not."""
    return (folder / RUN_FILE).is_file()


def bundle_planner_run(
    run: Path,
    folder: Path,
    *,
    name: str,
    terms: Terms,
    results: Mapping[str, Any],
    command: str | None = None,
    force: bool = False,
) -> Manifest:
    """Write a run's bundle elsewhere, under a name and terms.

    Parameters
    ----------
    run
        Folder that :func:`train_planners` wrote.
    folder
        Where the bundle goes.
    name, terms, results
        For the manifest; the run's own results stand there as ``run``.
    command
        How it was trained; by default told from the run's settings.
    force
        Replace an existing bundle.

    Raises
    ------
    FileFormatError
        If the folder holds no finished run.
    BundleError
        If its bundle is damaged.
    """
    found = load_planner_run(run)
    made = load_bundle(found.bundle, kind="planner")
    return write_bundle(
        folder,
        name=name,
        kind="planner",
        files={file: made.path(file) for file in made.manifest.files},
        licence=terms.licence,
        restriction=terms.restriction,
        citation=terms.citation,
        command=command or made.manifest.command,
        seed=made.manifest.seed,
        data=made.manifest.data,
        results={**made.manifest.results, **results},
        force=force,
    )


def demonstrated_joints(reaches: Reaches) -> TrajectoryDistribution:
    """Distribution over the joints of all demonstrations: how targets differ, and repeats to the same."""
    weights = reaches.joint.mean
    between = np.cov(weights.reshape(len(weights), -1).T) if len(weights) > 1 else 0.0
    return TrajectoryDistribution(
        reaches.basis,
        weights.mean(axis=0),
        between + reaches.joint.covariance.mean(axis=0),
        duration=reaches.duration,
        names=JOINT_NAMES,
    )


def _write(
    folder: Path,
    name: str,
    fitted: Mapping[str, DeepPrediction | FullPrediction],
    reaches: Reaches,
    demonstrations: DemonstrationSet,
    settings: Mapping[str, Any],
    results: Mapping[str, Any],
) -> None:
    described = PlannerSettings(
        {model: (prediction.space, f"{model}.onnx") for model, prediction in fitted.items()},
        reaches.basis,
        reaches.duration,
        demonstrated_joints(reaches),
        _camera(demonstrations),
    )
    with tempfile.TemporaryDirectory() as place:
        files: dict[str, Any] = {PLANNER_FILE: described.to_json()}
        for model, prediction in fitted.items():
            files[f"{model}.onnx"] = Path(place) / f"{model}.onnx"
            export_planner(prediction, files[f"{model}.onnx"])
        write_bundle(
            folder,
            name=name,
            kind="planner",
            files=files,
            licence="not stated",
            command=_command(settings),
            seed=settings["seed"],
            data={key: settings[key] for key in ("data", "targets", "photographs", "groups")},
            results={"run": dict(results)},
            force=True,
        )


def _camera(demonstrations: DemonstrationSet) -> BoxCamera | None:
    """The camera of all photographs, if they tell and it is one."""
    homes = [episode.home for episode in demonstrations if episode.home is not None]
    first = homes[0]
    if first.camera is None or first.T_base_camera is None:
        return None
    same = all(
        home.camera == first.camera
        and home.T_base_camera is not None
        and np.allclose(home.T_base_camera, first.T_base_camera, atol=1e-4)
        for home in homes
    )
    return BoxCamera(first.camera, np.asarray(first.T_base_camera)) if same else None


def _settings(
    configs: Sequence[AnyConfig], reaches: Reaches, data: Sequence[str], seed: int, unlabelled: int
) -> dict[str, Any]:
    return {
        "schema": SCHEMA,
        "punnet": punnet.__version__,
        "models": {config.name: {"kind": config.kind, **config_to_json(config)} for config in configs},
        "seed": seed,
        "data": list(data),
        "targets": len(reaches.target_ids),
        "photographs": len(reaches),
        "groups": len(set(reaches.groups)),
        "unlabelled": unlabelled,
    }


def _command(settings: Mapping[str, Any]) -> str:
    kinds = " ".join(f"--kind {model['kind']}" for model in settings["models"].values())
    space = next(iter(settings["models"].values()))["space"]
    data = " ".join(f"--data {name}" for name in settings["data"])
    return f"punnet train planner {kinds} --space {space} {data} --seed {settings['seed']}"


def _told(prediction: DeepPrediction | FullPrediction) -> dict[str, Any]:
    """What a training says of itself: loss at the end of each stage, or how far off ends of groups left out are."""
    if isinstance(prediction, FullPrediction):
        return {"left_out": prediction.left_out}
    return {"loss": {stage: float(f"{curve[-1]:.4g}") for stage, curve in prediction.curves.items() if curve}}
