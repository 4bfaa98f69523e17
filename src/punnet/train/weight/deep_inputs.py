"""What the deep networks see of berries: points, or pictures of colour and depth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

import cv2
import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from punnet.train.weight.augmentation import move_points
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
    """Pictures of each berry: (B, 5, pixels, pixels): red, green, blue; depth, relief. Only the berry's pixels show.

    Moved ones are drawn from the frame as the others are. To move a picture that is drawn already softens its edges: a
    network that learns from such ones weighs sharp ones too heavy.
    """

    def __init__(self, observations: Sequence[BerryObservation], config: ImageConfig) -> None:
        self.config = config
        self._observations = tuple(observations)

    def __len__(self) -> int:
        return len(self._observations)

    def draw(self, indices: NDArray[np.int64], generator: np.random.Generator) -> Tensor:
        """Turned and moved in the image plane."""
        config = self.config
        rolls = generator.uniform(-config.roll, config.roll, size=len(indices))
        shifts = generator.uniform(-config.shift, config.shift, size=(len(indices), 2))
        return self._pictures(
            berry_picture(self._observations[index], config, roll=roll, shift=shift)
            for index, roll, shift in zip(indices.tolist(), rolls.tolist(), shifts, strict=True)
        )

    def still(self, indices: NDArray[np.int64]) -> Tensor:
        """As the camera saw them, in the middle of the picture."""
        return self._pictures(
            berry_picture(self._observations[index], self.config) for index in indices.tolist()
        )

    def _pictures(self, drawn: Iterable[NDArray[np.float32]]) -> Tensor:
        shape = 5, self.config.pixels, self.config.pixels
        return torch.from_numpy(np.array(list(drawn), dtype=np.float32).reshape(-1, *shape))


def berry_picture(
    observation: BerryObservation, config: ImageConfig, *, roll: float = 0.0, shift: ArrayLike = (0.0, 0.0)
) -> NDArray[np.float32]:
    """Colour and depth (5, pixels, pixels) of a berry, 0 where there is none of it.

    Channels: red, green, blue by ImageNet's mean and spread; depth over the middle of ``config.distances``; depth from
    the berry's median, in units of ``config.length``. Where there is no reading the depth is 0. The picture spans the
    same angle for every berry; one larger than that is cut off.

    Parameters
    ----------
    observation, config
        What is drawn, and how.
    roll
        Degrees by which it is turned about the middle of the picture, from x to y.
    shift
        (2,) shares of the side by which it is then moved along x and y.
    """
    height, width = observation.mask.shape
    camera = observation.camera
    angle, half = np.deg2rad(roll), (config.pixels - 1) / 2
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    affine = np.empty((2, 3))
    affine[:, :2] = turn * (config.pixels / (config.view * np.array((camera.fx, camera.fy))))
    affine[:, 2] = (
        half + config.pixels * np.asarray(shift) - affine[:, :2] @ ((width - 1) / 2, (height - 1) / 2)
    )

    def seen(channels: NDArray[np.float32]) -> NDArray[np.float32]:
        warped = cv2.warpAffine(channels, affine, (config.pixels, config.pixels), flags=cv2.INTER_LINEAR)
        return np.asarray(warped, dtype=np.float32)

    mask = observation.mask.astype(np.float32)
    readings = mask * (observation.depth > 0)
    colour = seen(
        (observation.rgb.astype(np.float32) / 255.0 - _COLOUR_MEAN) / _COLOUR_SPREAD * mask[:, :, None]
    )
    share, depth = cv2.split(seen(np.dstack((readings, readings * observation.depth)).astype(np.float32)))
    depth = np.where(share > 0.5, depth / np.maximum(share, 0.5), 0.0)
    median = np.float32(np.median(observation.cloud[:, 2]))
    # Stray readings at the outline are up to decimetres off.
    relief = np.clip(np.where(share > 0.5, depth - median, 0.0) / config.length, -2.0, 2.0)
    middle = sum(config.distances) / 2
    picture = np.concatenate((colour.transpose(2, 0, 1), (depth / middle)[None], relief[None]))
    return picture.astype(np.float32)
