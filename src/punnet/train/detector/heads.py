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
    Outlines finer than the pyramid's cells are drawn from finer maps: the backbone's at stride 2, and the image.

    Parameters
    ----------
    config
        Widths.
    inputs
        Channels of the region features.
    finer
        Channels of the finer maps together; 0 if there are none.
    """

    def __init__(self, config: DetectorConfig, inputs: int, finer: int) -> None:
        super().__init__()
        width = config.mask_channels
        outputs = config.fine_channels or width
        self.convolutions = _convolutions(inputs, width, config.mask_layers)
        self.upsampling = nn.ConvTranspose2d(width, outputs, 2, stride=2)
        self.refinement = _convolutions(outputs + finer, outputs, 2 if config.fine_channels else 0)
        self.output = nn.Conv2d(outputs, 1, 1)
        _initialise(self)

    def forward(self, regions: Tensor, finer: list[Tensor]) -> Tensor:
        """Mask logits (N, 1, 2R, 2R), of region features and of finer maps (N, ·, 2R, 2R)."""
        drawn = F.relu(self.upsampling(self.convolutions(regions)))
        logits: Tensor = self.output(self.refinement(torch.cat((drawn, *finer), dim=1)))
        return logits


class KeypointHead(nn.Module):
    """Region features (N, C, R, R) to heat-map logits and what the attribute head reads.

    Seen with half the cells, so that a point that is hidden can be told from all that is around it. With
    ``fine_channels``, refined at all the cells, into maps (N, 5, 2R, 2R); without, maps are (N, 5, R, R).
    """

    def __init__(self, config: DetectorConfig, inputs: int) -> None:
        super().__init__()
        width, fine = config.keypoint_channels, config.fine_channels
        self.convolutions = _convolutions(inputs, width, config.keypoint_layers)
        if fine:
            self.upsampling = nn.ConvTranspose2d(width, fine, 4, stride=2, padding=1)
            self.refinement = _convolutions(fine + inputs, fine, 1)
        self.output = nn.ConvTranspose2d(fine or width, len(KEYPOINTS), 4, stride=2, padding=1)
        self.refines = fine > 0
        _initialise(self)

    def forward(self, regions: Tensor) -> tuple[Tensor, Tensor]:
        """Heat-map logits, and features (N, C', R/2, R/2)."""
        features = self.convolutions(F.avg_pool2d(regions, 2))
        maps = features
        if self.refines:
            maps = self.refinement(torch.cat((F.relu(self.upsampling(features)), regions), dim=1))
        return self.output(maps), features


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
