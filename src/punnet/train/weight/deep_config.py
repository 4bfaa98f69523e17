"""Settings that all deep weight estimators share; each model's own config adds its widths to these."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, get_args

from punnet.errors import ConfigurationError

__all__ = ["DeepConfig", "ImageConfig", "PointConfig", "PointSource", "Start"]

PointSource = Literal["cloud", "surface"]
Start = Literal["random", "lite0", "imagenet"]


@dataclass(frozen=True)
class DeepConfig:
    """How a network is trained.

    Parameters
    ----------
    epochs
        At most so many passes over the berries; the learning rate descends over them, as a cosine, to a hundredth.
    batch
        Berries a step.
    learning_rate
        Adam's (thesis section 4.3.2: 0.001), after ``warm_up`` steps of linear rise.
    warm_up
        Steps; at most a tenth of all.
    patience
        Epochs without a lower validation loss after which training ends early; 0 for never.
    tolerance
        Relative error at which the loss turns from square to linear (smooth L1 of the relative error).
    settled
        Share of the steps after which batch normalisation keeps the statistics that it has, in training as in use; 1 for never.
    dropout
        In the last layers.
    distances
        Metres; depths between these two are scaled to −1 … 1.
    length
        Metres that are one unit of the coordinates within the berry.
    """

    epochs: int = 60
    batch: int = 16
    learning_rate: float = 1e-3
    warm_up: int = 100
    patience: int = 20
    tolerance: float = 0.1
    settled: float = 1.0
    dropout: float = 0.2
    distances: tuple[float, float] = (0.15, 0.65)
    length: float = 0.02

    def __post_init__(self) -> None:
        _require_numbers(self)
        if not 0 <= self.dropout < 1:
            raise ConfigurationError(f"deep model: dropout must lie in [0, 1), got {self.dropout}")
        if self.settled > 1:
            raise ConfigurationError(f"deep model: settled must lie in [0, 1], got {self.settled}")
        if len(self.distances) != 2 or not 0 < self.distances[0] < self.distances[1] < math.inf:
            raise ConfigurationError(
                f"deep model: distances must be two lengths with 0 < near < far, got {self.distances}"
            )


@dataclass(frozen=True)
class PointConfig(DeepConfig):
    """What networks on points see, and how it is varied.

    Parameters
    ----------
    points
        Of each berry.
    pool
        Points kept of each berry, from which every epoch draws its ``points``.
    source
        ``cloud``: the depth points themselves; ``surface``: points of the rebuilt surface.
    shift
        Metres: berries are moved across the image plane, in x and y, by up to so much.
    tilt, roll
        Degrees: berries are turned about their middle, by up to so much about the axes x and y, and about z.
    """

    points: int = 512
    pool: int = 2048
    source: PointSource = "cloud"
    shift: float = 0.005
    tilt: float = 10.0
    roll: float = 30.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.source not in get_args(PointSource):
            raise ConfigurationError(f"deep model: source must be cloud or surface, got {self.source!r}")
        if self.points < 8 or self.pool < self.points:
            raise ConfigurationError(
                f"deep model: need at least 8 points and a pool of no fewer, got {self.points} and {self.pool}"
            )


@dataclass(frozen=True)
class ImageConfig(DeepConfig):
    """What networks on images see, and how it is varied.

    Parameters
    ----------
    settled
        As above. Where maps are small, the statistics of a batch are so unlike those of use that a network which learnt with
        the former alone is biased.
    pixels
        Side of the square picture of a berry.
    view
        Tangent of the angle that the picture spans, the same for every berry and camera: a berry's size in the
        picture is its apparent size.
    shift
        Share of the picture by which berries are moved, up to so much.
    roll
        Degrees by which they are turned in the image plane, up to so much.
    start
        ``random``; ``lite0``: EfficientNet-Lite0's ImageNet weights in the layers that it shares with ``b0``; ``imagenet``:
        the variant's own, which timm downloads (needs the internet).
    """

    settled: float = 0.5
    pixels: int = 96
    view: float = 0.3
    shift: float = 0.06
    roll: float = 30.0
    start: Start = "random"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.pixels < 32:
            raise ConfigurationError(f"deep model: pixels must be at least 32, got {self.pixels}")
        if self.start not in get_args(Start):
            raise ConfigurationError(
                f"deep model: start must be one of {', '.join(get_args(Start))}, got {self.start!r}"
            )


def _require_numbers(config: DeepConfig) -> None:
    """Every number is positive; those that may be 0 are named."""
    may_be_zero = {"settled", "warm_up", "patience", "dropout", "depth_dropout", "shift", "tilt", "roll"}
    for item in dataclasses.fields(config):
        value = getattr(config, item.name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        if not (value >= 0 if item.name in may_be_zero else value > 0) or not math.isfinite(value):
            rule = "at least 0" if item.name in may_be_zero else "positive"
            raise ConfigurationError(f"deep model: {item.name} must be {rule}, got {value}")
