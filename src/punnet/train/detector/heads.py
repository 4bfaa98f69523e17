"""What reads a berry off its region of the trunk: mask, five heat-maps, visibility, ripeness."""

from __future__ import annotations

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from punnet.scene import KEYPOINTS, Visibility
from punnet.train.detector.config import DetectorConfig

__all__ = ["AttributeHead", "KeypointHead", "MaskHead", "ripeness_loss", "visibility_loss"]


def _convolutions(inputs: int, channels: int, layers: int) -> nn.Sequential:
    blocks: list[nn.Module] = []
    for k in range(layers):
        blocks += [nn.Conv2d(inputs if k == 0 else channels, channels, 3, padding=1), nn.ReLU(inplace=True)]
    return nn.Sequential(*blocks)


def _initialise(module: nn.Module) -> None:
    for layer in module.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
            nn.init.kaiming_normal_(layer.weight, mode="fan_out", nonlinearity="relu")
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


class MaskHead(nn.Module):
    """Region features (N, C, R, R) to mask logits (N, 2R, 2R).

    One mask whatever the class: a berry's outline does not depend on its ripeness, and so both classes teach it.
    """

    def __init__(self, config: DetectorConfig, inputs: int) -> None:
        super().__init__()
        width = config.mask_channels
        self.convolutions = _convolutions(inputs, width, config.mask_layers)
        self.upsampling = nn.ConvTranspose2d(width, width, 2, stride=2)
        self.output = nn.Conv2d(width, 1, 1)
        _initialise(self)

    def forward(self, regions: Tensor) -> Tensor:
        """Mask logits (N, 1, 2R, 2R)."""
        logits: Tensor = self.output(F.relu(self.upsampling(self.convolutions(regions))))
        return logits


class KeypointHead(nn.Module):
    """Region features (N, C, R, R) to heat-map logits (N, 5, R, R) and what the attribute head reads."""

    def __init__(self, config: DetectorConfig, inputs: int) -> None:
        super().__init__()
        width = config.keypoint_channels
        self.convolutions = _convolutions(inputs, width, config.keypoint_layers)
        self.output = nn.ConvTranspose2d(width, len(KEYPOINTS), 4, stride=2, padding=1)
        _initialise(self)

    def forward(self, regions: Tensor) -> tuple[Tensor, Tensor]:
        """Heat-map logits (N, 5, R, R), and features (N, C', R/2, R/2)."""
        features = self.convolutions(F.avg_pool2d(regions, 2))
        return self.output(features), features


class AttributeHead(nn.Module):
    """Visibility of each key-point and ripeness, from the key-point head's features."""

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__()
        cells = (config.region_size // 4) ** 2
        self.hidden = nn.Linear(config.keypoint_channels * cells, 64)
        self.output = nn.Linear(64, len(KEYPOINTS) * len(Visibility) + 1)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Visibility logits (N, 5, 4), and ripeness (N,) before the sigmoid."""
        pooled = F.avg_pool2d(features, 2).flatten(1)
        values = self.output(F.relu(self.hidden(pooled)))
        return values[:, :-1].reshape(-1, len(KEYPOINTS), len(Visibility)), values[:, -1]


def visibility_loss(logits: Tensor, allowed: Tensor) -> Tensor:
    """Negative log-probability of the codes that an annotation allows.

    Parameters
    ----------
    logits
        (N, 5, 4).
    allowed
        (N, 5, 4) bool: one code where visibility is known in detail, two where it is only known that the point is
        hidden, all where nothing is known (no loss there).
    """
    log_probability = torch.log_softmax(logits.float(), dim=-1)
    taken = torch.logsumexp(log_probability.masked_fill(~allowed, -torch.inf), dim=-1)
    known = ~allowed.all(dim=-1)
    if not known.any():
        return logits.sum() * 0
    return -taken[known].mean()


def ripeness_loss(logits: Tensor, ripeness: Tensor) -> Tensor:
    """Smooth L1 of the share, over the berries whose ripeness (N,) is known (not NaN)."""
    known = torch.isfinite(ripeness)
    if not known.any():
        return logits.sum() * 0
    return F.smooth_l1_loss(torch.sigmoid(logits[known].float()), ripeness[known], beta=0.1)
