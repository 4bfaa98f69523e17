"""A deep-ProMP: encoder and MLPs (Eq. 5.9, 5.10, 5.16)."""

from __future__ import annotations

from torch import Tensor, nn

from punnet.train.planner.autoencoder import Decoder, Encoder
from punnet.train.planner.config import PlannerConfig
from punnet.train.planner.heads import MovementHeads

__all__ = ["DeepProMP", "as_input"]

DEGREES = 7


class DeepProMP(nn.Module):
    """Picture with a marked target, and its box's centre, to a distribution of movements.

    Parameters
    ----------
    config
        Which of the thesis' networks.
    functions
        Basis functions B of the movement primitive.
    """

    def __init__(self, config: PlannerConfig, functions: int = 8) -> None:
        super().__init__()
        self.config = config
        self.encoder = Encoder(variational=config.variational)
        self.decoder = Decoder()
        self.heads = MovementHeads(DEGREES, functions, config.trunk, conditioned=config.conditioned)

    def forward(self, pictures: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
        """Mean weights (N, 7, B) and factors (N, 7, B, B) of ``pictures`` (N, 128, 128, 3) uint8, ``centres`` (N, 2)."""
        mean, factor = self.heads(self.encoder(as_input(pictures)), centres)
        return mean, factor


def as_input(pictures: Tensor) -> Tensor:
    """Bytes (N, 128, 128, 3) as the encoder takes them: (N, 3, 128, 128) in [0, 1]."""
    return pictures.permute(0, 3, 1, 2).float() / 255.0
