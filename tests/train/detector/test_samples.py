"""What is drawn from labelled sets, and what partial labels become."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from punnet.data.coco import read_coco  # noqa: E402
from punnet.data.dataset import AnnotatedImage  # noqa: E402
from punnet.errors import ConfigurationError, FileFormatError  # noqa: E402
from punnet.scene import Visibility  # noqa: E402
from punnet.train.detector.config import Source  # noqa: E402
from punnet.train.detector.samples import (  # noqa: E402
    Draws,
    Samples,
    collate,
    labels_of,
    open_sources,
    to_targets,
)
from tests.train.detector.berries import SIZE, draw_scene, small_training, write_set  # noqa: E402


@pytest.fixture
def image(tmp_path: Path) -> AnnotatedImage:
    _, drawn = draw_scene(np.random.default_rng(2), 1, berries=3)
    return AnnotatedImage(1, tmp_path / "1.png", SIZE[1], SIZE[0], tuple(drawn))


def test_partial_labels_are_marked(image: AnnotatedImage) -> None:
    whole, no_mask, box_only = image.annotations
    no_mask = replace(no_mask, segmentation=None)
    box_only = replace(
        box_only, segmentation=None, keypoints=None, visibility=None, ripeness=np.nan, class_index=1
    )
    labels = labels_of(replace(image, annotations=(whole, no_mask, box_only)))
    assert labels.has_mask.tolist() == [True, False, False]
    assert labels.masks.reshape(3, -1).any(axis=1).tolist() == [True, False, False]
    assert np.isfinite(labels.keypoints).all(axis=(1, 2)).tolist() == [True, True, False]
    assert labels.allowed.sum(axis=2).tolist() == [[1] * 5, [1] * 5, [4] * 5]
    assert np.isnan(labels.ripeness).tolist() == [False, False, True]
    targets = to_targets(labels)
    assert targets["labels"].tolist()[2] == 2
    assert targets["keypoints"][..., 2].tolist() == [[1] * 5, [1] * 5, [0] * 5]
    assert not targets["keypoints"].isnan().any()


def test_a_crowd_is_ignored(image: AnnotatedImage) -> None:
    first, *others = image.annotations
    labels = labels_of(replace(image, annotations=(replace(first, crowd=True), *others)))
    assert len(labels) == 2
    np.testing.assert_array_equal(labels.ignored, first.box[None])


def test_berries_of_stages_that_are_left_out_are_ignored(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", images=4)
    everything = open_sources([Source(folder)])[0]
    stages = {a.stage for image in everything.images for a in image.annotations}
    assert stages == {"ripe", "green"}
    training = small_training(crop=(96, 128))
    whole = Source(folder, scale=(1.0, 1.0))
    taught = Samples(open_sources([whole]), training)
    partly = Samples(open_sources([replace(whole, ignored=("green",))]), training)
    ripe = 0
    for k in range(12):
        (image, targets), (again, fewer) = taught[k], partly[k]
        if torch.equal(image, again):  # what is left in view decides where the crop lies
            green = int((targets["labels"] == 2).sum())
            assert (fewer["labels"] == 1).all()
            assert len(fewer["boxes"]) == len(targets["boxes"]) - green
            assert len(fewer["ignored"]) == len(targets["ignored"]) + green
        ripe += len(fewer["boxes"])
        assert not (fewer["labels"] == 2).any()
    assert ripe > 0


def test_hidden_may_be_hidden_by_anything_where_the_set_does_not_tell(image: AnnotatedImage) -> None:
    codes = np.array([0, 1, 2, 2, 2])
    first = image.annotations[0]
    assert first.keypoints is not None
    points = np.where((codes == Visibility.ABSENT)[:, None], np.nan, first.keypoints)
    one = replace(image, annotations=(replace(first, keypoints=points, visibility=codes),))
    told = labels_of(one).allowed[0]
    assert told.tolist() == np.eye(4, dtype=bool)[codes].tolist()
    untold = labels_of(one, tells_what_hides=False).allowed[0]
    assert untold[0].tolist() == [True] * 4
    assert untold[1].tolist() == [False, True, False, True]
    assert untold[2].tolist() == [False, False, True, False]


def test_a_sample_is_the_same_whoever_asks_whenever(tmp_path: Path) -> None:
    sources = open_sources([Source(write_set(tmp_path / "set", images=3))])
    one, other = Samples(sources, small_training()), Samples(sources, small_training())
    other[5]
    for (image, targets), (again, as_before) in ((one[k], other[k]) for k in (7, 0, 3)):
        assert torch.equal(image, again)
        assert image.shape == (3, 64, 96)
        assert all(torch.equal(targets[name], as_before[name]) for name in targets)
    assert not torch.equal(one[0][0], one[1][0])
    assert not torch.equal(one[0][0], Samples(sources, small_training(seed=1))[0][0])
    images, targets_of_all = collate([one[0], one[1]])
    assert images.shape == (2, 3, 64, 96)
    assert len(targets_of_all) == 2


def test_sources_are_drawn_by_weight(tmp_path: Path) -> None:
    many = Source(write_set(tmp_path / "many", images=4), weight=1.0)
    few = Source(write_set(tmp_path / "few", images=1, berries=0), weight=3.0)
    samples = Samples(open_sources([many, few]), small_training())
    empty = sum(not len(samples[k][1]["boxes"]) for k in range(200))
    assert 125 < empty < 185


def test_draws_go_on_where_the_epoch_ended_and_no_two_processes_share_one() -> None:
    training = small_training(steps=4, validate_every=2, batch=3)
    alone = Draws(training)
    assert list(alone) == [0, 1, 2, 3, 4, 5]
    alone.set_epoch(1)
    assert list(alone) == [6, 7, 8, 9, 10, 11]
    drawn = []
    for epoch in (0, 1):
        for rank in (0, 1):
            draws = Draws(training, rank, 2)
            draws.set_epoch(epoch)
            assert len(list(draws)) == len(draws) == 6
            drawn += list(draws)
    assert sorted(drawn) == list(range(24))


def test_the_last_epoch_is_as_short_as_the_steps_leave_it() -> None:
    draws = Draws(small_training(steps=5, validate_every=2, batch=3))
    drawn = []
    for epoch in range(4):
        draws.set_epoch(epoch)
        assert len(list(draws)) == len(draws) == (6, 6, 3, 0)[epoch]
        drawn += list(draws)
    assert drawn == list(range(15))


def test_only_the_listed_images(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", images=4)
    opened = open_sources([Source(folder, images=("2.png", "0.png", 4))])[0]
    assert [image.path.name for image in opened.images] == ["2.png", "0.png", "3.png"]
    with pytest.raises(ConfigurationError, match=r"no image 9.png \(1 of 2 missing\)"):
        open_sources([Source(folder, images=("9.png", "0.png"))])


def test_whether_a_set_tells_what_hides_is_read_off_it(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    assert not open_sources([Source(folder)])[0].tells_what_hides
    file = folder / "annotations.json"
    assert read_coco(file)[0].annotations[0].visibility is not None
    text = file.read_text()
    file.write_text(
        text.replace('"visibility_detail": [2, 2, 2, 2, 2]', '"visibility_detail": [2, 3, 2, 2, 2]', 1)
        if '"visibility_detail": [2, 2, 2, 2, 2]' in text
        else text.replace('"visibility_detail":[2,2,2,2,2]', '"visibility_detail":[2,3,2,2,2]', 1)
    )
    assert open_sources([Source(folder)])[0].tells_what_hides


def test_no_sets_and_empty_sets_are_faults(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="--data"):
        open_sources([])
    with pytest.raises(FileFormatError, match="no such file or folder"):
        open_sources([Source(tmp_path / "nowhere")])
    empty = write_set(tmp_path / "empty", images=0)
    with pytest.raises(ConfigurationError, match="no image in this set"):
        open_sources([Source(empty)])
