"""Training of a deep-ProMP from reaches: the stages one after another, and its predictions."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from punnet.errors import ConfigurationError
from punnet.movement.distribution import Space
from punnet.planning.reaches import Movements, Reaches
from punnet.train.planner.config import PlannerConfig
from punnet.train.planner.network import DeepProMP, as_input
from punnet.train.planner.stages import (
    MovementStage,
    ReconstructionStage,
    Tell,
    TuningStage,
    run_stage,
)

__all__ = ["DeepPrediction", "fit_deep_promp"]

SAMPLES = 150
"""Instants T that losses are taken over."""
BATCH = 64
RECONSTRUCTION, MOVEMENTS, TUNING = "reconstruction", "movements", "tuning"


@dataclass(eq=False)
class DeepPrediction:
    """A trained deep-ProMP.

    Parameters
    ----------
    network
        In evaluation mode.
    curves
        Loss of each epoch, by stage.
    """

    network: DeepProMP
    curves: dict[str, list[float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """As :attr:`PlannerConfig.name`."""
        return self.network.config.name

    @property
    def space(self) -> Space:
        """Joint or task."""
        return self.network.config.space

    @torch.no_grad()
    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph."""
        means, covariances = [], []
        pictures, centres = torch.from_numpy(reaches.pictures), _floats(reaches.centres)
        for start in range(0, len(reaches), BATCH):
            rows = slice(start, start + BATCH)
            mean, factor = self.network(pictures[rows], centres[rows])
            means.append(mean.double().numpy())
            covariances.append((factor @ factor.transpose(-1, -2)).double().numpy())
        return block_diagonal(np.concatenate(means), np.concatenate(covariances))

    @torch.no_grad()
    def latents(self, reaches: Reaches) -> NDArray[np.float64]:
        """(P, 256) what the encoder makes of the photographs."""
        return np.asarray(_encodings(self.network, reaches).double().numpy())


def fit_deep_promp(
    config: PlannerConfig,
    reaches: Reaches,
    *,
    seed: int,
    folder: Path,
    progress: Tell,
    shared: Path | None = None,
    unlabelled: NDArray[np.uint8] | None = None,
) -> DeepPrediction:
    """Train one of the thesis' networks; a stopped training goes on.

    Parameters
    ----------
    config
        Which one, and how.
    reaches
        To learn from.
    seed
        Of everything drawn.
    folder
        For checkpoints, one folder a stage.
    progress
        Told how it goes.
    shared
        Folder where tr-1 of this kind of encoder, on these pictures and with this seed, may already be; ``folder`` if
        not given.
    unlabelled
        (U, 128, 128, 3) pictures without a reach that join tr-1.

    Raises
    ------
    ConfigurationError
        If there are fewer than two photographs, or a folder holds another network.
    Interrupted
        At Ctrl-C.
    """
    if len(reaches) < 2:
        raise ConfigurationError(f"{reaches.name}: at least two photographs are needed to train a planner")
    torch.manual_seed(seed)
    network = DeepProMP(config, reaches.basis.count)
    movements = reaches.movements(config.space)
    network.heads.start_at(movements.mean.mean(axis=0), movements.blocks.mean(axis=0))
    pictures, centres = torch.from_numpy(reaches.pictures), _floats(reaches.centres)
    labels = (_floats(movements.mean[reaches.targets]), _floats(movements.blocks[reaches.targets]))
    phi = reaches.basis.phi(np.linspace(0.0, 1.0, SAMPLES))
    title = f"{config.kind} in {config.space} space"
    curves: dict[str, list[float]] = {}
    if config.kind == "direct":
        curves[MOVEMENTS] = run_stage(
            MovementStage(network, seed, phi),
            (pictures, centres, *labels),
            name=f"{title}, all at once",
            epochs=config.reconstruction_epochs + config.tuning_epochs,
            batch=config.batch,
            folder=folder / MOVEMENTS,
            progress=progress,
        )
        return DeepPrediction(network.eval(), curves)
    seen = pictures if unlabelled is None else torch.cat((pictures, torch.from_numpy(unlabelled)))
    curves[RECONSTRUCTION] = _reconstruct(network, seen, seed, shared or folder, title, progress)
    curves[MOVEMENTS] = run_stage(
        MovementStage(network, seed, phi),
        (_shown(network, reaches), centres, *labels),
        name=f"{title}, movements",
        epochs=config.epochs,
        batch=config.mlp_batch,
        folder=folder / MOVEMENTS,
        progress=progress,
    )
    if config.tuned and config.tuning_epochs:
        curves[TUNING] = run_stage(
            TuningStage(network, seed, phi[-1]),
            (pictures, centres, *labels),
            name=f"{title}, tuning",
            epochs=config.tuning_epochs,
            batch=config.batch,
            folder=folder / TUNING,
            progress=progress,
        )
    return DeepPrediction(network.eval(), curves)


def _reconstruct(
    network: DeepProMP, pictures: Tensor, seed: int, folder: Path, title: str, progress: Tell
) -> list[float]:
    """tr-1; afterwards the network's encoder is the trained one, its MLPs as they were."""
    config = network.config
    if not config.reconstruction_epochs:
        return []
    kind = "variational" if config.variational else "plain"
    return run_stage(
        ReconstructionStage(network, seed),
        (pictures,),
        name=f"{title}, reconstruction",
        epochs=config.reconstruction_epochs,
        batch=config.batch,
        folder=folder / f"{RECONSTRUCTION}-{kind}",
        progress=progress,
    )


def block_diagonal(mean: NDArray[np.float64], blocks: NDArray[np.float64]) -> Movements:
    """Movements (N) of means (N, D, B) and each degree's own covariance (N, D, B, B)."""
    N, D, B = mean.shape
    whole = np.zeros((N, D, B, D, B))
    degrees = np.arange(D)
    whole[:, degrees, :, degrees, :] = blocks.transpose(1, 0, 2, 3)
    return Movements(mean, whole.reshape(N, D * B, D * B))


@torch.no_grad()
def _shown(network: DeepProMP, reaches: Reaches) -> Tensor:
    """What the MLPs learn from: (P, 256) encodings, or (P, 2, 256) mean and log variance to draw them from."""
    if not network.config.sampled_latents:
        return _encodings(network, reaches)
    network.eval()
    parts = torch.split(torch.from_numpy(reaches.pictures), BATCH)
    return torch.cat([torch.stack(network.encoder.distribution(as_input(rows)), dim=1) for rows in parts])


@torch.no_grad()
def _encodings(network: DeepProMP, reaches: Reaches) -> Tensor:
    network.eval()
    pictures = torch.from_numpy(reaches.pictures)
    return torch.cat([network.encoder(as_input(rows)) for rows in torch.split(pictures, BATCH)])


def _floats(values: NDArray[np.float64]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))
