"""Pairs of detections and annotations: best first, one to one, masks alone."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.perception.coco_scoring import Collection, Truth
from punnet.perception.matching import Matching, match_masks
from punnet.scene import Strawberries
from tests.perception.annotated import SIZE, found


def match(
    truth: Strawberries, detections: Strawberries, ignored: Strawberries | None = None, score: float = 0.5
) -> Matching:
    ignored = Strawberries.empty(SIZE) if ignored is None else ignored
    return match_masks(Collection().add(Truth(truth, ignored), detections), score=score, iou=0.5)


def test_the_surest_detection_takes_the_berry() -> None:
    matching = match(found([(20, 20)]), found([(21, 20), (20, 20)], scores=[0.9, 0.8]))
    assert matching.truth_of.tolist() == [0, -1]
    assert not matching.overlooked.any()
    assert matching.found_as(1).tolist() == [0]


def test_each_takes_the_berry_it_overlaps_most() -> None:
    # Two berries 4 px apart: the detection between them lies nearer to the second.
    matching = match(found([(20, 20), (24, 20)]), found([(23, 20), (20, 20)], scores=[0.9, 0.6]))
    assert matching.truth_of.tolist() == [1, 0]
    assert matching.found_as(2).tolist() == [1, 0]


def test_class_does_not_matter_and_overlap_does() -> None:
    matching = match(found([(20, 20)]), found([(20, 20)], classes=[1]))
    assert matching.truth_of.tolist() == [0]
    # 4 of 10 px aside: IoU 60 / 140.
    assert match(found([(20, 20)]), found([(24, 20)])).truth_of.tolist() == [-1]


def test_unsure_ones_and_those_on_a_crowd_are_overlooked() -> None:
    detections = found([(5, 20), (42, 20), (60, 40)], scores=[0.3, 0.9, 0.9])
    matching = match(found([(5, 20)]), detections, ignored=found([(40, 15)], side=20))
    assert matching.truth_of.tolist() == [-1, -1, -1]
    assert matching.overlooked.tolist() == [True, True, False]


def test_nothing_found_and_nothing_there() -> None:
    none = Strawberries.empty(SIZE)
    assert match(found([(5, 20)]), none).found_as(1).tolist() == [-1]
    assert match(none, found([(5, 20)])).truth_of.tolist() == [-1]
    assert match(none, none).truth_of.shape == (0,)


corners = st.lists(st.tuples(st.integers(0, 69), st.integers(0, 49)), max_size=6)


@settings(max_examples=50, deadline=None)
@given(corners, corners, corners, st.lists(st.integers(0, 100), min_size=6, max_size=6))
def test_pairs_are_one_to_one_and_overlap_enough(
    truths: list[tuple[int, int]],
    detected: list[tuple[int, int]],
    crowd: list[tuple[int, int]],
    scores: list[int],
) -> None:
    truth = found(truths)
    detections = found(detected, scores=[s / 100 for s in scores[: len(detected)]])
    matching = match(truth, detections, found(crowd))
    pairs = [(d, t) for d, t in enumerate(matching.truth_of) if t >= 0]
    assert len({t for _, t in pairs}) == len(pairs)
    assert truth.masks is not None
    assert detections.masks is not None
    for d, t in pairs:
        one, two = detections.masks[d], truth.masks[t]
        assert (one & two).sum() >= 0.5 * (one | two).sum()
        assert detections.scores[d] >= 0.5
        assert not matching.overlooked[d]
    assert np.all(matching.overlooked[detections.scores < 0.5])
    np.testing.assert_array_equal(
        np.flatnonzero(matching.found_as(len(truth)) >= 0), sorted(t for _, t in pairs)
    )
