"""A whole evaluation against answers worked by hand: errors, confusions, what is missed, what is left out."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.data.dataset import Dataset
from punnet.errors import FileFormatError
from punnet.perception import ColourDetector
from punnet.perception.evaluation import Evaluation, EvaluationSettings, evaluate_detector, prepare_detector
from punnet.perception.evaluation_folder import read_evaluation, write_evaluation
from punnet.perception.evaluation_tables import tables_of_evaluation
from punnet.perception.metrics import ScoreSettings
from punnet.perception.picking_points import PICKING_HEIGHT
from punnet.scene import Strawberries, Visibility
from tests.perception.annotated import CAMERA, SIZE, ToldDetector, found, image_of, set_of, square

SETTINGS = EvaluationSettings(ScoreSettings(), user_score=0.5)
DEPTH = 0.5


def run(dataset: Dataset, answers: dict[int, Strawberries]) -> Evaluation:
    return evaluate_detector(dataset, ToldDetector(answers), SETTINGS, data=dataset.name)


@pytest.fixture
def two_images(tmp_path: Path) -> Dataset:
    """Two berries in the first, one and a crowd in the second; in the first depth is known."""
    depths = np.full(5, DEPTH)
    codes = np.array([3, 2, 1, 2, 0])
    hidden = square((50, 30), 2).keypoints.copy()
    hidden[4] = np.nan
    return set_of(
        image_of(
            tmp_path,
            1,
            square((10, 20), 1, stage="ripe", ripeness=1.0, occlusion=0.0, keypoint_depths=depths),
            square(
                (50, 30),
                2,
                class_index=1,
                stage="green",
                ripeness=0.1,
                occlusion=1.0,
                keypoints=hidden,
                visibility=codes,
                keypoint_depths=depths,
            ),
            camera=CAMERA,
        ),
        image_of(tmp_path, 2, square((10, 20), 3, stage="turning"), square((40, 20), 4, side=20, crowd=True)),
    )


def test_keypoint_errors_in_pixels_share_and_millimetres(two_images: Dataset) -> None:
    answers = {1: found([(10, 20), (50, 30)], classes=[0, 1], shift=(3, 4))}
    rows = {
        (row["keypoint"], row["berries"], row["shown"]): row
        for row in run(two_images, answers).to_json()["keypoint_errors"]
    }
    row = rows["picking_point", "pluckable", "visible"]
    assert (row["annotated"], row["located"]) == (1, 1)
    # 5 px of a 10 px berry; at 0.5 m and a focal length of 100 px, one pixel is 5 mm.
    assert row["pixels"] == {"median": 5.0, "mean": 5.0, "ninety_percent": 5.0}
    assert row["share_of_size"]["median"] == pytest.approx(0.5)
    assert row["millimetres"]["median"] == pytest.approx(25.0)
    # Hidden by something else in the second berry; its absent right grasp is in no row.
    assert rows["picking_point", "all", "hidden"]["annotated"] == 1
    assert rows["right_grasp", "all", "visible"]["annotated"] == 1
    assert ("right_grasp", "all", "hidden") not in rows
    assert not any(keypoint.endswith("in space") for keypoint, _, _ in rows)


def test_picking_point_in_space_needs_depth_and_pose(tmp_path: Path) -> None:
    depth_path = tmp_path / "depth.png"
    cv2.imwrite(str(depth_path), np.full(SIZE, 500, np.uint16))
    # The camera looks along the base's x axis, upright.
    pose = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]]
    berry = square((30, 25), 1, side=20, keypoint_depths=np.full(5, 0.55))
    image = image_of(tmp_path, 1, berry, camera=CAMERA, depth_path=depth_path, extra={"T_base_camera": pose})
    answers = {1: found([(30, 25)], side=20)}
    rows = run(set_of(image), answers).to_json()["keypoint_errors"]
    space = [row for row in rows if row["keypoint"] == "picking_point in space"]
    assert [row["berries"] for row in space] == ["all", "pluckable"]
    # The fruit's axis is taken to lie 0.87 of 25 mm behind the surface, the stem to be gripped above the top, pixel (40, 25).
    grip = (0.5 + 0.87 * 0.025) * np.array([0.5 / 100, -4.5 / 100, 1.0]) - np.array(
        [0.0, PICKING_HEIGHT, 0.0]
    )
    annotated = 0.55 * np.array([0.5 / 100, -10.5 / 100, 1.0])
    assert space[0]["millimetres"]["median"] == pytest.approx(
        1000 * np.linalg.norm(grip - annotated), abs=0.1
    )


def test_confusions_and_what_is_found(two_images: Dataset) -> None:
    # The ripe berry is called unpluckable, the green one is missed, the third is right; one detection is on the crowd,
    # one on nothing, one is too unsure.
    answers = {
        1: found([(10, 20)], classes=[1], visibility=1),
        2: found([(10, 20), (45, 25), (65, 45), (20, 45)], scores=[0.9, 0.8, 0.7, 0.3]),
    }
    evaluation = run(two_images, answers)
    data = evaluation.to_json()
    assert data["class_confusion"]["columns"] == ["pluckable", "unpluckable", "missed"]
    assert data["class_confusion"]["rows"] == ["pluckable", "unpluckable", "no berry"]
    assert data["class_confusion"]["counts"] == [[1, 1, 0], [0, 0, 1], [1, 0, 0]]
    assert data["stage_confusion"]["rows"] == ["green", "turning", "ripe"]
    assert data["stage_confusion"]["counts"] == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    visible = int(Visibility.VISIBLE)
    assert data["visibility"]["counts"][visible] == [0, 5, 5, 0]
    assert data["visibility"]["accuracy"] == pytest.approx(0.5)
    # Ripeness is known of the first berry alone: 1 and .8.
    assert data["ripeness_error"] == {"mean": pytest.approx(0.2), "berries": 1}
    sizes = [(share["from"], share["berries"], share["found"]) for share in data["found_by_size"]]
    assert sizes == [
        (0, 3, pytest.approx(2 / 3)),
        (16, 0, None),
        (32, 0, None),
        (64, 0, None),
        (128, 0, None),
    ]
    hidden = data["found_by_occlusion"]
    assert (hidden[0]["berries"], hidden[0]["found"], hidden[0]["rightly_named"]) == (1, 1.0, 0.0)
    assert (hidden[-1]["berries"], hidden[-1]["found"]) == (1, 0.0)
    worst = [
        (image["photo"], image["missed"], image["misnamed"], image["false"]) for image in data["worst_images"]
    ]
    assert worst == [("1.png", 1, 1, 0), ("2.png", 0, 0, 1)]


def test_perfect_answers(two_images: Dataset) -> None:
    answers = {
        1: found([(10, 20), (50, 30)], classes=[0, 1]),
        2: found([(10, 20)]),
    }
    evaluation = run(two_images, answers)
    assert evaluation.scores["mean"].mask_ap[0.9] == pytest.approx(1)
    assert evaluation.scores["mean"].keypoint_ap[0.5] == pytest.approx(1)
    assert evaluation.worst() == []
    assert np.array_equal(evaluation.classes.counts, np.diag([2, 1, 0]))


def test_a_box_without_a_mask_is_ignored_like_a_crowd(tmp_path: Path) -> None:
    image = image_of(tmp_path, 1, square((10, 20), 1), square((50, 20), 2, segmentation=None))
    evaluation = run(set_of(image), {1: found([(50, 20), (10, 20)], scores=[0.9, 0.8])})
    row = evaluation.scores["pluckable"]
    assert (row.truths, row.mask_ap[0.5]) == (1, pytest.approx(1))
    assert evaluation.classes.counts.tolist() == [[1, 0, 0], [0, 0, 0], [0, 0, 0]]


def test_images_that_cannot_be_read_are_left_out(two_images: Dataset, tmp_path: Path) -> None:
    (tmp_path / "1.png").write_bytes(b"not an image")
    cv2.imwrite(str(tmp_path / "3.png"), np.zeros((10, 10, 3), np.uint8))
    smaller = image_of(tmp_path, 3, square((10, 20), 9))
    cv2.imwrite(str(smaller.path), np.zeros((10, 10, 3), np.uint8))
    evaluation = run(set_of(*two_images, smaller), {2: found([(10, 20)])})
    assert [path.name for path, _ in evaluation.skipped] == ["1.png", "3.png"]
    assert "not an image" in evaluation.skipped[0][1]
    assert evaluation.scores.images == 1
    assert evaluation.images[0].index == 1
    with pytest.raises(FileFormatError, match="none of 1 images could be scored"):
        run(two_images.subset([0]), {})


def test_sets_without_any_mask_are_refused(tmp_path: Path) -> None:
    image = image_of(tmp_path, 1, square((10, 20), 1, segmentation=None))
    with pytest.raises(FileFormatError, match="no annotation has a mask"):
        run(set_of(image), {1: found([(10, 20)])})


def test_images_without_berries_count_their_false_detections(tmp_path: Path) -> None:
    evaluation = run(set_of(image_of(tmp_path, 1)), {1: found([(10, 20)])})
    assert evaluation.classes.counts[-1].tolist() == [1, 0, 0]
    data = evaluation.to_json()
    assert (data["visibility"], data["stage_confusion"], data["found_by_size"]) == (None, None, [])
    assert data["classes"][0]["mask_ap"]["0.5"] is None


def test_folder_and_tables(two_images: Dataset, tmp_path: Path) -> None:
    detector = ToldDetector({1: found([(10, 20), (30, 40)], classes=[1, 0])})
    evaluation = evaluate_detector(two_images, detector, SETTINGS, data="squares")
    folder = tmp_path / "out"
    folder.mkdir()
    write_evaluation(folder, evaluation, evaluation.to_json(), two_images.images, detector)
    assert read_evaluation(folder) == json.loads(json.dumps(evaluation.to_json()))
    assert min(cv2.imread(str(folder / "scores.png")).shape[:2]) > 500
    sheet = cv2.imread(str(folder / "worst.png"))
    # Two pairs of 640 px pictures side by side.
    assert sheet.shape[1] == 2 * (2 * 640 + 6)
    tables = tables_of_evaluation(evaluation.to_json())
    assert len(tables) == 7
    for _, columns, rows in tables:
        assert all(len(row) == len(columns) for row in rows)


def test_files_that_are_no_evaluation_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        read_evaluation(tmp_path)
    for text in ("{", "[]", '{"schema": "punnet-evaluation/9"}'):
        (tmp_path / "evaluation.json").write_text(text)
        with pytest.raises(FileFormatError, match=r"evaluation\.json"):
            read_evaluation(tmp_path)


def test_the_colour_baseline_keeps_its_threshold() -> None:
    detector, settings = prepare_detector("colour")
    assert isinstance(detector, ColourDetector)
    assert settings.user_score == detector.config.score
    assert prepare_detector("colour", score=0.7)[1].user_score == 0.7
