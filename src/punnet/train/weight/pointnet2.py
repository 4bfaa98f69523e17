"""PointNet++ (Qi, Yi, Su, Guibas, NeurIPS 2017), single-scale grouping: PointNets on neighbourhoods, step by step larger."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from punnet.errors import ConfigurationError
from punnet.train.weight.deep_config import PointConfig
from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_layers import SharedLayers, WeightNetwork, weight_head
from punnet.train.weight.deep_training import DeepRecipe, deep_spec
from punnet.train.weight.point_sets import farthest_points, gather_points, neighbours_within

__all__ = ["POINTNET2", "PointNet2", "PointNet2Config"]


@dataclass(frozen=True)
class PointNet2Config(PointConfig):
    """PointNet++'s settings, one entry a level.

    Parameters
    ----------
    centres
        Centres of neighbourhoods, by farthest-point sampling.
    radii
        Of the neighbourhoods, in units of ``length``.
    neighbours
        At most so many points of each.
    widths
        Of each level's shared network.
    last
        Widths of the network over all centres of the last level.
    head
        Widths of the dense layers before the linear unit.
    """

    centres: tuple[int, ...] = (128, 32)
    radii: tuple[float, ...] = (0.25, 0.5)
    neighbours: tuple[int, ...] = (32, 32)
    widths: tuple[tuple[int, ...], ...] = ((64, 64, 128), (128, 128, 256))
    last: tuple[int, ...] = (256, 512, 1024)
    head: tuple[int, ...] = (512, 256)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.centres) == len(self.radii) == len(self.neighbours) == len(self.widths):
            raise ConfigurationError(
                "pointnet2: centres, radii, neighbours and widths need one entry a level"
            )


class PointNet2(WeightNetwork):
    """(B, N, 4) → grams."""

    def __init__(self, config: PointNet2Config) -> None:
        super().__init__()
        width = 4
        levels = []
        for centres, radius, neighbours, widths in zip(
            config.centres, config.radii, config.neighbours, config.widths, strict=True
        ):
            levels.append(SetAbstraction(centres, radius, neighbours, (width + 3, *widths)))
            width = widths[-1]
        self.levels = nn.ModuleList(levels)
        self.last = SharedLayers((width + 3, *config.last))
        self.head = weight_head((config.last[-1], *config.head), config.dropout)

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        points, features = inputs[..., :3], inputs
        for level in self.levels:
            points, features = level(points, features)
        whole = self.last(torch.cat((points, features), dim=2)).amax(dim=1)
        grams: Tensor = self.head(whole)
        return grams


class SetAbstraction(nn.Module):
    """A PointNet on the neighbourhood of each of a few centres."""

    def __init__(self, centres: int, radius: float, neighbours: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.centres = centres
        self.radius = radius
        self.neighbours = neighbours
        self.shared = SharedLayers(widths)

    def forward(self, points: Tensor, features: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, 3), (B, N, C) → the centres (B, M, 3) and their features (B, M, C')."""
        centres = gather_points(points, farthest_points(points, self.centres))
        indices = neighbours_within(points, centres, self.radius, self.neighbours)
        offsets = (gather_points(points, indices) - centres[:, :, None]) / self.radius
        grouped = torch.cat((offsets, gather_points(features, indices)), dim=3)
        return centres, self.shared(grouped).amax(dim=2)


POINTNET2 = deep_spec(
    DeepRecipe("pointnet2", PointNet2Config, PointNet2, PointInputs),
    title="PointNet++",
    quick={"epochs": 30, "points": 256, "neighbours": (16, 16)},
    thesis={0.10: 27.23, 0.20: 48.30},
)
