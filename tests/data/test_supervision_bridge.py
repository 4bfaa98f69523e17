"""Berries to supervision and back, and what other models' detections become."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data.supervision_bridge import from_supervision, to_supervision
from punnet.errors import ConfigurationError, FileFormatError, PunnetError, ShapeError
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Strawberries, Visibility

sv = pytest.importorskip("supervision")

SIZE = (12, 20)
FIELDS = ("boxes", "scores", "classes", "masks", "keypoints", "visibility", "ripeness", "picking_points")
FIELDS += ("weights", "weight_intervals", "ids")


def berries(**changes: Any) -> Strawberries:
    masks = np.zeros((2, *SIZE), bool)
    masks[0, 2:8, 3:9] = True
    masks[1, 5:10, 11:18] = True
    keypoints = np.array(
        [
            [[6.0, 1.25], [6, 2], [6, 8], [3, 5], [np.nan, np.nan]],
            [[14.0, 3], [14, 5], [np.nan, np.nan], [11, 7], [18, 7]],
        ]
    )
    given: dict[str, Any] = {
        "boxes": np.array([[3.0, 1, 9, 8], [11, 3, 18, 10]]),
        "scores": np.array([0.9, 0.25]),
        "classes": np.array([PLUCKABLE, UNPLUCKABLE]),
        "masks": masks,
        "keypoints": keypoints,
        "visibility": np.array([[2, 1, 3, 2, 0], [2, 2, 0, 3, 1]]),
        "ripeness": np.array([1.0, np.nan]),
        "picking_points": np.array([[0.4, 0.1, 0.7], [np.nan] * 3]),
        "weights": np.array([18.5, np.nan]),
        "weight_intervals": np.array([[15.0, 22.0], [np.nan, np.nan]]),
        "ids": np.array([7, 3]),
    }
    return Strawberries(image_size=SIZE, **{**given, **changes})


def assert_same(found: Strawberries, expected: Strawberries) -> None:
    assert found.image_size == expected.image_size
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def test_there_and_back_keeps_every_field() -> None:
    expected = berries()
    detections, key_points = to_supervision(expected)
    assert isinstance(detections, sv.Detections)
    assert isinstance(key_points, sv.KeyPoints)
    assert list(detections.data["class_name"]) == ["pluckable", "unpluckable"]
    assert_same(from_supervision(detections, key_points), expected)


def test_there_and_back_of_boxes_alone_and_of_nothing() -> None:
    boxes = berries(masks=None, keypoints=None, visibility=None)
    detections, key_points = to_supervision(boxes)
    assert key_points is None
    assert detections.mask is None
    assert_same(from_supervision(detections, image_size=SIZE), boxes)
    nothing = from_supervision(*to_supervision(berries()[[]]), image_size=SIZE)
    assert len(nothing) == 0
    assert len(from_supervision(sv.Detections.empty(), sv.KeyPoints.empty(), image_size=SIZE)) == 0


def test_changing_what_supervision_got_leaves_the_berries_alone() -> None:
    original = berries()
    detections, _ = to_supervision(original)
    detections.xyxy[:] = 0
    detections.mask[:] = False
    assert_same(original, berries())


def test_selecting_in_supervision_selects_berries() -> None:
    detections, key_points = to_supervision(berries())
    chosen = detections.class_id == UNPLUCKABLE
    assert_same(from_supervision(detections[chosen], key_points[chosen]), berries()[[1]])


def test_supervision_draws_what_it_got() -> None:
    detections, key_points = to_supervision(berries())
    canvas = np.zeros((*SIZE, 3), np.uint8)
    drawn = sv.MaskAnnotator(opacity=1.0).annotate(canvas.copy(), detections)
    masks = berries().masks
    assert masks is not None
    assert (drawn.any(axis=2) == masks.any(axis=0)).all()
    # An absent point is drawn nowhere, neither at the origin.
    assert not sv.VertexAnnotator(radius=1).annotate(canvas.copy(), key_points)[0, 0].any()


def test_classes_of_other_models_are_mapped_by_name_and_number() -> None:
    boxes = np.array([[1.0, 1, 4, 4], [5, 5, 9, 9], [2, 2, 3, 3]])
    named = sv.Detections(boxes, data={"class_name": np.array(["strawberry", "Unripe", "leaf"])})
    with pytest.raises(FileFormatError, match=r"detection 0: class 'strawberry' is not known"):
        from_supervision(named, image_size=SIZE)
    found = from_supervision(named, image_size=SIZE, class_map={"strawberry": "pluckable", "leaf": "ignore"})
    assert found.classes.tolist() == [PLUCKABLE, UNPLUCKABLE]
    assert found.boxes.tolist() == boxes[:2].tolist()
    assert found.scores.tolist() == [1, 1]
    numbered = sv.Detections(boxes, class_id=np.array([0, 1, 5]))
    with pytest.raises(FileFormatError, match="'5'"):
        from_supervision(numbered, image_size=SIZE)
    swapped = {"0": "unpluckable", "1": "pluckable", "5": "ignore"}
    assert from_supervision(numbered, image_size=SIZE, class_map=swapped).classes.tolist() == [1, 0]


def test_keypoints_of_other_models_are_visible_unless_missing() -> None:
    detections = sv.Detections(np.array([[0.0, 0, 9, 9]]), class_id=np.array([0]))
    points = np.array([[[4.0, 1], [0, 0], [4, 9], [np.nan, 5], [0, 5]]], np.float32)
    found = from_supervision(detections, sv.KeyPoints(points), image_size=SIZE)
    assert found.visibility is not None
    assert found.keypoints is not None
    absent, visible = int(Visibility.ABSENT), int(Visibility.VISIBLE)
    assert found.visibility.tolist() == [[visible, absent, visible, absent, visible]]
    assert np.isnan(found.keypoints[0, [1, 3]]).all()
    assert found.keypoints[0, 4].tolist() == [0, 5]


@pytest.mark.parametrize(
    ("make", "error", "told"),
    [
        (lambda d, k: (d, k, None), ConfigurationError, "image_size"),
        (lambda d, k: (d, sv.KeyPoints(k.xy[:1]), SIZE), ShapeError, r"\(2, 5, 2\).*\(1, 5, 2\)"),
        (lambda d, k: (d, sv.KeyPoints(k.xy[:, :4]), SIZE), ShapeError, "picking_point"),
    ],
)
def test_what_does_not_fit_is_told(make: Any, error: type[PunnetError], told: str) -> None:
    detections, key_points = to_supervision(berries(masks=None))
    given_detections, given_points, size = make(detections, key_points)
    with pytest.raises(error, match=told):
        from_supervision(given_detections, given_points, image_size=size)


def test_a_detection_without_class_is_told() -> None:
    with pytest.raises(ConfigurationError, match="class_id"):
        from_supervision(sv.Detections(np.array([[0.0, 0, 9, 9]])), image_size=SIZE)


def test_without_supervision_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "supervision", None)
    with pytest.raises(ConfigurationError, match="pip install supervision"):
        to_supervision(berries())


@settings(deadline=None, max_examples=50)
@given(
    st.integers(0, 4).flatmap(
        lambda n: st.tuples(
            st.lists(
                st.lists(st.floats(-30, 30, width=32), min_size=10, max_size=10), min_size=n, max_size=n
            ),
            st.lists(st.lists(st.integers(0, 3), min_size=5, max_size=5), min_size=n, max_size=n),
        )
    )
)
def test_keypoints_survive_except_at_the_very_corner(drawn: tuple[list[Any], list[Any]]) -> None:
    n = len(drawn[0])
    points = np.array(drawn[0], float).reshape(n, 5, 2)
    codes = np.array(drawn[1], int).reshape(n, 5)
    # (0, 0) is how supervision says absent.
    codes[(points == 0).all(axis=2)] = 0
    points[codes == 0] = np.nan
    boxes = np.tile([0.0, 0, 5, 5], (n, 1))
    expected = Strawberries(SIZE, boxes, keypoints=points, visibility=codes)
    assert_same(from_supervision(*to_supervision(expected), image_size=SIZE), expected)
