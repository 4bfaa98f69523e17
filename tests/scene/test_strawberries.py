import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from punnet.errors import FileFormatError, ShapeError
from punnet.scene import Strawberries, Target
from punnet.scene.masks import decode_mask, encode_mask, run_lengths


def some_berries(rng, n=4, size=(20, 30)):
    corners = rng.uniform(0, 10, (n, 2))
    return Strawberries(
        image_size=size,
        boxes=np.concatenate((corners, corners + rng.uniform(1, 9, (n, 2))), axis=1),
        scores=rng.uniform(size=n),
        classes=rng.integers(0, 2, n),
        masks=rng.random((n, *size)) > 0.5,
        keypoints=rng.uniform(0, 20, (n, 5, 2)),
        visibility=rng.integers(0, 4, (n, 5)),
        ripeness=rng.uniform(size=n),
        picking_points=rng.normal(size=(n, 3)),
        weights=rng.uniform(5, 30, n),
        weight_intervals=rng.uniform(5, 30, (n, 2)),
        ids=10 + np.arange(n),
    )


def assert_same(a, b):
    for name in vars(a):
        left, right = getattr(a, name), getattr(b, name)
        if left is None:
            assert right is None
        else:
            assert np.array_equal(left, right, equal_nan=np.asarray(left).dtype.kind == "f"), name


def test_json_round_trip_keeps_everything(rng):
    berries = some_berries(rng)
    assert_same(Strawberries.from_json(json.loads(json.dumps(berries.to_json()))), berries)


def test_what_is_unknown_stays_unknown():
    berries = Strawberries((20, 30), np.array([[1.0, 2, 3, 4]]))
    loaded = Strawberries.from_json(json.loads(json.dumps(berries.to_json(), allow_nan=False)))
    assert np.isnan(loaded.weights).all()
    assert loaded.masks is None
    assert loaded.keypoints is None
    assert_same(loaded, berries)


def test_berries_of_a_part_are_placed_in_the_whole_image(rng):
    part = some_berries(rng)
    whole = part.placed((50, 70), (30, 15))
    assert whole.image_size == (50, 70)
    assert (whole.masks[:, 15:35, 30:60] == part.masks).all()
    assert whole.masks.sum() == part.masks.sum()
    np.testing.assert_array_equal(whole.boxes, part.boxes + np.array([30, 15, 30, 15]))
    np.testing.assert_array_equal(whole.keypoints, part.keypoints + np.array([30, 15]))
    assert_same(whole.placed((50, 70), (0, 0)), whole)
    assert len(Strawberries.empty((4, 5)).placed((8, 9), (1, 2))) == 0
    for corner in ((41, 15), (30, 31), (-1, 0), (0, -1)):
        with pytest.raises(ShapeError, match="no part"):
            part.placed((50, 70), corner)


def test_none_at_all():
    empty = Strawberries.empty((20, 30))
    assert len(empty) == 0
    assert len(Strawberries.from_json(empty.to_json())) == 0
    assert len(empty[np.zeros(0, dtype=bool)]) == 0
    assert list(empty) == []


def test_slicing_selects_every_field(rng):
    berries = some_berries(rng)
    assert_same(berries[berries.classes == 1], berries[np.flatnonzero(berries.classes == 1)])
    assert_same(berries[1:3], berries[[1, 2]])
    assert_same(berries[-1], berries[3])
    assert (berries[2].masks[0] == berries.masks[2]).all()
    assert [int(one.ids[0]) for one in berries] == [10, 11, 12, 13]
    with pytest.raises(IndexError):
        berries[4]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"boxes": np.zeros((4, 3))}, r"\(N, 4\)"),
        ({"boxes": np.array([[5.0, 5, 1, 9]] * 4)}, "x0 ≤ x1"),
        ({"scores": np.full(4, 1.5)}, r"\[0, 1\]"),
        ({"classes": np.full(4, 2)}, "pluckable"),
        ({"masks": np.zeros((4, 5, 5), bool)}, "masks must be"),
        ({"keypoints": None}, "go together"),
        ({"visibility": np.full((4, 5), 7)}, "visibility"),
        ({"ids": np.zeros(4, int)}, "unique"),
        ({"weights": np.zeros(3)}, "weights must be"),
        ({"image_size": (0, 5)}, "image_size"),
    ],
)
def test_faults_are_named(rng, changes, message):
    with pytest.raises(ShapeError, match=message):
        some_berries(rng).with_fields(**changes)


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data.update(schema="punnet-strawberries/9"),
        lambda data: data.pop("berries"),
        lambda data: data["berries"][0].pop("box"),
        lambda data: data["berries"][0].update(box=[1, 2]),
        lambda data: data["berries"][0].update({"class": "blue"}),
        lambda data: data["berries"][0]["segmentation"].update(counts=[3]),
        lambda data: data["berries"][0]["keypoints"].pop("top"),
    ],
)
def test_damaged_json_is_refused_with_our_error(rng, damage):
    data = some_berries(rng).to_json()
    damage(data)
    with pytest.raises((FileFormatError, ShapeError)):
        Strawberries.from_json(data)


@settings(deadline=None, max_examples=60)
@given(arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_run_lengths_hold_any_mask(mask):
    encoded = encode_mask(mask)
    size, counts = run_lengths(encoded)
    assert (size, counts.sum()) == (mask.shape, mask.size)
    assert (decode_mask(encoded) == mask).all()
    assert (decode_mask({"size": encoded["size"], "counts": counts.tolist()}) == mask).all()


@pytest.mark.parametrize("share", [0.0, 0.02, 0.6, 1.0])
def test_run_lengths_are_those_of_coco(rng, share):
    from faster_coco_eval.core import mask as coco

    mask = rng.random((130, 170)) < share
    theirs = coco.encode(np.asfortranarray(mask, dtype=np.uint8))
    assert encode_mask(mask) == {"size": [130, 170], "counts": theirs["counts"].decode()}
    assert (decode_mask(theirs) == mask).all()


@settings(deadline=None, max_examples=200)
@given(
    counts=st.text(max_size=12)
    | st.text(st.characters(min_codepoint=48, max_codepoint=111), max_size=12)
    | st.lists(st.integers(-(2**70), 2**70), max_size=6)
    | st.none()
)
def test_damaged_run_lengths_are_refused_with_our_error(counts):
    try:
        mask = decode_mask({"size": [4, 5], "counts": counts})
    except FileFormatError:
        return
    assert mask.shape == (4, 5)


def test_a_target_is_checked():
    with pytest.raises(ShapeError, match="picking_point"):
        Target(np.zeros(4), np.array([1.0, np.nan, 0]))
    with pytest.raises(ShapeError, match="unit"):
        Target(np.zeros(4), approach=np.array([1.0, 1, 0]))
