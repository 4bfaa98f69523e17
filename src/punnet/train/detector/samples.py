"""Labelled sets into training samples: drawn with weights, each draw a function of the seed and its number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset as TorchDataset
from torch.utils.data import Sampler

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.data.formats import read_dataset
from punnet.errors import ConfigurationError
from punnet.scene import KEYPOINTS, Visibility, read_image
from punnet.train.detector.augmentation import Labels, change_light, random_view
from punnet.train.detector.config import DetectorTraining, Source

__all__ = ["Draws", "OpenSource", "Samples", "collate", "labels_of", "open_sources", "to_targets"]


@dataclass(frozen=True)
class OpenSource:
    """A source whose annotations have been read.

    Parameters
    ----------
    source, images
        What to draw, and from what.
    tells_what_hides
        Whether the set tells berries' own fruit from other things that hide a key-point. A set that never says
        "hidden by something else" is taken not to.
    """

    source: Source
    images: Dataset
    tells_what_hides: bool = field(default=True)


def open_sources(sources: Sequence[Source]) -> list[OpenSource]:
    """Read the annotations of all sources.

    Raises
    ------
    ConfigurationError
        If there is no source, or one has no image, or lacks one that was named.
    """
    if not sources:
        raise ConfigurationError("training needs at least one labelled set; give --data")
    opened = []
    for source in sources:
        images = read_dataset(source.path)
        if source.images is not None:
            places: dict[str | int, int] = {image.path.name: k for k, image in enumerate(images)}
            places |= {image.id: k for k, image in enumerate(images)}
            if missing := [name for name in source.images if name not in places]:
                raise ConfigurationError(
                    f"{source.path}: no image {missing[0]} ({len(missing)} of {len(source.images)} missing)"
                )
            images = images.subset([places[name] for name in source.images])
        if not len(images):
            raise ConfigurationError(f"{source.path}: no image in this set")
        codes = {
            int(c) for i in images for a in i.annotations if a.visibility is not None for c in a.visibility
        }
        opened.append(OpenSource(source, images, Visibility.HIDDEN_BY_OTHER in codes))
    return opened


def labels_of(
    image: AnnotatedImage, *, tells_what_hides: bool = True, ignored_stages: Sequence[str] = ()
) -> Labels:
    """The annotations of an image as arrays; crowds, and berries of the stages given, become ignored areas."""
    left_out = [a.crowd or a.stage in ignored_stages for a in image.annotations]
    annotations = [a for a, out in zip(image.annotations, left_out, strict=True) if not out]
    masks = np.zeros((len(annotations), image.height, image.width), dtype=np.uint8)
    has_mask = np.zeros(len(annotations), dtype=np.bool_)
    for row, mask in enumerate(image.masks(annotations)):
        if mask is not None and mask.any():
            masks[row], has_mask[row] = mask, True
    n = len(annotations)
    points = np.full((n, len(KEYPOINTS), 2), np.nan)
    allowed = np.ones((n, len(KEYPOINTS), len(Visibility)), dtype=np.bool_)
    for row, annotation in enumerate(annotations):
        if annotation.keypoints is not None:
            points[row] = annotation.keypoints
            allowed[row] = _allowed(annotation, tells_what_hides=tells_what_hides)
    return Labels(
        boxes=np.array([a.box for a in annotations], dtype=np.float64).reshape(n, 4),
        classes=np.array([a.class_index for a in annotations], dtype=np.int64),
        masks=masks,
        has_mask=has_mask,
        keypoints=points,
        allowed=allowed,
        ripeness=np.array([a.ripeness for a in annotations], dtype=np.float64),
        ignored=np.array(
            [a.box for a, out in zip(image.annotations, left_out, strict=True) if out], dtype=np.float64
        ).reshape(-1, 4),
    )


def _allowed(annotation: Annotation, *, tells_what_hides: bool) -> NDArray[np.bool_]:
    """(5, 4) codes that a key-point may have, by what its annotator could tell."""
    assert annotation.visibility is not None
    allowed = np.eye(len(Visibility), dtype=np.bool_)[annotation.visibility]
    if not tells_what_hides:
        hidden = np.equal(annotation.visibility, Visibility.HIDDEN_BY_ITSELF)
        allowed[hidden, Visibility.HIDDEN_BY_OTHER] = True
        allowed[np.equal(annotation.visibility, Visibility.ABSENT)] = True
    return allowed


def to_targets(labels: Labels) -> dict[str, Tensor]:
    """Labels as the network's targets."""
    known = np.asarray(np.isfinite(labels.keypoints).all(axis=2))
    points = np.concatenate((np.where(known[..., None], labels.keypoints, 0.0), known[..., None]), axis=2)
    return {
        "boxes": torch.from_numpy(labels.boxes).float(),
        "labels": torch.from_numpy(labels.classes) + 1,
        "masks": torch.from_numpy(labels.masks),
        "has_mask": torch.from_numpy(labels.has_mask),
        "keypoints": torch.from_numpy(points).float(),
        "visibility": torch.from_numpy(labels.allowed),
        "ripeness": torch.from_numpy(labels.ripeness).float(),
        "ignored": torch.from_numpy(labels.ignored).float(),
    }


class Samples(TorchDataset[tuple[Tensor, dict[str, Tensor]]]):
    """Endless samples: number ``i`` is the same whoever asks, whenever."""

    def __init__(self, sources: Sequence[OpenSource], training: DetectorTraining) -> None:
        self.sources = list(sources)
        self.training = training
        weights = np.array([s.source.weight for s in self.sources], dtype=np.float64)
        self.shares = weights / weights.sum()

    def __getitem__(self, index: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Image (3, H, W) uint8 and targets of draw ``index``."""
        rng = np.random.default_rng([self.training.seed, index])
        opened = self.sources[int(rng.choice(len(self.sources), p=self.shares))]
        image = opened.images[int(rng.integers(len(opened.images)))]
        labels = labels_of(
            image, tells_what_hides=opened.tells_what_hides, ignored_stages=opened.source.ignored
        )
        pixels, labels = random_view(
            rng, read_image(image.path), labels, self.training.crop, opened.source.scale
        )
        pixels = change_light(rng, pixels, self.training.light)
        return torch.from_numpy(pixels.transpose(2, 0, 1).copy()), to_targets(labels)


class Draws(Sampler[int]):
    """The numbers of an epoch's draws; the next epoch's follow, so that a resumed run draws what it would have drawn.

    An epoch lasts from one validation to the next; the last one is as short as the steps of the training leave it.
    """

    def __init__(self, training: DetectorTraining, rank: int = 0, world: int = 1) -> None:
        self.training, self.rank, self.world = training, rank, world
        self.epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Lightning tells which epoch comes."""
        self.epoch = epoch

    def __len__(self) -> int:
        left = self.training.steps - self.epoch * self.training.validate_every
        return self.training.batch * max(min(left, self.training.validate_every), 0)

    def __iter__(self) -> Iterator[int]:
        first = self.epoch * self.training.validate_every * self.training.batch * self.world
        return iter(range(first + self.rank, first + len(self) * self.world, self.world))


def collate(
    items: list[tuple[Tensor, dict[str, Tensor]]],
) -> tuple[Tensor, list[dict[str, Tensor]]]:
    """Images of one size stacked; targets as a list."""
    return torch.stack([image for image, _ in items]), [target for _, target in items]
