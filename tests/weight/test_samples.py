"""Berries of known weight as samples: which are taken, what is missed, and through whose masks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.data.dataset import Dataset
from punnet.errors import ConfigurationError, ShapeError
from punnet.scene import Frame, Strawberries
from punnet.weight.samples import NOT_FOUND, WeightSamples, collect_samples, join_samples
from tests.weight.weighed import weighed_dataset, weighed_image


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return weighed_dataset(tmp_path_factory.mktemp("weighed"), [0.014, 0.016, 0.018])


class Seeing:
    """A detector that sees the annotated berries of these radii as balls, and one that is not there."""

    name = "seeing"

    def __init__(self, *masks: np.ndarray) -> None:
        self.masks = masks

    def detect(self, frame: Frame) -> Strawberries:
        masks = np.stack(self.masks)
        boxes = np.array([[0.0, 0.0, 10.0, 10.0]] * len(masks))
        scores = np.linspace(0.9, 0.5, len(masks))
        return Strawberries(masks.shape[1:], boxes, scores, masks=masks, ripeness=np.full(len(masks), 0.7))


def test_a_sample_is_what_the_image_shows_with_its_label(dataset: Dataset) -> None:
    calls: list[int] = []
    samples = collect_samples(dataset, progress=lambda: calls.append(1))
    assert len(samples) == len(calls) == 3
    assert samples.groups == ("plant-1", "plant-2", "plant-3")
    assert samples.image.tolist() == samples.annotation.tolist() == [1, 2, 3]
    np.testing.assert_allclose(samples.grams, [a.weight for image in dataset for a in image.annotations])
    assert (
        (samples.distance > 0.27) & (samples.distance < 0.3)
    ).all()  # the surface is nearer than the middle
    assert (np.diff([len(seen.cloud) for seen in samples.observations]) > 0).all()
    assert all(seen.rgb.base is None for seen in samples.observations), "a crop must not hold the whole image"
    assert samples.refused == {}
    assert samples.skipped == ()


@pytest.mark.parametrize("change", [{"crowd": True}, {"class_index": 1}, {"weight": float("nan")}], ids=str)
def test_crowd_unripe_and_unweighed_berries_are_no_samples(tmp_path: Path, change: dict[str, object]) -> None:
    image = weighed_image(tmp_path, 1, radius=0.015, group="a", **change)
    samples = collect_samples(Dataset((image,)))
    assert len(samples) == 0
    assert samples.missed == ()


def test_a_berry_that_cannot_be_observed_is_missed_with_its_weight(tmp_path: Path) -> None:
    image = weighed_image(tmp_path, 1, radius=0.015, group="a")
    samples = collect_samples(
        Dataset((replace(image, depth_path=None), replace(image, id=2, annotations=())))
    )
    assert len(samples) == 0
    (missed,) = samples.missed
    assert (missed.grams, missed.group, missed.image) == (image.annotations[0].weight, "a", 1)
    assert samples.refused == {"the frame has no depth": 1}


def test_an_image_that_cannot_be_read_is_skipped_and_named(dataset: Dataset, tmp_path: Path) -> None:
    broken = replace(
        dataset[0], id=9, path=tmp_path / "none.png", annotations=(replace(dataset[0].annotations[0], id=9),)
    )
    samples = collect_samples(replace(dataset, images=(*dataset.images, broken)))
    assert len(samples) == 3
    (line,) = samples.skipped
    assert "none.png" in line


def test_a_detectors_masks_are_matched_and_what_it_misses_counts(dataset: Dataset) -> None:
    mask = dataset[0].mask(0)
    assert mask is not None
    elsewhere = np.roll(mask, 90, axis=1)
    shrunk = mask.copy()
    shrunk[:, : np.flatnonzero(mask.any(axis=0))[3]] = False
    through = collect_samples(dataset.subset([0]), detector=Seeing(elsewhere, shrunk))
    assert len(through) == 1
    assert through.observations[0].ripeness == pytest.approx(0.7)
    assert through.observations[0].mask.sum() < mask.sum()
    blind = collect_samples(dataset, detector=Seeing(elsewhere))
    assert len(blind) == 0
    assert blind.refused == {NOT_FOUND: 3}


def test_joining_and_choosing_keep_rows_together(dataset: Dataset) -> None:
    samples = collect_samples(dataset)
    joined = join_samples([samples, samples.subset([2])])
    assert joined.grams.tolist() == [*samples.grams, samples.grams[2]]
    assert joined.groups[3] == "plant-3"
    assert joined.subset([3, 0]).annotation.tolist() == [3, 1]
    with pytest.raises(ConfigurationError, match="nothing to join"):
        join_samples([])


def test_fields_of_other_lengths_are_refused(dataset: Dataset) -> None:
    samples = collect_samples(dataset)
    with pytest.raises(ShapeError, match="differ in length"):
        replace(samples, grams=samples.grams[:2])
    assert isinstance(samples, WeightSamples)
