"""Average precision against cases worked by hand, and against faster-coco-eval fed with COCO JSON directly."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from faster_coco_eval import COCO, COCOeval_faster
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data import detections_to_coco
from punnet.errors import ConfigurationError, ShapeError
from punnet.perception.metrics import KEYPOINT_SIGMAS, evaluate_detections
from punnet.scene import Strawberries

SIZE = (60, 80)


def squares(
    corners: list[tuple[int, int]],
    *,
    side: int = 10,
    classes: list[int] | None = None,
    scores: list[float] | None = None,
    shift: float = 0.0,
    keypoints: bool = True,
) -> Strawberries:
    """Square berries with top-left corners (u, v); key-points at fixed places of the square, moved by ``shift``."""
    n = len(corners)
    masks = np.zeros((n, *SIZE), bool)
    points = np.zeros((n, 5, 2))
    for i, (u, v) in enumerate(corners):
        masks[i, v : v + side, u : u + side] = True
        points[i] = np.array([u, v]) + side * np.array([[0.5, -0.3], [0.5, 0], [0.5, 1], [0, 0.4], [1, 0.4]])
    points[..., 0] += shift
    boxes = np.array([[u, v, u + side, v + side] for u, v in corners], float).reshape(n, 4)
    return Strawberries(
        image_size=SIZE,
        boxes=boxes,
        scores=np.array(scores if scores is not None else [0.9] * n),
        classes=np.array(classes if classes is not None else [0] * n, dtype=int),
        masks=masks,
        keypoints=points if keypoints else None,
        visibility=np.full((n, 5), 2) if keypoints else None,
    )


def test_perfect_detections_score_one() -> None:
    berries = squares([(5, 20), (40, 20)], classes=[0, 1])
    for row in evaluate_detections([berries], [berries]).rows:
        assert row.mask_ap == {0.5: pytest.approx(1), 0.7: pytest.approx(1), 0.9: pytest.approx(1)}
        assert (row.mask_ap_mean, row.mask_ar) == (pytest.approx(1), pytest.approx(1))
        assert row.keypoint_ap == {0.1: pytest.approx(1), 0.3: pytest.approx(1), 0.5: pytest.approx(1)}


def test_hand_worked_precision_recall() -> None:
    # Three berries; found in order of score: right, wrong, right. Precision by recall: 1 up to 1/3, 2/3 up to 2/3.
    # COCO samples recall at 0, .01 … 1: 34 steps reach 1/3, 33 more reach 2/3 (0.67 does not), the rest are 0.
    truth = squares([(5, 20), (30, 20), (55, 20)])
    found = squares([(5, 20), (30, 45), (30, 20)], scores=[0.9, 0.8, 0.7])
    row = evaluate_detections([truth], [found])["pluckable"]
    assert row.mask_ap[0.5] == pytest.approx((34 * 1 + 33 * 2 / 3) / 101, abs=1e-9)
    assert row.mask_ar == pytest.approx(2 / 3)
    assert (row.truths, row.detections) == (3, 3)


def test_iou_decides_which_threshold_is_met() -> None:
    # Moved by 2 of 10 pixels: IoU = 80 / 120 = .667, above .5 and below .7.
    row = evaluate_detections([squares([(20, 20)])], [squares([(22, 20)])])["pluckable"]
    assert row.mask_ap == {0.5: pytest.approx(1), 0.7: 0.0, 0.9: 0.0}
    # .50, .55, .60, .65 of the ten thresholds are met.
    assert row.mask_ap_mean == pytest.approx(0.4)


def test_oks_is_equation_3_7() -> None:
    shift, scale = 1.0, 10.0
    oks = np.mean([math.exp(-(shift**2) / (2 * scale**2 * (2 * sigma) ** 2)) for sigma in KEYPOINT_SIGMAS])
    truth, found = squares([(20, 20)]), squares([(20, 20)], shift=shift)
    for threshold, expected in ((oks - 1e-6, 1.0), (oks + 1e-6, 0.0)):
        row = evaluate_detections([truth], [found], oks_thresholds=(threshold,))["pluckable"]
        assert row.keypoint_ap[threshold] == pytest.approx(expected)


def test_absent_keypoints_do_not_count_and_missing_ones_do() -> None:
    truth = squares([(20, 20)])
    hidden = truth.visibility.copy()
    hidden[0, :4] = 0
    one_point = truth.with_fields(visibility=hidden)
    lost = truth.keypoints.copy()
    lost[0, 4] = np.nan
    found = truth.with_fields(keypoints=lost)
    # Only the one annotated point counts, and it was not found.
    assert evaluate_detections([one_point], [found])["pluckable"].keypoint_ap[0.1] == 0.0
    # One of five annotated points was not found: OKS .8.
    row = evaluate_detections([truth], [found], oks_thresholds=(0.79, 0.81))["pluckable"]
    assert list(row.keypoint_ap.values()) == [pytest.approx(1), 0.0]


def test_wrong_class_counts_only_in_any_class() -> None:
    scores = evaluate_detections([squares([(20, 20)], classes=[0])], [squares([(20, 20)], classes=[1])])
    assert scores["pluckable"].mask_ap[0.5] == 0.0
    assert math.isnan(scores["unpluckable"].mask_ap[0.5])
    assert scores["mean"].mask_ap[0.5] == 0.0
    assert scores["any class"].mask_ap[0.5] == pytest.approx(1)


def test_nothing_found_and_nothing_there() -> None:
    truth, none = squares([(20, 20)]), Strawberries.empty(SIZE)
    missed = evaluate_detections([truth], [none])["pluckable"]
    assert (missed.mask_ap[0.5], missed.mask_ar, missed.keypoint_ap[0.1]) == (0.0, 0.0, 0.0)
    empty = evaluate_detections([none], [truth])["pluckable"]
    assert math.isnan(empty.mask_ap[0.5])
    assert math.isnan(evaluate_detections([], [])["mean"].mask_ap_mean)


def test_annotations_without_keypoints_give_no_oks() -> None:
    row = evaluate_detections([squares([(20, 20)], keypoints=False)], [squares([(20, 20)])])["pluckable"]
    assert math.isnan(row.keypoint_ap[0.1])
    assert row.mask_ap[0.5] == pytest.approx(1)


@st.composite
def scenes(draw: st.DrawFn) -> list[tuple[Strawberries, Strawberries]]:
    def berries(most: int, distinct_scores: bool) -> Strawberries:
        n = draw(st.integers(0, most))
        corners = draw(st.lists(st.tuples(st.integers(0, 60), st.integers(5, 45)), min_size=n, max_size=n))
        scores = draw(st.lists(st.integers(1, 99), min_size=n, max_size=n, unique=distinct_scores))
        classes = draw(st.lists(st.integers(0, 1), min_size=n, max_size=n))
        shift = draw(st.floats(-3, 3))
        return squares(
            corners,
            classes=classes,
            scores=[s / 100 for s in scores],
            side=draw(st.integers(6, 14)),
            shift=shift,
        )

    return [(berries(4, False), berries(5, True)) for _ in range(draw(st.integers(1, 3)))]


@settings(max_examples=25, deadline=None)
@given(scenes())
def test_equals_faster_coco_eval(images: list[tuple[Strawberries, Strawberries]]) -> None:
    scores = evaluate_detections([t for t, _ in images], [p for _, p in images])
    truth = detections_to_coco((i, f"{i}.png", t) for i, (t, _) in enumerate(images))
    found = detections_to_coco((i, f"{i}.png", p) for i, (_, p) in enumerate(images))["annotations"]
    for kind, field in (("segm", "mask_ap_mean"), ("keypoints", "keypoint_ap_mean")):
        annotated = COCO(json.loads(json.dumps(truth)))
        evaluation = COCOeval_faster(
            annotated,
            annotated.loadRes(json.loads(json.dumps(found))),
            kind,
            kpt_oks_sigmas=list(KEYPOINT_SIGMAS),
        )
        evaluation.params.maxDets = [100]
        evaluation.evaluate()
        evaluation.accumulate()
        precision = evaluation.eval["precision"][:, :, :, 0, -1]
        known = precision[precision > -1]
        expected = known.mean() if known.size else math.nan
        assert getattr(scores["mean"], field) == pytest.approx(expected, abs=1e-6, nan_ok=True)


def test_json_and_table() -> None:
    scores = evaluate_detections([squares([(20, 20)])], [squares([(22, 20)])])
    data = json.loads(json.dumps(scores.to_json()))
    assert data["images"] == 1
    assert data["classes"][0]["mask_ap"] == {"0.5": pytest.approx(1), "0.7": 0.0, "0.9": 0.0}
    assert data["classes"][1]["mask_ap"]["0.5"] is None
    lines = scores.table().splitlines()
    assert len({len(line) for line in lines}) == 1
    assert "mask AP70" in lines[0]
    assert "–" in lines[2]


def test_unknown_class_is_a_key_error() -> None:
    with pytest.raises(KeyError, match="pluckable"):
        evaluate_detections([], [])["ripe"]


def test_mismatches_are_told() -> None:
    berries = squares([(20, 20)])
    with pytest.raises(ShapeError, match="only one of truth and predicted has an image 1"):
        evaluate_detections([berries, berries], [berries])
    with pytest.raises(ShapeError, match="image 0"):
        evaluate_detections([berries], [Strawberries.empty((10, 10))])
    with pytest.raises(ShapeError, match="no masks"):
        evaluate_detections([berries], [berries.with_fields(masks=None)])


@pytest.mark.parametrize(
    "settings_",
    [{"iou_thresholds": ()}, {"oks_thresholds": (1.0,)}, {"sigmas": (0.1,) * 4}, {"most_detections": 0}],
)
def test_settings_out_of_range_are_refused(settings_: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match="evaluation"):
        evaluate_detections([], [], **settings_)
