"""Feature extractors, each a stack of maps from fine to coarse under one interface."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import torch
from torch import Tensor, nn
from torchvision.models import mobilenet_v3_large, resnet50, resnext101_32x8d
from torchvision.models._utils import IntermediateLayerGetter
from torchvision.ops import FeaturePyramidNetwork

from punnet.train.detector.config import SLIM, DetectorConfig
from punnet.train.imagenet import fill_from_lite0

__all__ = ["Trunk", "build_trunk"]

LEVELS = ("p2", "p3", "p4", "p5")
IMAGENET_MEAN = (123.675, 116.28, 103.53)
IMAGENET_STD = (58.395, 57.12, 57.375)
RESIDUAL_STEM = ("conv1", "bn1", "layer1")


class WideDepthwise(nn.Conv2d):
    """A depthwise convolution that is trained in single precision, whatever the rest is.

    On CPUs a 5 × 5 one takes four times as long backwards in bfloat16, which then was more than half of a step.
    """

    def forward(self, maps: Tensor) -> Tensor:
        """Maps (B, C, H, W) to maps."""
        device = maps.device.type
        if device != "cpu" or not torch.is_autocast_enabled(device):
            return super().forward(maps)
        with torch.autocast(device, enabled=False):
            return super().forward(maps.float())


class Trunk(nn.Module):
    """Backbone with or without a feature pyramid.

    Attributes
    ----------
    channels
        Of every map.
    levels
        Names of the maps, fine to coarse.
    finer
        Channels by name of the maps finer than the pyramid's: ``image`` and ``fine``, of stride 1 and 2; or none.
    stem
        Names of the body's first stages, which stay as ImageNet left them: up to stride 4.
    mean, std
        (1, 3, 1, 1) of the input, in 0…255, that the backbone expects.
    """

    mean: Tensor
    std: Tensor

    def __init__(
        self,
        body: nn.Module,
        pyramid: FeaturePyramidNetwork | None,
        channels: int,
        levels: tuple[str, ...],
        finer: dict[str, int],
        stem: tuple[str, ...],
        mean: tuple[float, float, float],
        std: tuple[float, float, float],
    ) -> None:
        super().__init__()
        self.body = body
        self.pyramid = pyramid
        self.channels = channels
        self.levels = levels
        self.finer = finer
        self.stem = stem
        self.register_buffer("mean", torch.tensor(mean).reshape(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(std).reshape(1, 3, 1, 1), persistent=False)

    def freeze_stem(self) -> None:
        """Leave the first stages out of training: edges and colours need no berries to be learned."""
        for name, parameter in self.body.named_parameters():
            if name.startswith(tuple(f"{stage}." for stage in self.stem)):
                parameter.requires_grad_(False)

    def forward(self, images: Tensor) -> OrderedDict[str, Tensor]:
        """Maps by name of images (B, 3, H, W) in 0…255: the levels, and the finer ones if there are any."""
        pixels = (images - self.mean) / self.std
        found = self.body(pixels)
        maps = list(found.values() if isinstance(found, dict) else found)
        finer = OrderedDict(image=pixels, fine=maps.pop(0)) if self.finer else OrderedDict[str, Tensor]()
        named = OrderedDict(zip(self.levels, maps, strict=True))
        return (named if self.pyramid is None else self.pyramid(named)) | finer


def build_trunk(config: DetectorConfig) -> Trunk:
    """The trunk of a config, from ImageNet if it says so."""
    name = config.backbone
    if name in SLIM:
        trunk = _lite0(config) if name == "efficientnet_lite0_fpn" else _mobilenet(config)
        _train_wide_depthwise_exactly(trunk.body)
        return trunk
    residual = resnet50 if name == "resnet50_fpn" else resnext101_32x8d
    network = residual(weights="DEFAULT" if config.pretrained else None)
    finer = _finer(config, 64)
    stages = {"relu": "fine"} if finer else {}
    if name == "resnext101_32x8d_c4":
        body = IntermediateLayerGetter(network, stages | {"layer3": "c4"})
        return Trunk(body, None, 1024, ("c4",), finer, RESIDUAL_STEM, IMAGENET_MEAN, IMAGENET_STD)
    body = IntermediateLayerGetter(network, stages | {f"layer{k}": f"p{k + 1}" for k in range(1, 5)})
    pyramid = FeaturePyramidNetwork([256, 512, 1024, 2048], config.channels)
    return Trunk(body, pyramid, config.channels, LEVELS, finer, RESIDUAL_STEM, IMAGENET_MEAN, IMAGENET_STD)


def _train_wide_depthwise_exactly(body: nn.Module) -> None:
    for module in body.modules():
        if type(module) is nn.Conv2d and module.kernel_size == (5, 5) and module.groups > 1:
            module.__class__ = WideDepthwise  # the same weights under the same names


def _finer(config: DetectorConfig, channels: int) -> dict[str, int]:
    """The finer maps of a body whose map of stride 2 has so many channels."""
    return {"image": 3, "fine": channels} if config.fine_channels else {}


def _lite0(config: DetectorConfig) -> Trunk:
    import timm

    finer = _finer(config, 16)
    body: Any = timm.create_model(
        "efficientnet_lite0",
        features_only=True,
        out_indices=(0, 1, 2, 3, 4) if finer else (1, 2, 3, 4),
        bn_eps=1e-3,
        pretrained=False,
    )
    if config.pretrained:
        fill_from_lite0(body)
    pyramid = FeaturePyramidNetwork(body.feature_info.channels()[-4:], config.channels)
    middle = (127.0, 127.0, 127.0)
    stem = ("conv_stem", "bn1", "blocks.0", "blocks.1")
    return Trunk(body, pyramid, config.channels, LEVELS, finer, stem, middle, (128.0, 128.0, 128.0))


def _mobilenet(config: DetectorConfig) -> Trunk:
    network = mobilenet_v3_large(weights="DEFAULT" if config.pretrained else None)
    finer = _finer(config, 16)
    # The last layers before each halving: strides 2 (if finer maps are asked for), 4, 8, 16, 32.
    stages = ({"1": "fine"} if finer else {}) | {"3": "p2", "6": "p3", "12": "p4", "15": "p5"}
    body = IntermediateLayerGetter(network.features, stages)
    pyramid = FeaturePyramidNetwork([24, 40, 112, 160], config.channels)
    stem = ("0", "1", "2", "3")
    return Trunk(body, pyramid, config.channels, LEVELS, finer, stem, IMAGENET_MEAN, IMAGENET_STD)
