"""Training of the deep weight estimators: from berries to a fitted model; it can be stopped and goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import EarlyStopping, ModelCheckpoint
from torch.utils.data import DataLoader

from punnet.errors import ConfigurationError
from punnet.outputs import write_text
from punnet.train.detector.config import config_to_json
from punnet.train.loops import BatchDraws, fit_resumably, quiet_lightning
from punnet.train.weight.deep_inputs import BerryInputs
from punnet.train.weight.deep_layers import WeightNetwork
from punnet.train.weight.deep_model import DeepWeightModel, load_deep_model
from punnet.train.weight.deep_module import (
    VALIDATED,
    Curve,
    DeepModule,
    DrawnBatches,
    StillBatches,
)
from punnet.train.weight.registry import ModelSpec, Tell
from punnet.weight.samples import WeightSamples

__all__ = ["DeepRecipe", "deep_spec", "fit_deep_model"]

LAST = "last.ckpt"
BEST = "best.ckpt"
SETTINGS_FILE = "training.json"
CURVE_FILE = "curve.json"
"""Written when training has ended: the validation of each epoch."""


@dataclass(frozen=True)
class DeepRecipe:
    """What one deep model is made of.

    Parameters
    ----------
    name
        In the registry.
    config
        Its settings, a :class:`~punnet.train.weight.deep_config.DeepConfig`.
    network
        Builds the untrained network from the settings.
    inputs
        Makes the inputs of observations, by the settings.
    bare
        Builds a network whose weights will be replaced; None for ``network``.
    """

    name: str
    config: type[Any]
    network: Callable[[Any], WeightNetwork]
    inputs: Callable[[Any, Any], BerryInputs]
    bare: Callable[[Any], WeightNetwork] | None = None


def deep_spec(
    recipe: DeepRecipe, *, title: str, quick: dict[str, Any], thesis: dict[float, float]
) -> ModelSpec:
    """The registry's entry of a deep model."""

    def fit(
        train: WeightSamples,
        validation: WeightSamples,
        config: Any,
        *,
        seed: int,
        progress: Tell,
        folder: Path,
    ) -> DeepWeightModel:
        return fit_deep_model(recipe, train, validation, config, seed=seed, progress=progress, folder=folder)

    def load(folder: Path) -> DeepWeightModel:
        return load_deep_model(
            folder, recipe.name, recipe.config, recipe.bare or recipe.network, recipe.inputs
        )

    return ModelSpec(recipe.name, title, recipe.config, fit, load, quick=quick, thesis=thesis)


def fit_deep_model(
    recipe: DeepRecipe,
    train: WeightSamples,
    validation: WeightSamples,
    config: Any,
    *,
    seed: int,
    progress: Tell,
    folder: Path,
) -> DeepWeightModel:
    """Train a deep model until its validation is flat; the weights of the epoch with the lowest validation loss.

    Parameters
    ----------
    recipe
        Of the model.
    train, validation
        Berries to learn from, and to tell when to stop.
    config
        Settings, of ``recipe.config``.
    seed
        Of everything drawn: the same seed on the same machine gives the same model, stopped in between or not.
    progress
        Is told a line an epoch.
    folder
        For checkpoints; those of an earlier run with the same settings and berries are gone on with.

    Raises
    ------
    ConfigurationError
        If there are too few berries, or the folder holds another run.
    Interrupted
        At Ctrl-C, with the last checkpoint.
    """
    if len(train) < 2 or not len(validation):
        raise ConfigurationError(
            f"{recipe.name}: needs at least 2 berries to train on and 1 to validate, got {len(train)} and "
            f"{len(validation)}"
        )
    _claim(folder, recipe.name, config, seed, train, validation)
    torch.manual_seed(seed)
    unfinished = not (folder / CURVE_FILE).exists()
    started = not unfinished or (folder / LAST).exists()
    network = (recipe.bare or recipe.network)(config) if started else recipe.network(config)
    network.grams_mean.fill_(float(np.mean(train.grams)))
    network.grams_spread.fill_(max(float(np.std(train.grams)), 1e-3))
    if unfinished:
        curve = _train(recipe, network, train, validation, config, seed, progress, folder)
        write_text(folder / CURVE_FILE, json.dumps(curve.epochs, indent=1) + "\n")
    _take_best(network, folder / BEST)
    curve_epochs: list[dict[str, float]] = json.loads((folder / CURVE_FILE).read_text(encoding="utf-8"))
    return DeepWeightModel(recipe.name, config, network, recipe.inputs, tuple(curve_epochs))


