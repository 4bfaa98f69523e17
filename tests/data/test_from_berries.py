from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from punnet.data import Dataset, annotate_image, read_coco, to_annotations, write_coco
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Strawberries


def found() -> Strawberries:
    masks = np.zeros((2, 10, 20), bool)
    masks[0, 4:9, 3:7] = True
    points = np.array([[5.0, 1], [5, 4], [5, 8], [np.nan, np.nan], [6, 6]])
    return Strawberries(
        image_size=(10, 20),
        boxes=np.array([[3.0, 1, 7, 9], [10, 2, 15, 7]]),
        scores=np.array([0.75, 0.5]),
        classes=np.array([UNPLUCKABLE, PLUCKABLE]),
        masks=masks,
        keypoints=np.stack((points, points + 9)),
        visibility=np.array([[3, 2, 1, 0, 2], [2, 2, 2, 2, 0]]),
        ripeness=np.array([0.25, np.nan]),
        weights=np.array([12.0, np.nan]),
        weight_intervals=np.array([[10.0, 14], [np.nan, np.nan]]),
        picking_points=np.array([[0.5, 0.1, 0.7], [np.nan] * 3]),
        ids=np.array([4, 2]),
    )


def test_everything_that_was_found_survives_a_file(tmp_path: Path) -> None:
    berries = found()
    image = annotate_image(berries, tmp_path / "a.jpg", identity=4, group="plant")
    write_coco(Dataset((image,)), tmp_path / "found.json")
    (again,) = read_coco(tmp_path / "found.json")
    assert (again.id, again.path, again.group) == (4, tmp_path / "a.jpg", "plant")
    same = again.berries()
    for name in ("scores", "classes", "masks", "ripeness", "weights"):
        np.testing.assert_array_equal(getattr(same, name), getattr(berries, name), err_msg=name)
    assert [a.extra.get("picking_point_m") for a in again.annotations] == [[0.5, 0.1, 0.7], None]
    assert [a.extra.get("weight_interval_g") for a in again.annotations] == [[10, 14], None]
    assert [a.extra["berry_id"] for a in again.annotations] == [4, 2]
    assert same.visibility[0].tolist() == [3, 2, 1, 0, 2]
    np.testing.assert_array_equal(same.keypoints[0], berries.keypoints[0])


def test_a_keypoint_is_there_whole_or_not_at_all() -> None:
    _, second = to_annotations(found())
    # The fourth has no place, the fifth is said to be absent.
    assert second.visibility.tolist() == [2, 2, 2, 0, 0]
    assert np.isnan(second.keypoints[3:]).all()


def test_ids_count_on() -> None:
    assert [annotation.id for annotation in to_annotations(found(), 7)] == [7, 8]
    assert to_annotations(Strawberries.empty((9, 9))) == ()


def test_boxes_alone_will_do() -> None:
    boxes = Strawberries(image_size=(10, 20), boxes=np.array([[1.0, 2, 3, 4]]))
    berries = annotate_image(boxes, Path("a.jpg")).berries()
    assert (berries.masks, berries.keypoints) == (None, None)
    assert berries.boxes == pytest.approx(boxes.boxes)
