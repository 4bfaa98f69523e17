"""A training run: labelled sets in, checkpoints out; it can be stopped and goes on where it was."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import lightning
import torch
from lightning.pytorch.callbacks import (
    Callback,
    EarlyStopping,
    ModelCheckpoint,
    ProgressBar,
)
from lightning.pytorch.loggers import TensorBoardLogger
from torch.utils.data import DataLoader

from punnet.data.dataset import AnnotatedImage
from punnet.errors import ConfigurationError
from punnet.train.detector.callbacks import SCORES_FILE, Averaging, Tell, Validation, progress
from punnet.train.detector.config import DetectorConfig, DetectorTraining, Source, config_to_json
from punnet.train.detector.module import VALIDATED, DetectorModule
from punnet.train.detector.samples import Draws, OpenSource, Samples, collate, open_sources
from punnet.train.detector.starting import describe_start, load_weights
from punnet.train.loops import fit_resumably, quiet_lightning
from punnet.train.runs import claim_run, require_run_place

__all__ = [
    "CHECKPOINTS",
    "CONFIG_FILE",
    "LAST",
    "TrainingRun",
    "last_scores",
    "train_detector",
]

CHECKPOINTS = "checkpoints"
LAST = "last.ckpt"
CONFIG_FILE = "config.json"
WHAT = "training run of a detector"


@dataclass(frozen=True)
class TrainingRun:
    """Where a run writes, and what it learns from.

    Parameters
    ----------
    folder
        Checkpoints, ``config.json`` and TensorBoard's logs.
    sources
        Labelled sets to draw from.
    validation
        A labelled set to validate on; None for none.
    validation_images
        At most so many of its images, the first.
    start
        Whose weights this run starts from: another's checkpoint, a bundle's folder, or the name of one that comes with
        the package.
    processes
        That train together (DDP, gloo).
    threads
        Of each process; None for PyTorch's choice.
    loaders
        Processes that prepare samples, for each training process.
    accelerator
        ``cpu``, or ``gpu`` for one GPU a process.
    """

    folder: Path
    sources: tuple[Source, ...]
    validation: Source | None = None
    validation_images: int = 60
    start: str | Path | None = None
    processes: int = 1
    threads: int | None = None
    loaders: int = 1
    accelerator: Literal["cpu", "gpu"] = "cpu"


def train_detector(
    config: DetectorConfig, training: DetectorTraining, run: TrainingRun, tell: Tell | None = None
) -> Path:
    """Train, or go on with, a detector; the path of its last checkpoint.

    A folder that holds checkpoints of the same configuration is gone on with: step for step what an uninterrupted run
    would have done. Another configuration in the folder is an error.

    Parameters
    ----------
    config, training
        The network, and how it is trained.
    run
        Where, from what and on how many processes.
    tell
        Is given a line of text now and then; None for silence.

    Raises
    ------
    ConfigurationError
        If the sources have no images, ``run.start`` does not fit, its last checkpoint is damaged, or there is no GPU.
    FileFormatError
        If the settings in the folder are damaged.
    OutputExistsError
        If the folder holds another run, or something else.
    OutputError
        If the folder can't be written.
    Interrupted
        At Ctrl-C, with the last checkpoint.
    """
    tell = _say_nothing if tell is None else tell
    settings = _settings(config, training, run)
    require_run_place(run.folder, CONFIG_FILE, what=WHAT)
    if run.accelerator == "gpu" and not torch.cuda.is_available():
        raise ConfigurationError("--accelerator gpu: PyTorch sees no GPU here; leave the option out")
    if run.threads is not None:
        torch.set_num_threads(run.threads)
    sources, validated = open_sources(run.sources), _validation_images(run)
    torch.manual_seed(training.seed)
    module = DetectorModule(config, training)
    last = run.folder / CHECKPOINTS / LAST
    if run.start is not None and not last.exists():
        load_weights(module, run.start)
    claim_run(run.folder, CONFIG_FILE, settings, what=WHAT)
    with quiet_lightning():
        trainer = _trainer(training, run, validated, tell)
        draws = Draws(training, trainer.global_rank, trainer.world_size)
        if last.exists():
            draws.set_epoch(_epochs_done(last, training))
        fit_resumably(trainer, module, _loader(training, run, sources, draws), None, last)
    return last


def last_scores(folder: Path) -> dict[str, float]:
    """The last validation of a run, by name; empty if there was none."""
    path = folder / SCORES_FILE
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    scores: dict[str, float] = json.loads(lines[-1]) if lines else {}
    return scores


def _say_nothing(line: str) -> None:
    """Where nobody listens."""


def _settings(config: DetectorConfig, training: DetectorTraining, run: TrainingRun) -> dict[str, Any]:
    """What makes two runs the same."""
    return {
        "detector": config_to_json(config),
        "training": config_to_json(training),
        "sources": [config_to_json(source) for source in run.sources],
        "start": describe_start(run.start),
        "processes": run.processes,
    }


def _validation_images(run: TrainingRun) -> Sequence[AnnotatedImage]:
    """The images to validate on; none if the run has no validation."""
    if run.validation is None:
        return ()
    images = open_sources([run.validation])[0].images.images[: run.validation_images]
    if not any(a.segmentation is not None and not a.crowd for image in images for a in image.annotations):
        raise ConfigurationError(
            f"{run.validation.path}: no berry with a mask among its first {len(images)} images, so nothing to "
            "validate on; give another --validation, or none"
        )
    return images


def _trainer(
    training: DetectorTraining, run: TrainingRun, validated: Sequence[AnnotatedImage], tell: Tell
) -> lightning.Trainer:
    callbacks: list[Callback] = [progress(training.steps, tell)]
    if training.averaging:
        callbacks.append(Averaging(training.averaging))
    if validated:
        callbacks.append(Validation(validated, tell))
        if training.patience:
            callbacks.append(EarlyStopping(VALIDATED, mode="max", patience=training.patience))
    callbacks.append(ModelCheckpoint(run.folder / CHECKPOINTS, save_last=True, save_on_train_epoch_end=True))
    return lightning.Trainer(
        accelerator=run.accelerator,
        devices=run.processes,
        strategy="ddp" if run.processes > 1 else "auto",
        # Not max_steps: with it Lightning takes an epoch that has ended up again, and so draws other samples.
        max_epochs=math.ceil(training.steps / training.validate_every),
        precision=training.precision,
        gradient_clip_val=5.0,
        logger=TensorBoardLogger(run.folder, name="tensorboard", version=""),
        callbacks=callbacks,
        default_root_dir=run.folder,
        log_every_n_steps=min(10, training.validate_every),
        use_distributed_sampler=False,
        enable_model_summary=False,
        enable_progress_bar=any(isinstance(callback, ProgressBar) for callback in callbacks),
        deterministic=False,
    )


def _epochs_done(last: Path, training: DetectorTraining) -> int:
    """How many epochs a checkpoint has behind it. Lightning tells the sampler, but not before samples are prepared."""
    try:
        step = int(torch.load(last, map_location="cpu", weights_only=True, mmap=True)["global_step"])
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise ConfigurationError(
            f"{last}: damaged, the run can't go on from it ({str(error).partition(chr(10))[0]}); "
            "give --start another checkpoint and --out another folder"
        ) from error
    return math.ceil(step / training.validate_every)


def _loader(
    training: DetectorTraining, run: TrainingRun, sources: Sequence[OpenSource], draws: Draws
) -> DataLoader[Any]:
    return DataLoader(
        Samples(sources, training),
        batch_size=training.batch,
        sampler=draws,
        num_workers=run.loaders,
        collate_fn=collate,
        persistent_workers=False,
        multiprocessing_context="fork" if run.loaders else None,
        prefetch_factor=4 if run.loaders else None,
    )
