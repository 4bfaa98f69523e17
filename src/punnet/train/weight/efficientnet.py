"""EfficientNet (Tan & Le, ICML 2019) twice, on colour and on depth; their last layers side by side into one unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import timm
import torch
from torch import Tensor, nn

from punnet.errors import ConfigurationError
from punnet.train.imagenet import fill_from_lite0
from punnet.train.weight.deep_config import ImageConfig, Start
from punnet.train.weight.deep_inputs import PictureInputs
from punnet.train.weight.deep_layers import WeightNetwork, weight_head
from punnet.train.weight.deep_training import DeepRecipe, deep_spec

__all__ = ["EFFICIENTNET_B0", "EFFICIENTNET_B7", "EfficientNetB7Config", "EfficientNetConfig", "TwoStreams"]

_OPEN = 3.0
"""Bias of gates that let 95% through: Lite0's layers never had any."""

Variant = Literal["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7"]


@dataclass(frozen=True)
class EfficientNetConfig(ImageConfig):
    """Settings of the two streams.

    Parameters
    ----------
    variant
        ``b0`` to ``b7``.
    start
        Of both streams; ``lite0`` fits ``b0`` alone.
    depth_dropout
        Share of residual blocks that are skipped in training (stochastic depth).
    """

    variant: Variant = "b0"
    start: Start = "lite0"
    depth_dropout: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.variant not in get_args(Variant):
            raise ConfigurationError(
                f"efficientnet: variant must be one of {', '.join(get_args(Variant))}, got {self.variant!r}"
            )
        if self.start == "lite0" and self.variant != "b0":
            raise ConfigurationError(
                f"efficientnet: start lite0 fits variant b0, not {self.variant}; start random or imagenet"
            )


@dataclass(frozen=True)
class EfficientNetB7Config(EfficientNetConfig):
    """Settings of the two streams, the largest variant."""

    variant: Variant = "b7"
    start: Start = "random"
    depth_dropout: float = 0.2


class TwoStreams(WeightNetwork):
    """(B, 5, S, S) → grams; colour and depth each have a network of their own."""

    def __init__(self, config: EfficientNetConfig) -> None:
        super().__init__()
        self.colour = _stream(config, channels=3)
        self.depth = _stream(config, channels=2)
        width = int(self.colour.num_features) + int(self.depth.num_features)
        self.dropout = nn.Dropout(config.dropout)
        self.head = weight_head((width,), config.dropout)
        self.to(memory_format=torch.channels_last)  # a fifth less time on CPUs

    def output(self, inputs: Tensor) -> Tensor:
        """(B, 1)."""
        both = torch.cat((self.colour(_last(inputs[:, :3])), self.depth(_last(inputs[:, 3:]))), dim=1)
        grams: Tensor = self.head(self.dropout(both))
        return grams


def _last(pictures: Tensor) -> Tensor:
    return pictures.contiguous(memory_format=torch.channels_last)


def _stream(config: EfficientNetConfig, channels: int) -> Any:
    """An EfficientNet without its last layer, on so many channels.

    Raises
    ------
    ConfigurationError
        If the weights that it is to start from can't be had.
    """
    try:
        network = timm.create_model(
            f"tf_efficientnet_{config.variant}",
            pretrained=config.start == "imagenet",
            in_chans=channels,
            num_classes=0,
            drop_path_rate=config.depth_dropout,
        )
    except Exception as error:
        if config.start != "imagenet":
            raise
        raise ConfigurationError(
            f"efficientnet: timm could not download ImageNet's weights ({str(error).splitlines()[0]}); "
            "connect to the internet, or start otherwise"
        ) from error
    if config.start == "lite0":
        fill_from_lite0(network)
        for name, bias in network.named_parameters():
            if name.endswith("se.conv_expand.bias"):
                nn.init.constant_(bias, _OPEN)
    return network


def _untrained(config: EfficientNetConfig) -> TwoStreams:
    return TwoStreams(replace(config, start="random"))


EFFICIENTNET_B0 = deep_spec(
    DeepRecipe("efficientnet_b0", EfficientNetConfig, TwoStreams, PictureInputs, bare=_untrained),
    title="EfficientNet-B0",
    quick={"epochs": 20, "pixels": 64},
    thesis={0.20: 67.10},
)
EFFICIENTNET_B7 = deep_spec(
    DeepRecipe("efficientnet_b7", EfficientNetB7Config, TwoStreams, PictureInputs, bare=_untrained),
    title="EfficientNet-B7",
    quick={"epochs": 2, "pixels": 64},
    thesis={0.20: 68.21},
)
