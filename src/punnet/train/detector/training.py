"""A training run: sources in, checkpoints and a bundle out; it can be stopped and goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import torch
from lightning.pytorch.callbacks import Callback, EarlyStopping, EMAWeightAveraging, ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.loggers import TensorBoardLogger
from torch.utils.data import DataLoader

from punnet.data.dataset import AnnotatedImage
from punnet.errors import ConfigurationError
from punnet.train.detector.config import DetectorConfig, DetectorTraining, Source, config_to_json
from punnet.train.detector.module import VALIDATED, DetectorModule
from punnet.train.detector.network import BerryDetector
from punnet.train.detector.samples import Draws, OpenSource, Samples, collate, open_sources
from punnet.train.detector.validation import score_network

__all__ = ["TrainingRun", "train_detector"]

CHECKPOINTS = "checkpoints"
LAST = "last.ckpt"
CONFIG_FILE = "config.json"


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
        Checkpoint of another run whose weights this one starts from.
    processes
        That train together (DDP, gloo).
    threads
        Of each process; None for PyTorch's choice.
    loaders
        Processes that prepare samples, for each training process.
    """

    folder: Path
    sources: tuple[Source, ...]
    validation: Source | None = None
    validation_images: int = 60
    start: Path | None = None
    processes: int = 1
    threads: int | None = None
    loaders: int = 1


class _Validation(Callback):
    """Scores the averaged weights at the end of each epoch, and says how they do."""

    def __init__(self, images: Sequence[AnnotatedImage]) -> None:
        self.images = images

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Log average precision by class, on the first process."""
        assert isinstance(module, DetectorModule)
        network = _averaged(trainer, module)
        scores: dict[str, float] = {}
        if trainer.is_global_zero:
            result = score_network(network, self.images)
            for row in result.rows[:3]:
                scores |= {f"validation/{row.name}_mask_ap{t:g}": value for t, value in row.mask_ap.items()}
                scores |= {f"validation/{row.name}_keypoint_ap{t:g}": v for t, v in row.keypoint_ap.items()}
            scores[VALIDATED] = result["mean"].mask_ap_mean
        module.train()
        module.log_dict({k: v for k, v in scores.items() if v == v}, rank_zero_only=True)
        if trainer.is_global_zero:
            with (Path(trainer.default_root_dir) / "validation.jsonl").open("a") as file:
                file.write(json.dumps({"step": trainer.global_step, **scores}) + "\n")


def _averaged(trainer: lightning.Trainer, module: DetectorModule) -> BerryDetector:
    """The exponential moving average of the network if there is one, else the network."""
    for callback in trainer.callbacks:  # type: ignore[attr-defined]
        average = getattr(callback, "_average_model", None)
        if isinstance(callback, EMAWeightAveraging) and average is not None:
            network: BerryDetector = average.module.network
            return network
    return module.network


def train_detector(config: DetectorConfig, training: DetectorTraining, run: TrainingRun) -> Path:
    """Train, or go on with, a detector; the path of its last checkpoint.

    A folder that holds checkpoints of the same configuration is gone on with: step for step what an uninterrupted run
    would have done. Another configuration in the folder is an error.

    Raises
    ------
    ConfigurationError
        If the folder holds another run, or the sources have no images.
    """
    if run.threads is not None:
        torch.set_num_threads(run.threads)
    _claim(config, training, run)
    sources = open_sources(run.sources)
    torch.manual_seed(training.seed)
    module = DetectorModule(config, training)
    last = run.folder / CHECKPOINTS / LAST
    if run.start is not None and not last.exists():
        load_weights(module, run.start)
    trainer = _trainer(training, run)
    trainer.fit(
        module,
        train_dataloaders=_loader(training, run, sources, trainer),
        ckpt_path=str(last) if last.exists() else None,
        weights_only=False,
    )
    return last


def load_weights(module: DetectorModule, checkpoint: Path) -> None:
    """Take over the weights of a checkpoint, the averaged ones if it has them.

    Raises
    ------
    ConfigurationError
        If it is not a checkpoint of the same network.
    """
    try:
        stored: dict[str, Any] = torch.load(checkpoint, map_location="cpu", weights_only=False)
        module.load_state_dict(stored["state_dict"])
    except (OSError, KeyError, RuntimeError, EOFError) as error:
        raise ConfigurationError(
            f"{checkpoint}: not a checkpoint of this detector ({str(error).splitlines()[0]})"
        ) from error


def _claim(config: DetectorConfig, training: DetectorTraining, run: TrainingRun) -> None:
    """Write the run's settings, or hold them against those that are there."""
    settings = {
        "detector": config_to_json(config),
        "training": config_to_json(training),
        "sources": [config_to_json(source) for source in run.sources],
        "start": None if run.start is None else str(run.start),
        "processes": run.processes,
    }
    path = run.folder / CONFIG_FILE
    if not path.exists():
        run.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(settings, indent=1) + "\n")
        return
    found = json.loads(path.read_text())
    if differing := sorted(k for k in settings if found.get(k) != settings[k]):
        raise ConfigurationError(
            f"{run.folder}: holds a run with another {', '.join(differing)}; give another folder, or the same settings"
        )


def _trainer(training: DetectorTraining, run: TrainingRun) -> lightning.Trainer:
    callbacks: list[Callback] = [TQDMProgressBar(refresh_rate=10)]
    if training.averaging:
        callbacks.append(EMAWeightAveraging(decay=training.averaging))
    if run.validation is not None:
        images = open_sources([run.validation])[0].images.images
        callbacks.append(_Validation(images[: run.validation_images]))
        if training.patience:
            callbacks.append(EarlyStopping(VALIDATED, mode="max", patience=training.patience))
    callbacks.append(ModelCheckpoint(run.folder / CHECKPOINTS, save_last=True, save_on_train_epoch_end=True))
    return lightning.Trainer(
        accelerator="cpu",
        devices=run.processes,
        strategy="ddp" if run.processes > 1 else "auto",
        max_steps=training.steps,
        max_epochs=-1,
        precision=training.precision,
        gradient_clip_val=5.0,
        logger=TensorBoardLogger(run.folder, name="tensorboard", version=""),
        callbacks=callbacks,
        default_root_dir=run.folder,
        log_every_n_steps=10,
        use_distributed_sampler=False,
        enable_model_summary=False,
        deterministic=False,
    )


def _loader(
    training: DetectorTraining, run: TrainingRun, sources: Sequence[OpenSource], trainer: lightning.Trainer
) -> DataLoader[Any]:
    draws = Draws(training.validate_every, training.batch, trainer.global_rank, trainer.world_size)
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
