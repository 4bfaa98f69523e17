"""PointNet (Qi, Su, Mo, Guibas, CVPR 2017): the same small network for every point, then the largest of each feature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor, nn

from punnet.errors import ConfigurationError
from punnet.train.weight.deep_config import PointConfig
from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_layers import SharedLayers, WeightNetwork, weight_head
from punnet.train.weight.deep_training import DeepRecipe, deep_spec

__all__ = ["POINTNET", "PointNet", "PointNetConfig"]


@dataclass(frozen=True)
class PointNetConfig(PointConfig):
    """PointNet's settings.

    Parameters
    ----------
    first, second
        Widths of the two shared networks; the feature transform stands between them.
    head
        Widths of the dense layers before the linear unit.
    transforms
        ``features``: the learnt transform of the first features, held near a rotation; ``none``: without. The paper's
        transform of the input is left out: it would undo the pose and the scale in which a berry's size lies.
    orthogonality
        Factor of the term that holds the transform near a rotation.
    """

    first: tuple[int, ...] = (64, 64)
    second: tuple[int, ...] = (64, 128, 1024)
    head: tuple[int, ...] = (512, 256)
    transforms: Literal["features", "none"] = "features"
    orthogonality: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.transforms not in ("features", "none"):
            raise ConfigurationError(
                f"pointnet: transforms must be features or none, got {self.transforms!r}"
            )


class PointNet(WeightNetwork):
    """(B, N, 4) → grams; invariant to the order of the points."""

    def __init__(self, config: PointNetConfig) -> None:
        super().__init__()
        self.first = SharedLayers((4, *config.first))
        width = config.first[-1]
        self.transform = FeatureTransform(width) if config.transforms == "features" else None
        self.second = SharedLayers((width, *config.second))
        self.head = weight_head((config.second[-1], *config.head), config.dropout)
        self._orthogonality = config.orthogonality
        self._off = torch.zeros(())

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        features = self.first(inputs)
        if self.transform is not None:
            turn = self.transform(features)
            gram = turn @ turn.transpose(1, 2) - torch.eye(turn.shape[1], device=turn.device)
            self._off = gram.square().sum(dim=(1, 2)).mean()
            features = features @ turn
        grams: Tensor = self.head(self.second(features).amax(dim=1))
        return grams

    def penalty(self) -> Tensor:
        """How far the transform is from a rotation (‖A Aᵀ − I‖²)."""
        return self._orthogonality * self._off


class FeatureTransform(nn.Module):
    """A matrix (B, C, C) for each cloud, the identity at first: a small PointNet of its own."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.shared = SharedLayers((width, 64, 128, 256))
        self.dense = SharedLayers((256, 128))
        self.last = nn.Linear(128, width * width)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)
        self.width = width

    def forward(self, features: Tensor) -> Tensor:
        """(B, N, C) → (B, C, C)."""
        change = self.last(self.dense(self.shared(features).amax(dim=1)))
        identity = torch.eye(self.width, device=features.device)
        turns: Tensor = identity + change.view(-1, self.width, self.width)
        return turns


POINTNET = deep_spec(
    DeepRecipe("pointnet", PointNetConfig, PointNet, PointInputs),
    title="PointNet",
    quick={"epochs": 40, "points": 256},
    thesis={0.10: 23.00, 0.20: 41.90},
)
