"""Parts that the networks have in common."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

__all__ = ["SharedLayers", "WeightNetwork", "weight_head"]


class WeightNetwork(nn.Module):
    """A network with one linear output, in grams.

    The output's unit is the spread of the training weights, its zero their mean; both are kept with the weights.
    """

    grams_mean: Tensor
    grams_spread: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("grams_mean", torch.tensor(0.0))
        self.register_buffer("grams_spread", torch.tensor(1.0))

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1), the linear output."""
        raise NotImplementedError

    def forward(self, inputs: Tensor) -> Tensor:
        """Grams (B,)."""
        return self.grams_mean + self.grams_spread * self.output(inputs)[:, 0]

    def penalty(self) -> Tensor:
        """What the last pass adds to the loss."""
        return self.grams_mean.new_zeros(())


class SharedLayers(nn.Module):
    """Dense layers, each with batch normalisation and an activation, on the last axis of (…, C): alike for all points.

    Parameters
    ----------
    widths
        Input, then each layer's.
    slope
        Of the activation below 0.
    """

    def __init__(self, widths: Sequence[int], slope: float = 0.0) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise(widths):
            layers += [nn.Linear(before, after, bias=False), nn.BatchNorm1d(after), nn.LeakyReLU(slope)]
        self.layers = nn.Sequential(*layers)

    def forward(self, features: Tensor) -> Tensor:
        """(…, C) → (…, width of the last layer)."""
        flat: Tensor = self.layers(features.reshape(-1, features.shape[-1]))
        return flat.reshape(*features.shape[:-1], flat.shape[-1])


def weight_head(widths: Sequence[int], dropout: float) -> nn.Sequential:
    """Dense layers of the widths (input first), with dropout, then one linear unit."""
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [SharedLayers((before, after)), nn.Dropout(dropout)]
    return nn.Sequential(*layers, nn.Linear(widths[-1], 1))
