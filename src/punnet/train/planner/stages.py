"""The stages of training: reconstruction (tr-1), movements (tr-2), tuning; algorithms 5.1 to 5.4.

Each keeps a checkpoint in a folder of its own and goes on from it; a finished one is only read again.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import Callback, ModelCheckpoint
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from punnet.errors import ConfigurationError
from punnet.outputs import write_text
from punnet.train.loops import BatchDraws, fit_resumably, quiet_lightning
from punnet.train.planner.autoencoder import sampled
from punnet.train.planner.losses import endpoint_loss, latent_divergence, movement_loss, reconstruction_loss
from punnet.train.planner.network import DeepProMP, as_input

__all__ = ["CURVE_FILE", "MovementStage", "ReconstructionStage", "Stage", "TuningStage", "run_stage"]

LAST, CURVE_FILE = "last.ckpt", "curve.json"
CHECKPOINTS = 20
"""Times in a stage that a checkpoint is written."""
Tell = Callable[[str], None]


class Stage(lightning.LightningModule):
    """What the stages share: Adam, a plateau schedule, seeds by step."""

    def __init__(self, network: DeepProMP, seed: int) -> None:
        super().__init__()
        self.network = network
        self.settings = network.config
        self.seed = seed

    def parts(self) -> list[str]:
        """Names of the network's parts that this stage trains; its checkpoint holds no others."""
        raise NotImplementedError

    def trained(self) -> list[torch.nn.Parameter]:
        """Parameters that this stage trains."""
        return [p for part in self.parts() for p in self.network.get_submodule(part).parameters()]

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Leave out what other stages train."""
        kept = tuple(f"network.{part}." for part in self.parts())
        state = checkpoint["state_dict"]
        checkpoint["state_dict"] = {name: value for name, value in state.items() if name.startswith(kept)}

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """What other stages train is as it is."""
        checkpoint["state_dict"] = {**self.state_dict(), **checkpoint["state_dict"]}

    @property
    def rate(self) -> float:
        """Adam's."""
        return self.settings.learning_rate

    def loss(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Of a batch."""
        raise NotImplementedError

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Draws depend on seed and step alone, so that a resumed run draws what it would have drawn."""
        torch.manual_seed(self.seed * 1_000_003 + self.global_step)

    def training_step(self, batch: tuple[Tensor, ...], batch_idx: int) -> Tensor:
        """Loss, logged as the mean of its epoch."""
        loss = self.loss(batch)
        self.log("loss", loss.detach(), on_step=False, on_epoch=True, batch_size=len(batch[0]))
        return loss

    def configure_optimizers(self) -> Any:
        """Adam, its rate lowered by a plateau schedule."""
        settings = self.settings
        optimizer = torch.optim.Adam(self.trained(), lr=self.rate, fused=True)
        schedule = torch.optim.lr_scheduler.ReduceLROnPlateau(
            optimizer, factor=settings.schedule_factor, patience=settings.schedule_patience
        )
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "monitor": "loss"}}