def _train(
    recipe: DeepRecipe,
    network: WeightNetwork,
    train: WeightSamples,
    validation: WeightSamples,
    config: Any,
    seed: int,
    progress: Tell,
    folder: Path,
) -> Curve:
    """Run the trainer, from the last checkpoint if there is one."""
    draws = BatchDraws(len(train), config.batch, seed)
    drawn = DrawnBatches(recipe.inputs(train.observations, config), train.grams)
    still = StillBatches(recipe.inputs(validation.observations, config), validation.grams)
    module = DeepModule(network, config, seed=seed, steps=config.epochs * len(draws))
    curve = Curve(recipe.name, progress)
    last = folder / LAST
    with quiet_lightning():
        fit_resumably(
            _trainer(config, folder, curve),
            module,
            DataLoader(drawn, sampler=draws, batch_size=None),
            DataLoader(still, batch_size=None),
            last,
        )
    return curve


def _trainer(config: Any, folder: Path, curve: Curve) -> lightning.Trainer:
    callbacks: list[Any] = [curve]
    if config.patience:
        callbacks.append(EarlyStopping(VALIDATED, patience=config.patience, check_on_train_epoch_end=True))
    # At the end of the training epoch: within it, the resumed run would end that epoch a second time. The last one
    # is kept by itself: Lightning's own "save last" keeps it only when it is the best too.
    always: dict[str, Any] = {"save_on_train_epoch_end": True, "enable_version_counter": False}
    callbacks.append(ModelCheckpoint(folder, BEST.removesuffix(".ckpt"), monitor=VALIDATED, **always))
    callbacks.append(ModelCheckpoint(folder, LAST.removesuffix(".ckpt"), **always))
    return lightning.Trainer(
        accelerator="auto",
        devices=1,
        max_epochs=config.epochs,
        gradient_clip_val=5.0,
        logger=False,
        callbacks=callbacks,
        default_root_dir=folder,
        num_sanity_val_steps=0,
        enable_model_summary=False,
        enable_progress_bar=False,
        use_distributed_sampler=False,
    )


def _claim(
    folder: Path, name: str, config: Any, seed: int, train: WeightSamples, validation: WeightSamples
) -> None:
    """Write what the folder's run is made of, or hold it against what is written there."""
    settings = {
        "model": name,
        "config": config_to_json(config),
        "seed": seed,
        "train": _fingerprint(train),
        "validation": _fingerprint(validation),
    }
    path = folder / SETTINGS_FILE
    if not path.exists():
        write_text(path, json.dumps(settings, indent=1) + "\n")
        return
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        differing = sorted(key for key in settings if found.get(key) != settings[key])
    except (OSError, ValueError, AttributeError) as error:
        raise ConfigurationError(
            f"{path}: not the settings of a training ({error}); give another folder"
        ) from error
    if differing:
        raise ConfigurationError(
            f"{folder}: holds a training with another {', '.join(differing)}; give another folder, or the same settings"
        )


def _fingerprint(samples: WeightSamples) -> str:
    """Tells one set of berries from another."""
    digest = hashlib.sha256(np.ascontiguousarray(samples.grams).tobytes())
    for observation in samples.observations:
        digest.update(np.ascontiguousarray(observation.cloud).tobytes())
    return f"{len(samples)} berries {digest.hexdigest()[:16]}"


def _take_best(network: WeightNetwork, checkpoint: Path) -> None:
    """Load the best epoch's weights.

    Raises
    ------
    ConfigurationError
        If the checkpoint is damaged.
    """
    try:
        stored: dict[str, Any] = torch.load(checkpoint, map_location="cpu", weights_only=True)["state_dict"]
        network.load_state_dict({name.removeprefix("network."): value for name, value in stored.items()})
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise ConfigurationError(
            f"{checkpoint}: not a checkpoint of this model ({str(error).splitlines()[0]}); train in another folder"
        ) from error
