"""Average precision against cases worked by hand, and against pycocotools itself."""

from __future__ import annotations

import contextlib
import io
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.perception.metrics import (
    IOU_THRESHOLDS,
    KEYPOINT_SIGMAS,
    OKS_THRESHOLDS,
    ScoreSettings,
    Truth,
    evaluate_detections,
)
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
        row = evaluate_detections([truth], [found], ScoreSettings(oks_thresholds=(threshold,)))["pluckable"]
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
    row = evaluate_detections([truth], [found], ScoreSettings(oks_thresholds=(0.79, 0.81)))["pluckable"]
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


def test_detections_on_ignored_berries_are_neither_right_nor_wrong() -> None:
    # The surest detection lies on a crowd: without it the first would be wrong and halve the precision.
    berry, crowd = squares([(20, 20)]), squares([(45, 15)], side=20, keypoints=False)
    found = squares([(50, 20), (20, 20)], scores=[0.9, 0.8])
    assert evaluate_detections([berry], [found])["pluckable"].mask_ap[0.5] == pytest.approx(0.5)
    row = evaluate_detections([Truth(berry, crowd)], [found])["pluckable"]
    assert row.mask_ap[0.5] == pytest.approx(1)
    assert row.truths == 1
    # Of another class it helps nothing, but in "any class".
    other = crowd.with_fields(classes=np.array([1]))
    scores = evaluate_detections([Truth(berry, other)], [found])
    assert scores["pluckable"].mask_ap[0.5] == pytest.approx(0.5)
    assert scores["any class"].mask_ap[0.5] == pytest.approx(1)
    assert math.isnan(scores["unpluckable"].mask_ap[0.5])


@st.composite
def scenes(draw: st.DrawFn) -> list[tuple[Truth, Strawberries]]:
    def berries(most: int, distinct_scores: bool, keypoints: bool = True) -> Strawberries:
        n = draw(st.integers(0, most))
        corners = draw(st.lists(st.tuples(st.integers(0, 60), st.integers(5, 45)), min_size=n, max_size=n))
        scores = draw(st.lists(st.integers(1, 99), min_size=n, max_size=n, unique=distinct_scores))
        drawn = squares(
            corners,
            classes=draw(st.lists(st.integers(0, 1), min_size=n, max_size=n)),
            scores=[s / 100 for s in scores],
            side=draw(st.integers(6, 14)),
            shift=draw(st.floats(-3, 3)),
            keypoints=keypoints,
        )
        if keypoints and n:
            codes = draw(st.lists(st.integers(0, 3), min_size=5 * n, max_size=5 * n))
            visibility = np.array(codes).reshape(n, 5)
            points = np.where(visibility[..., None] > 0, drawn.keypoints, np.nan)
            drawn = drawn.with_fields(visibility=visibility, keypoints=points)
        return drawn

    return [
        (Truth(berries(4, False), berries(2, False, keypoints=False)), berries(5, True))
        for _ in range(draw(st.integers(1, 3)))
    ]


def coco_entries(image: int, berries: Strawberries, crowd: int, first: int) -> list[dict[str, Any]]:
    """Berries as COCO has them, masks by pycocotools."""
    from pycocotools import mask as run_lengths

    entries = []
    for k in range(len(berries)):
        left, top, right, bottom = berries.boxes[k]
        codes = np.zeros(5, int) if berries.visibility is None else np.minimum(berries.visibility[k], 2)
        points = np.zeros((5, 2)) if berries.keypoints is None else berries.keypoints[k]
        known = np.isfinite(points).all(axis=1)
        table = np.column_stack((np.where(known[:, None], points, -1e6), codes * known))
        encoded = run_lengths.encode(np.asfortranarray(berries.masks[k].astype(np.uint8)))
        entries.append(
            {
                "id": first + k,
                "image_id": image,
                "category_id": int(berries.classes[k]) + 1,
                "segmentation": {"size": encoded["size"], "counts": encoded["counts"].decode()},
                "bbox": [left, top, right - left, bottom - top],
                "area": float(berries.masks[k].sum()),
                "iscrowd": crowd,
                "keypoints": table.ravel().tolist(),
                "num_keypoints": int((codes * known > 0).sum()),
                "score": float(berries.scores[k]),
            }
        )
    return entries


