"""The detector under PyTorch Lightning: losses, optimiser, validation by mask average precision."""

from __future__ import annotations

import math
from typing import Any

import lightning
import torch
from torch import Tensor

from punnet.train.detector.config import DetectorConfig, DetectorTraining, config_to_json
from punnet.train.detector.network import BerryDetector

__all__ = ["VALIDATED", "DetectorModule", "rate_at"]

Batch = tuple[Tensor, list[dict[str, Tensor]]]
VALIDATED = "validation/mask_ap"


class DetectorModule(lightning.LightningModule):
    """Trains a :class:`BerryDetector` with the weighted sum of Eq. 3.1's terms; every term is logged."""

    def __init__(self, config: DetectorConfig, training: DetectorTraining) -> None:
        super().__init__()
        self.training_config = training
        self.network = BerryDetector(config)
        self.network.to(memory_format=torch.channels_last)
        self.save_hyperparameters({"detector": config_to_json(config), "training": config_to_json(training)})

    def on_train_batch_start(self, batch: Batch, batch_idx: int) -> None:
        """Proposals are sampled by the step's own seed, so that a resumed run samples what it would have sampled."""
        torch.manual_seed(self.training_config.seed * 1_000_003 + self.global_step)

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Weighted sum of the losses of a batch."""
        images, targets = batch
        losses = self.network(images.float().contiguous(memory_format=torch.channels_last), targets)
        weights = self.training_config.loss
        total = torch.stack([getattr(weights, name) * value.float() for name, value in losses.items()]).sum()
        self.log_dict(
            {f"loss/{name}": value.detach() for name, value in losses.items()}, batch_size=len(images)
        )
        self.log("loss", total.detach(), prog_bar=True, batch_size=len(images))
        return total

    def configure_optimizers(self) -> Any:
        """AdamW, the backbone slower; linear warm-up, then cosine to a hundredth."""
        settings = self.training_config
        trunk = [p for p in self.network.trunk.body.parameters() if p.requires_grad]
        slower = {id(p) for p in trunk}
        others = [p for p in self.network.parameters() if p.requires_grad and id(p) not in slower]
        optimizer = torch.optim.AdamW(
            [
                {"params": trunk, "lr": settings.learning_rate * settings.backbone_rate},
                {"params": others, "lr": settings.learning_rate},
            ],
            weight_decay=settings.weight_decay,
        )
        schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: rate_at(step, settings))
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


def rate_at(step: int, training: DetectorTraining) -> float:
    """Factor of the learning rate at a step."""
    if step < training.warm_up:
        return (step + 1) / training.warm_up
    done = (step - training.warm_up) / max(training.steps - training.warm_up, 1)
    return 0.01 + 0.99 * 0.5 * (1.0 + math.cos(math.pi * min(done, 1.0)))
