"""A deep weight estimator under PyTorch Lightning: loss on the relative error, Adam, a cosine, what is said of each epoch."""

from __future__ import annotations

import math
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import Callback
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.modules.batchnorm import _BatchNorm
from torch.utils.data import Dataset

from punnet.train.weight.deep_config import DeepConfig
from punnet.train.weight.deep_inputs import BerryInputs
from punnet.train.weight.deep_layers import WeightNetwork
from punnet.train.weight.registry import Tell

__all__ = ["VALIDATED", "Curve", "DeepModule", "DrawnBatches", "StillBatches", "relative_loss"]

VALIDATED = "validation/loss"
Batch = tuple[Tensor, Tensor]


def relative_loss(found: Tensor, grams: Tensor, tolerance: float) -> Tensor:
    """Smooth L1 of the relative error (ĝ − g) / g, in units of ``tolerance``: what PCW counts, for light and heavy alike."""
    relative = (found - grams) / (grams * tolerance)
    return torch.nn.functional.smooth_l1_loss(relative, torch.zeros_like(relative))


class DrawnBatches(Dataset[Batch]):
    """Inputs drawn at random, and grams, of what :class:`~punnet.train.loops.BatchDraws` asks for."""

    def __init__(self, inputs: BerryInputs, grams: NDArray[np.float64]) -> None:
        self.inputs = inputs
        self.grams = torch.from_numpy(grams.astype(np.float32))

    def __getitem__(self, draw: tuple[int, NDArray[np.int64]]) -> Batch:
        seed, indices = draw
        return self.inputs.draw(indices, np.random.default_rng(seed)), self.grams[indices]


class StillBatches(Dataset[Batch]):
    """Batch after batch of the berries as they are."""

    def __init__(self, inputs: BerryInputs, grams: NDArray[np.float64], batch: int = 64) -> None:
        self.inputs = inputs
        self.grams = torch.from_numpy(grams.astype(np.float32))
        self.batch = batch

    def __len__(self) -> int:
        return math.ceil(len(self.inputs) / self.batch)

    def __getitem__(self, index: int) -> Batch:
        if not 0 <= index < len(self):
            raise IndexError(index)
        indices = np.arange(index * self.batch, min((index + 1) * self.batch, len(self.inputs)))
        return self.inputs.still(indices), self.grams[indices]


class DeepModule(lightning.LightningModule):
    """Trains a :class:`WeightNetwork`."""

    def __init__(self, network: WeightNetwork, config: DeepConfig, *, seed: int, steps: int) -> None:
        super().__init__()
        self.network = network
        self.settings = config
        self.seed = seed
        self.steps = steps
        self._errors: list[Tensor] = []

    def on_train_batch_start(self, batch: Batch, batch_idx: int) -> None:
        """Dropout draws by the step's own seed, so that a resumed run draws what it would have drawn.

        After ``settled`` of the steps batch normalisation is as in use, from here on until validation and again after it.
        """
        torch.manual_seed(self.seed * 1_000_003 + self.global_step)
        if self.global_step >= self.settings.settled * self.steps:
            for part in self.network.modules():
                if isinstance(part, _BatchNorm):
                    part.eval()

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Loss of a batch, and what the network adds."""
        inputs, grams = batch
        loss = relative_loss(self.network(inputs), grams, self.settings.tolerance)
        self.log("training/loss", loss.detach(), on_step=False, on_epoch=True, batch_size=len(grams))
        return loss + self.network.penalty()

    def validation_step(self, batch: Batch, batch_idx: int) -> None:
        """Keep the relative errors; they are judged together."""
        inputs, grams = batch
        self._errors.append((self.network(inputs) - grams) / grams)

    def on_validation_epoch_end(self) -> None:
        """Loss, mean relative error and share within 20%, over all validation berries."""
        errors = torch.cat(self._errors)
        self._errors.clear()
        ones = torch.ones_like(errors)
        self.log(VALIDATED, relative_loss(1.0 + errors, ones, self.settings.tolerance))
        self.log("validation/mape", errors.abs().mean())
        self.log("validation/pcw20", (errors.abs() < 0.2).float().mean())

    def configure_optimizers(self) -> Any:
        """Adam; linear warm-up, then cosine to a hundredth."""
        optimizer = torch.optim.Adam(self.network.parameters(), lr=self.settings.learning_rate, fused=True)
        warm_up = min(self.settings.warm_up, self.steps // 10)

        def rate(step: int) -> float:
            if step < warm_up:
                return (step + 1) / warm_up
            done = min((step - warm_up) / max(self.steps - warm_up, 1), 1.0)
            return 0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * done))

        schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, rate)
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


class Curve(Callback):
    """Keeps the scores of each epoch, through interruptions, and tells them."""

    def __init__(self, name: str, tell: Tell) -> None:
        self.name = name
        self.tell = tell
        self.epochs: list[dict[str, float]] = []

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """The validation of this epoch, which is over by now."""
        scores = {
            name: float(trainer.callback_metrics[f"validation/{name}"]) for name in ("loss", "mape", "pcw20")
        }
        self.epochs.append({"epoch": trainer.current_epoch, **scores})
        self.tell(
            f"{self.name}: epoch {trainer.current_epoch + 1} of {trainer.max_epochs}, validation: mean error "
            f"{100 * scores['mape']:.1f}%, {100 * scores['pcw20']:.0f}% within 20%"
        )

    def state_dict(self) -> dict[str, Any]:
        """For the checkpoint."""
        return {"epochs": self.epochs}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """From the checkpoint."""
        self.epochs = list(state_dict["epochs"])
