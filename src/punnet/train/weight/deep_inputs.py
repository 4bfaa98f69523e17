"""What the deep networks see of berries: points, or pictures of colour and depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from punnet.train.weight.augmentation import move_pictures, move_points
from punnet.train.weight.deep_config import ImageConfig, PointConfig
from punnet.train.weight.surface import rebuild_surface, sample_surface
from punnet.weight.observation import BerryObservation

__all__ = ["BerryInputs", "PictureInputs", "PointInputs", "berry_picture", "berry_points"]

_SEED = 20231
"""Of the points that stand for a berry: the same berry always gives the same points."""
_COLOUR_MEAN = np.array((0.485, 0.456, 0.406), np.float32)
_COLOUR_SPREAD = np.array((0.229, 0.224, 0.225), np.float32)
"""ImageNet's, which the pre-trained weights expect."""


class BerryInputs(Protocol):
    """The inputs of N berries."""

    def __len__(self) -> int: ...

    def draw(self, indices: NDArray[np.int64], generator: np.random.Generator) -> Tensor:
        """Inputs (B, …) of the berries at ``indices``, moved and turned at random."""
        ...

    def still(self, indices: NDArray[np.int64]) -> Tensor:
        """Inputs (B, …) of the berries at ``indices`` as they are; always the same."""
        ...


class PointInputs:
    """Points of each berry: (B, points, 4), which are x, y, z about the berry's middle, and the depth of the middle.

    The middle is the mean x and y and the median depth of its points. Coordinates are in units of ``length``; the depth
    is scaled from ``distances`` to −1 … 1, so that none of it is lost and the berry's relief is not dwarfed by it.
    """

    def __init__(self, observations: Sequence[BerryObservation], config: PointConfig) -> None:
        self.config = config
        self._pool = np.empty((len(observations), config.pool, 3), dtype=np.float32)
        self._depth = np.empty((len(observations), 1, 1), dtype=np.float32)
        near, far = config.distances
        for index, observation in enumerate(observations):
            points, middle = berry_points(observation.cloud, config)
            self._pool[index] = points
            self._depth[index] = (2.0 * middle[2] - near - far) / (far - near)

    def __len__(self) -> int:
        return len(self._pool)

    def draw(self, indices: NDArray[np.int64], generator: np.random.Generator) -> Tensor:
        """Other points of the pool each time, turned about the middle and moved across the image plane."""
        order = generator.random((len(indices), self.config.pool)).argsort(axis=1)[:, : self.config.points]
        points = self._pool[indices[:, None], order]
        settings = self.config
        moved = move_points(points, generator, shift=settings.shift, tilt=settings.tilt, roll=settings.roll)
        return self._scaled(moved, indices)

    def still(self, indices: NDArray[np.int64]) -> Tensor:
        """The first points of the pool."""
        return self._scaled(self._pool[indices, : self.config.points], indices)

    def _scaled(self, points: NDArray[np.float32], indices: NDArray[np.int64]) -> Tensor:
        depth = np.broadcast_to(self._depth[indices], (*points.shape[:2], 1))
        scaled = np.concatenate((points / np.float32(self.config.length), depth), axis=2)
        return torch.from_numpy(np.ascontiguousarray(scaled, dtype=np.float32))


def berry_points(
    cloud: NDArray[np.float64], config: PointConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """``config.pool`` points (pool, 3) of a berry about its middle, and the middle (3,) in the camera frame; metres.

    The choice depends on the cloud alone, not on the order of its points. A cloud of fewer points has some of them
    again.
    """
    generator = np.random.default_rng(_SEED)
    cloud = cloud[np.lexsort(cloud.T)]
    middle = np.array((cloud[:, 0].mean(), cloud[:, 1].mean(), np.median(cloud[:, 2])))
    if config.source == "surface":
        return sample_surface(rebuild_surface(cloud), config.pool, generator) - middle, middle
    rounds = -(-config.pool // len(cloud))
    # Whole shuffles one after the other: no point comes a second time before each has come once.
    chosen = np.concatenate([generator.permutation(len(cloud)) for _ in range(rounds)])[: config.pool]
    return cloud[chosen] - middle, middle


class PictureInputs:
    """Pictures of each berry: (B, 5, pixels, pixels): red, green, blue; depth, relief. Only the berry's pixels show."""

    def __init__(self, observations: Sequence[BerryObservation], config: ImageConfig) -> None:
        self.config = config
        self._pictures = np.empty((len(observations), 5, config.pixels, config.pixels), dtype=np.float16)
        for index, observation in enumerate(observations):
            self._pictures[index] = berry_picture(observation, config)

    def __len__(self) -> int:
        return len(self._pictures)

    def draw(self, indices: NDArray[np.int64], generator: np.random.Generator) -> Tensor:
        """Turned and moved in the image plane."""
        return move_pictures(self.still(indices), generator, shift=self.config.shift, roll=self.config.roll)

    def still(self, indices: NDArray[np.int64]) -> Tensor:
        """As the camera saw them, in the middle of the picture."""
        return torch.from_numpy(self._pictures[indices].astype(np.float32))


def berry_picture(observation: BerryObservation, config: ImageConfig) -> NDArray[np.float32]:
    """Colour and depth (5, pixels, pixels) of a berry, 0 where there is none of it.

    Channels: red, green, blue by ImageNet's mean and spread; depth over the middle of ``config.distances``; depth from
    the berry's median, in units of ``config.length``. Where there is no reading the depth is 0. The picture spans the
    same angle for every berry; one larger than that is cut off.
    """
    height, width = observation.mask.shape
    camera = observation.camera
    scale_x, scale_y = (config.pixels / (config.view * f) for f in (camera.fx, camera.fy))
    half = (config.pixels - 1) / 2
    affine = np.array(
        (
            (scale_x, 0.0, half - scale_x * (width - 1) / 2),
            (0.0, scale_y, half - scale_y * (height - 1) / 2),
        )
    )

    def seen(channel: NDArray[np.float32]) -> NDArray[np.float32]:
        warped = cv2.warpAffine(channel, affine, (config.pixels, config.pixels), flags=cv2.INTER_LINEAR)
        return np.asarray(warped, dtype=np.float32)

    mask = observation.mask.astype(np.float32)
    readings = mask * (observation.depth > 0)
    colour = (observation.rgb.astype(np.float32) / 255.0 - _COLOUR_MEAN) / _COLOUR_SPREAD
    share = seen(readings)
    depth = np.where(share > 0.5, seen(readings * observation.depth) / np.maximum(share, 0.5), 0.0)
    median = np.float32(np.median(observation.cloud[:, 2]))
    relief = np.where(share > 0.5, depth - median, 0.0) / config.length
    # Stray readings at the outline are up to decimetres off.
    relief = np.clip(relief, -2.0, 2.0)
    middle = sum(config.distances) / 2
    picture = np.concatenate(
        (seen(colour * mask[:, :, None]).transpose(2, 0, 1), (depth / middle)[None], relief[None])
    )
    return picture.astype(np.float32)