def pycocotools_tables(
    images: list[tuple[Truth, Strawberries]], kind: str, thresholds: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Precision (threshold, 101, class) and recall (threshold, class), −1 where nothing is annotated."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    truths: list[dict[str, Any]] = []
    found: list[dict[str, Any]] = []
    for number, (truth, detections) in enumerate(images, start=1):
        truths += coco_entries(number, truth.berries, 0, len(truths) + 1)
        truths += coco_entries(number, truth.ignored, 1, len(truths) + 1)
        found += coco_entries(number, detections, 0, len(found) + 1)
    with contextlib.redirect_stdout(io.StringIO()):
        annotated, results = COCO(), COCO()
        frames = [{"id": k + 1, "height": SIZE[0], "width": SIZE[1]} for k in range(len(images))]
        categories = [{"id": 1, "name": "pluckable"}, {"id": 2, "name": "unpluckable"}]
        for holder, entries in ((annotated, truths), (results, found)):
            holder.dataset = {"images": frames, "annotations": entries, "categories": categories}
            holder.createIndex()
        evaluation = COCOeval(annotated, results, kind)
        evaluation.params.kpt_oks_sigmas = np.array(KEYPOINT_SIGMAS)
        evaluation.params.iouThrs = np.array(thresholds)
        evaluation.params.maxDets = [100]
        evaluation.params.areaRng, evaluation.params.areaRngLbl = [[0, 1e10]], ["all"]
        evaluation.evaluate()
        evaluation.accumulate()
    return evaluation.eval["precision"][:, :, :, 0, 0], evaluation.eval["recall"][:, :, 0, 0]


def mean_of_known(values: np.ndarray) -> float:
    known = values[values > -1]
    return float(known.mean()) if known.size else math.nan


STANDARD = tuple(round(0.5 + 0.05 * step, 2) for step in range(10))


@settings(max_examples=40, deadline=None)
@given(scenes())
def test_equals_pycocotools(images: list[tuple[Truth, Strawberries]]) -> None:
    scores = evaluate_detections([t for t, _ in images], [p for _, p in images])
    for kind, own, prefix in (("segm", IOU_THRESHOLDS, "mask"), ("keypoints", OKS_THRESHOLDS, "keypoint")):
        thresholds = tuple(sorted({*own, *STANDARD}))
        precision, recall = pycocotools_tables(images, kind, thresholds)
        standard = [thresholds.index(t) for t in STANDARD]
        for k, row in enumerate(scores.rows[:2]):
            expected = {t: mean_of_known(precision[thresholds.index(t), :, k]) for t in own}
            assert getattr(row, f"{prefix}_ap") == pytest.approx(expected, abs=1e-6, nan_ok=True)
            for field, value in (
                ("ap_mean", mean_of_known(precision[standard, :, k])),
                ("ar", mean_of_known(recall[standard, k])),
            ):
                assert getattr(row, f"{prefix}_{field}") == pytest.approx(value, abs=1e-6, nan_ok=True)


def test_json() -> None:
    scores = evaluate_detections([squares([(20, 20)])], [squares([(22, 20)])])
    data = json.loads(json.dumps(scores.to_json()))
    assert data["images"] == 1
    assert data["classes"][0]["mask_ap"] == {"0.5": pytest.approx(1), "0.7": 0.0, "0.9": 0.0}
    assert data["classes"][1]["mask_ap"]["0.5"] is None


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
    "values",
    [{"iou_thresholds": ()}, {"oks_thresholds": (1.0,)}, {"sigmas": (0.1,) * 4}, {"most_detections": 0}],
)
def test_settings_out_of_range_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError, match="evaluation"):
        ScoreSettings(**values)
