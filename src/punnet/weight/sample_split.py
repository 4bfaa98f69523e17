"""Weighed berries parted by plant, the same way everywhere: learnt from, validated on, set aside for tests."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

from punnet.data.dataset import Dataset
from punnet.errors import ConfigurationError
from punnet.weight.samples import WeightSamples, plant_of

__all__ = [
    "PARTS",
    "TEST_SHARE",
    "VALIDATION_SHARE",
    "WeightSplit",
    "images_of_part",
    "part_of",
    "split_groups",
]

TEST_SHARE, VALIDATION_SHARE = 0.2, 0.1
"""Of the plants, on average; the same everywhere, so that no model is tested on a plant that another has learnt from."""

PARTS = ("test", "validation", "train", "all")


@dataclass(frozen=True, eq=False)
class WeightSplit:
    """Three parts that share no plant."""

    train: WeightSamples
    validation: WeightSamples
    test: WeightSamples


def split_groups(
    samples: WeightSamples,
    *,
    test: float = TEST_SHARE,
    validation: float = VALIDATION_SHARE,
    seed: int = 0,
) -> WeightSplit:
    """Part samples by plant.

    Where a plant goes is told by its name and ``seed`` alone: it stays there whatever else is in the set, whichever
    masks it is seen through, and however many of its berries were refused. Shares are met on average.

    Raises
    ------
    ConfigurationError
        If the shares leave nothing to train on, or a part is empty.
    """
    if not (test >= 0 and validation >= 0 and test + validation < 1):
        raise ConfigurationError(
            f"split: test and validation must be shares that leave some to train on, got {test}, {validation}"
        )
    bounds = _bounds(test, validation)
    parts = {name: _between(samples, seed, *limits) for name, limits in bounds.items()}
    if empty := [name for name, (low, high) in bounds.items() if high > low and not len(parts[name])]:
        raise ConfigurationError(
            f"split: {len(set(samples.groups))} plants are too few, nothing is left for {', '.join(empty)}; "
            "give more images"
        )
    return WeightSplit(**parts)


def part_of(samples: WeightSamples, part: str) -> WeightSamples:
    """One of :data:`PARTS`: the plants that trainings set aside, those they choose settings by, those they learn from.

    Raises
    ------
    ConfigurationError
        If there is no such part, or nothing in it.
    """
    _require_part(part)
    if part == "all":
        return samples
    chosen = _between(samples, 0, *_bounds(TEST_SHARE, VALIDATION_SHARE)[part])
    if not len(chosen):
        raise ConfigurationError(
            f"split: none of {len(set(samples.groups))} plants are in part '{part}'; give more images"
        )
    return chosen


def images_of_part(dataset: Dataset, part: str) -> Dataset:
    """The images whose plants are in a part, so that no others need be looked at.

    Raises
    ------
    ConfigurationError
        If there is no such part.
    """
    _require_part(part)
    if part == "all":
        return dataset
    low, high = _bounds(TEST_SHARE, VALIDATION_SHARE)[part]
    places = [_place(plant_of(image), 0) for image in dataset]
    return dataset.subset(index for index, place in enumerate(places) if low <= place < high)


def _require_part(part: str) -> None:
    if part not in PARTS:
        raise ConfigurationError(f"no part '{part}' of a data set; there are {', '.join(PARTS)}")


def _bounds(test: float, validation: float) -> dict[str, tuple[float, float]]:
    return {"test": (0.0, test), "validation": (test, test + validation), "train": (test + validation, 1.0)}


def _between(samples: WeightSamples, seed: int, low: float, high: float) -> WeightSamples:
    """Samples and missed berries of the plants whose place is in [low, high)."""
    chosen = [i for i, group in enumerate(samples.groups) if low <= _place(group, seed) < high]
    missed = tuple(berry for berry in samples.missed if low <= _place(berry.group, seed) < high)
    return replace(samples.subset(chosen), missed=missed)


def _place(group: str, seed: int) -> float:
    """A number in [0, 1), even over groups."""
    return int.from_bytes(hashlib.sha256(f"{seed}:{group}".encode()).digest()[:8], "big") / 2.0**64