class ReconstructionStage(Stage):
    """tr-1: encoder and decoder learn to reconstruct pictures; batches are (pictures,)."""

    def parts(self) -> list[str]:
        """Encoder and decoder."""
        return ["encoder", "decoder"]

    def loss(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Eq. 5.12, or 5.15."""
        pictures = as_input(batch[0])
        encoder, kind = self.network.encoder, self.settings.reconstruction
        if not self.settings.variational:
            return reconstruction_loss(self.network.decoder(encoder(pictures)), pictures, kind)
        mean, log_variance = encoder.distribution(pictures)
        logits = self.network.decoder(sampled(mean, log_variance))
        # Eq. 5.15 adds the divergence to ‖I − Î‖²: with a mean over values it counts by as much less.
        share = 1.0 if kind == "bce" else 1.0 / pictures[0].numel()
        return reconstruction_loss(logits, pictures, kind) + share * latent_divergence(mean, log_variance)


class MovementStage(Stage):
    """tr-2: the MLPs learn movements; batches are (latents, centres, means, covariances).

    Where pictures come in place of latents the encoder learns too: the model ``direct``. Latents of (N, 2, 256) are means
    and logarithms of variances, and are drawn from at each step.
    """

    phi: Tensor

    def __init__(self, network: DeepProMP, seed: int, phi: NDArray[np.float64]) -> None:
        super().__init__(network, seed)
        self.register_buffer("phi", torch.from_numpy(phi.astype(np.float32)), persistent=False)
        self.direct = network.config.kind == "direct"

    def parts(self) -> list[str]:
        """The MLPs."""
        return ["heads", "encoder"] if self.direct else ["heads"]

    def loss(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Eq. 5.13, summed over the degrees of freedom, which have nothing in common."""
        seen, centres, mean, covariance = batch
        if self.direct:
            latent = self.network.encoder(as_input(seen))
        else:
            latent = sampled(seen[:, 0], seen[:, 1]) if seen.ndim == 3 else seen
        found, factor = self.network.heads(latent, centres)
        return movement_loss(found, factor, mean, covariance, self.phi, self.settings.alpha).sum()


class TuningStage(Stage):
    """Domain-specific tuning of the encoder, the MLPs frozen; batches are (pictures, centres, means, covariances).

    Batch normalisation keeps its statistics: the MLPs were trained on what it gives with them.
    """

    last: Tensor

    def __init__(self, network: DeepProMP, seed: int, last: NDArray[np.float64]) -> None:
        super().__init__(network, seed)
        self.register_buffer("last", torch.from_numpy(last.astype(np.float32)), persistent=False)

    def parts(self) -> list[str]:
        """The encoder."""
        return ["encoder"]

    @property
    def rate(self) -> float:
        """The tuning's own."""
        return self.settings.tuning_rate

    def on_train_epoch_start(self) -> None:
        """Keep the statistics."""
        self.network.encoder.eval()

    def loss(self, batch: tuple[Tensor, ...]) -> Tensor:
        """Eq. 5.17, summed over the degrees of freedom."""
        pictures, centres, mean, covariance = batch
        found, factor = self.network(pictures, centres)
        return endpoint_loss(found, factor, mean, covariance, self.last, self.settings.alpha).sum()


class _Rows(Dataset[tuple[Tensor, ...]]):
    """Rows of tensors by what :class:`BatchDraws` asks for."""

    def __init__(self, tensors: tuple[Tensor, ...]) -> None:
        self.tensors = tensors

    def __getitem__(self, draw: tuple[int, NDArray[np.int64]]) -> tuple[Tensor, ...]:
        rows = torch.from_numpy(draw[1])
        return tuple(tensor[rows] for tensor in self.tensors)


class _Curve(Callback):
    """Keeps the loss of each epoch, through interruptions, and tells it now and then."""

    def __init__(self, name: str, tell: Tell) -> None:
        self.name, self.tell = name, tell
        self.losses: list[float] = []

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        loss = float(trainer.callback_metrics["loss"])
        self.losses.append(loss)
        done, of = trainer.current_epoch + 1, trainer.max_epochs or 1
        if done % max(1, of // CHECKPOINTS) == 0 or done == of:
            self.tell(f"{self.name}: epoch {done} of {of}, loss {loss:.3g}")

    def state_dict(self) -> dict[str, Any]:
        return {"losses": self.losses}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        self.losses = list(state_dict["losses"])


def run_stage(
    stage: Stage,
    tensors: tuple[Tensor, ...],
    *,
    name: str,
    epochs: int,
    batch: int,
    folder: Path,
    progress: Tell,
) -> list[float]:
    """Train a stage to its end, from where an earlier call stopped; the loss of each epoch.

    Parameters
    ----------
    stage
        Its network is trained in place, and in evaluation mode afterwards.
    tensors
        Rows to learn from.
    name
        For what is told.
    epochs, batch
        Passes over the rows; rows a step.
    folder
        Of the stage's checkpoint.
    progress
        Told how it goes.

    Raises
    ------
    ConfigurationError
        If the checkpoint is damaged or of another network.
    Interrupted
        At Ctrl-C, with the last checkpoint.
    """
    last, curve_file = folder / LAST, folder / CURVE_FILE
    if not curve_file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        curve = _Curve(name, progress)
        draws = BatchDraws(len(tensors[0]), batch, stage.seed)
        loader = DataLoader(_Rows(tensors), sampler=draws, batch_size=None)
        with quiet_lightning():
            trainer = _trainer(folder, epochs, curve)
            fit_resumably(trainer, stage, loader, None, last)
            trainer.save_checkpoint(last)
        write_text(curve_file, json.dumps(curve.losses) + "\n")
    _load(stage, last)
    stage.eval()
    losses: list[float] = json.loads(curve_file.read_text())
    return losses


def _trainer(folder: Path, epochs: int, curve: _Curve) -> lightning.Trainer:
    keeper = ModelCheckpoint(
        folder,
        LAST.removesuffix(".ckpt"),
        every_n_epochs=max(1, epochs // CHECKPOINTS),
        save_on_train_epoch_end=True,
        enable_version_counter=False,
    )
    return lightning.Trainer(
        accelerator="auto",
        devices=1,
        max_epochs=epochs,
        logger=False,
        callbacks=[curve, keeper],
        default_root_dir=folder,
        enable_model_summary=False,
        enable_progress_bar=False,
        use_distributed_sampler=False,
    )


def _load(stage: Stage, checkpoint: Path) -> None:
    try:
        state = torch.load(checkpoint, map_location="cpu", weights_only=True)["state_dict"]
        stage.load_state_dict({**stage.state_dict(), **state})
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise ConfigurationError(
            f"{checkpoint}: not a checkpoint of this network ({str(error).splitlines()[0]}); train in another folder"
        ) from error
