"""PointConv (Wu, Qi, Li, CVPR 2019): convolution whose kernel is a network of the offset, and whose sum weighs by density."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from punnet.errors import ConfigurationError
from punnet.train.weight.deep_config import PointConfig
from punnet.train.weight.deep_inputs import PointInputs
from punnet.train.weight.deep_layers import SharedLayers, WeightNetwork, weight_head
from punnet.train.weight.deep_training import DeepRecipe, deep_spec
from punnet.train.weight.point_sets import farthest_points, gather_points, nearest_neighbours

__all__ = ["POINTCONV", "PointConv", "PointConvConfig", "point_density"]


@dataclass(frozen=True)
class PointConvConfig(PointConfig):
    """PointConv's settings, one entry a level; the last level sees all points as one neighbourhood.

    Parameters
    ----------
    centres
        Of neighbourhoods, by farthest-point sampling; 1 for all points about their mean.
    neighbours
        Nearest points of each; not used at a level of 1 centre.
    bandwidths
        Of the density's kernel, in units of ``length``.
    widths
        Of each level's shared network; the last is also the width after the convolution.
    kernel
        Width of the kernel network's output.
    head
        Widths of the dense layers before the linear unit.
    """

    centres: tuple[int, ...] = (128, 32, 1)
    neighbours: tuple[int, ...] = (32, 16, 32)
    bandwidths: tuple[float, ...] = (0.15, 0.3, 0.6)
    widths: tuple[tuple[int, ...], ...] = ((64, 64, 128), (128, 128, 256), (256, 512))
    kernel: int = 16
    head: tuple[int, ...] = (256, 128)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.centres) == len(self.neighbours) == len(self.bandwidths) == len(self.widths):
            raise ConfigurationError(
                "pointconv: centres, neighbours, bandwidths and widths need one entry a level"
            )
        if self.centres[-1] != 1:
            raise ConfigurationError(f"pointconv: the last level has 1 centre, got {self.centres[-1]}")


class PointConv(WeightNetwork):
    """(B, N, 4) → grams."""

    def __init__(self, config: PointConvConfig) -> None:
        super().__init__()
        width = 4
        levels = []
        for centres, neighbours, bandwidth, widths in zip(
            config.centres, config.neighbours, config.bandwidths, config.widths, strict=True
        ):
            levels.append(
                DensityConvolution(centres, neighbours, bandwidth, (width + 3, *widths), config.kernel)
            )
            width = widths[-1]
        self.levels = nn.ModuleList(levels)
        self.head = weight_head((width, *config.head), config.dropout)

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        points, features = inputs[..., :3], inputs
        for level in self.levels:
            points, features = level(points, features)
        grams: Tensor = self.head(features[:, 0])
        return grams


class DensityConvolution(nn.Module):
    """One PointConv layer: Σ over the neighbourhood of kernel(offset) · S(density) · features."""

    def __init__(
        self, centres: int, neighbours: int, bandwidth: float, widths: tuple[int, ...], kernel: int
    ) -> None:
        super().__init__()
        self.centres = centres
        self.neighbours = neighbours
        self.bandwidth = bandwidth
        self.features = SharedLayers(widths)
        self.kernel = SharedLayers((3, 8, 8, kernel))
        self.density = nn.Sequential(SharedLayers((1, 16, 8)), nn.Linear(8, 1), nn.Sigmoid())
        self.convolve = SharedLayers((kernel * widths[-1], widths[-1]))

    def forward(self, points: Tensor, features: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, 3), (B, N, C) → the centres (B, M, 3) and their features (B, M, C')."""
        inverse = 1.0 / point_density(points, self.bandwidth)
        if self.centres == 1:
            centres = points.mean(dim=1, keepdim=True)
            indices = torch.arange(points.shape[1], device=points.device).expand(len(points), 1, -1)
        else:
            centres = gather_points(points, farthest_points(points, self.centres))
            indices = nearest_neighbours(points, centres, self.neighbours)
        offsets = gather_points(points, indices) - centres[:, :, None]
        learnt = self.features(torch.cat((offsets, gather_points(features, indices)), dim=3))
        sparse = gather_points(inverse[:, :, None], indices)
        sparse = sparse / sparse.amax(dim=2, keepdim=True)
        kernels = self.kernel(offsets)
        summed = (learnt * self.density(sparse)).transpose(2, 3) @ kernels / indices.shape[2]
        return centres, self.convolve(summed.flatten(start_dim=2))


def point_density(points: Tensor, bandwidth: float) -> Tensor:
    """Density (B, N) of ``points`` (B, N, 3) by a Gaussian kernel of that bandwidth; never 0, a point counts itself."""
    squares = torch.cdist(points, points).square()
    kernel = torch.exp(-squares / (2.0 * bandwidth**2)) / ((2.0 * math.pi) ** 1.5 * bandwidth**3)
    density: Tensor = kernel.mean(dim=2)
    return density


POINTCONV = deep_spec(
    DeepRecipe("pointconv", PointConvConfig, PointConv, PointInputs),
    title="PointConv",
    quick={"epochs": 25, "points": 256, "neighbours": (16, 16, 32)},
    thesis={0.10: 15.50, 0.20: 28.90},
)
