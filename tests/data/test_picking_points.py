"""JSON in the shape of Detectron2's dictionaries: boxes of every mode, key-points of every form, classes by number."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import Annotation, read_dataset, read_picking_points, read_strawdi
from punnet.data.formats import guess_format
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

HEIGHT, WIDTH = 40, 60
POINTS = [20, 2, 2, 20, 10, 1, 20, 30, 2, 0, 0, 0, 30, 20, 2]
BERRY = {"bbox": [10, 8, 30, 31], "bbox_mode": 0, "category_id": 0, "keypoints": POINTS}
CLASSES = {"0": "pluckable", "1": "unpluckable"}


def record(*berries: dict[str, Any], **changes: Any) -> dict[str, Any]:
    known = {"file_name": "a.png", "height": HEIGHT, "width": WIDTH, "image_id": 17}
    return {**known, "annotations": list(berries), **changes}


def saved(folder: Path, data: Any, name: str = "a.json") -> Path:
    path = folder / name
    path.write_text(json.dumps(data))
    return path


def read_one(folder: Path, **changes: Any) -> Annotation:
    (image,) = read_picking_points(saved(folder, record({**BERRY, **changes})), class_map=CLASSES)
    (annotation,) = image.annotations
    return annotation


def test_a_photograph_as_published(tmp_path: Path) -> None:
    berries = (BERRY, {**BERRY, "category_id": 1, "keypoints": [0] * 15})
    dataset = read_picking_points(saved(tmp_path, record(*berries)), class_map=CLASSES)
    (image,) = dataset
    assert (image.path, image.size, image.extra) == (tmp_path / "a.png", (HEIGHT, WIDTH), {"image_id": 17})
    first, second = image.annotations
    assert (first.class_index, second.class_index) == (PLUCKABLE, UNPLUCKABLE)
    assert first.keypoints is not None
    assert first.visibility is not None
    assert first.visibility.tolist() == [2, 1, 2, 0, 2]
    assert first.keypoints[0].tolist() == [20, 2]
    # The picking point lies above the box, which is stretched to hold it.
    assert first.box.tolist() == [10, 2, 30, 31]
    assert first.segmentation is None
    # As in COCO, five zeros say that nobody marked the key-points.
    assert second.keypoints is None
    assert second.box.tolist() == [10, 8, 30, 31]


@pytest.mark.parametrize(
    ("box", "mode"),
    [
        ([10, 8, 30, 31], 0),
        ([10, 8, 30, 31], "BoxMode.XYXY_ABS"),
        ([10, 8, 30, 31], "<BoxMode.XYXY_ABS: 0>"),
        ([10, 8, 20, 23], 1),
        ([10, 8, 20, 23], "XYWH_ABS"),
        ([10 / 60, 8 / 40, 30 / 60, 31 / 40], 2),
        ([10 / 60, 8 / 40, 20 / 60, 23 / 40], 3),
    ],
)
def test_box_modes(tmp_path: Path, box: list[float], mode: Any) -> None:
    np.testing.assert_allclose(
        read_one(tmp_path, bbox=box, bbox_mode=mode, keypoints=None).box, [10, 8, 30, 31]
    )


def test_a_box_without_mode_is_corners(tmp_path: Path) -> None:
    berry = {name: value for name, value in BERRY.items() if name not in ("bbox_mode", "keypoints")}
    (image,) = read_picking_points(saved(tmp_path, record(berry)), class_map=CLASSES)
    assert image.annotations[0].box.tolist() == [10, 8, 30, 31]


@pytest.mark.parametrize(
    "keypoints",
    [
        [[20, 2, 2], [20, 10, 2], [20, 30, 2], [0, 0, 0], [30, 20, 2]],
        [20, 2, 20, 10, 20, 30, -1, -1, 30, 20],
        {"picking point": [20, 2], "top": [20, 10, 2], "Bottom": [20, 30], "right_grasp": [30, 20]},
    ],
)
def test_forms_of_keypoints(tmp_path: Path, keypoints: Any) -> None:
    annotation = read_one(tmp_path, keypoints=keypoints)
    assert annotation.keypoints is not None
    assert annotation.visibility is not None
    assert annotation.visibility.tolist() == [2, 2, 2, 0, 2]
    assert annotation.keypoints[[0, 1, 2, 4]].tolist() == [[20, 2], [20, 10], [20, 30], [30, 20]]


def test_hidden_by_something_else_is_kept(tmp_path: Path) -> None:
    annotation = read_one(tmp_path, keypoints=[*POINTS[:5], 3, *POINTS[6:]])
    assert annotation.visibility is not None
    assert annotation.visibility.tolist() == [2, 3, 2, 0, 2]


def test_outline_and_other_fields(tmp_path: Path) -> None:
    outline = [[10.0, 8, 30, 8, 30, 31]]
    annotation = read_one(tmp_path, segmentation=outline, iscrowd=1, weight_g=14.5, inspector="B")
    assert annotation.segmentation == outline
    assert annotation.crowd
    assert annotation.weight == 14.5
    assert annotation.extra == {"inspector": "B"}


def test_a_number_is_no_class_without_a_class_map(tmp_path: Path) -> None:
    path = saved(tmp_path, record(BERRY))
    with pytest.raises(FileFormatError, match=r"a\.json: annotation 0: class '0' is not known.*class_map"):
        read_picking_points(path)
    (image,) = read_picking_points(path, class_map={"0": "ignore"})
    assert image.annotations == ()


@pytest.mark.parametrize("field", ["category", "category_name", "class", "label", "ripeness"])
def test_a_name_goes_before_the_number(tmp_path: Path, field: str) -> None:
    annotation = read_one(tmp_path, **{field: "unripe"})
    assert annotation.class_index == UNPLUCKABLE
    assert annotation.extra["category_name"] == "unripe"
    assert read_one(tmp_path, ripeness=0.25).ripeness == 0.25


def test_a_folder_one_file_a_photograph(tmp_path: Path) -> None:
    """Without names in the files, photographs are those called like them, in a folder beside."""
    (tmp_path / "annotations").mkdir()
    (tmp_path / "images").mkdir()
    for name, level in (("7", 10), ("8", 20)):
        cv2.imwrite(str(tmp_path / "images" / f"{name}.jpg"), np.full((12, 34, 3), level, np.uint8))
        nameless = record(BERRY, file_name=None, height=None, width=None)
        saved(tmp_path / "annotations", nameless, f"{name}.json")
    assert guess_format(tmp_path / "annotations") == "picking-points"
    dataset = read_dataset(tmp_path / "annotations", class_map=CLASSES)
    assert [image.path.name for image in dataset] == ["7.jpg", "8.jpg"]
    assert [image.size for image in dataset] == [(12, 34)] * 2
    assert [image.annotations[0].id for image in dataset] == [1, 2]


@pytest.mark.parametrize("name", ["/home/somebody/train/a.png", "C:\\data\\a.png", "train/a.png"])
def test_paths_of_another_machine_give_way_to_the_photograph_beside(tmp_path: Path, name: str) -> None:
    (tmp_path / "img").mkdir()
    cv2.imwrite(str(tmp_path / "img" / "a.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    (image,) = read_picking_points(saved(tmp_path, [record(file_name=name)]))
    assert image.path == tmp_path / "img" / "a.png"


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bbox": [10, 8, 30]}, "bbox"),
        ({"bbox": [30, 8, 10, 31]}, "bbox_mode must be 1"),
        ({"bbox_mode": 4}, "XYWH_ABS"),
        ({"bbox_mode": "corners"}, "bbox_mode"),
        ({"category_id": "ripe?"}, "category_id"),
        ({"category_id": None}, "category_id"),
        ({"keypoints": POINTS[:12]}, "12 numbers"),
        ({"keypoints": [*POINTS[:2], 4, *POINTS[3:]]}, "0 … 3"),
        ({"keypoints": [*POINTS[:2], "x", *POINTS[3:]]}, "number"),
        ({"keypoints": {"top": [1]}}, "'top'"),
        ({"segmentation": [[1, 2, 3, 4]]}, "corners"),
    ],
)
def test_faults_are_told_with_file_and_annotation(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    path = saved(tmp_path, [record(), record(BERRY, {**BERRY, **changes})], "all.json")
    with pytest.raises(FileFormatError, match=r"all\.json: entry 1: annotation 1") as caught:
        read_picking_points(path, class_map=CLASSES)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (3, "object"),
        ({"file_name": "a.png"}, "annotations"),
        (record(height=0), "60×0 is not possible"),
        (record(file_name=5), "file_name"),
        (record(file_name="missing.png", height=None), "missing.png"),
    ],
)
def test_damaged_files(tmp_path: Path, data: Any, told: str) -> None:
    with pytest.raises(FileFormatError) as caught:
        read_picking_points(saved(tmp_path, data))
    assert told in str(caught.value)


def test_real_keypoints_come_through_as_they_are(shared_data: Path, tmp_path: Path) -> None:
    """StrawDI's published key-points, put into dictionaries, read the same as from COCO."""
    expected = read_strawdi(shared_data / "strawdi" / "test").subset(range(5))
    for image in expected:
        berries = []
        for annotation in image.annotations:
            berry: dict[str, Any] = {"bbox": annotation.box.tolist(), "bbox_mode": "BoxMode.XYXY_ABS"}
            berry["category_id"] = annotation.class_index
            if annotation.keypoints is not None and annotation.visibility is not None:
                table = np.column_stack((np.nan_to_num(annotation.keypoints), annotation.visibility))
                berry["keypoints"] = table.ravel().tolist()
            berries.append(berry)
        known = {"file_name": image.path.name, "height": image.height, "width": image.width}
        saved(tmp_path, {**known, "annotations": berries}, f"{image.path.stem}.json")
    found = read_picking_points(tmp_path, expected[0].path.parent, class_map=CLASSES)
    by_name = {image.path.name: image for image in expected}
    assert len(found) == len(expected)
    for image in found:
        other = by_name[image.path.name]
        assert len(image.annotations) == len(other.annotations) > 0
        for a, b in zip(image.annotations, other.annotations, strict=True):
            assert a.class_index == b.class_index
            np.testing.assert_allclose(a.box, b.box)
            assert (a.keypoints is None) == (b.keypoints is None)
            if a.keypoints is not None:
                np.testing.assert_array_equal(a.keypoints, b.keypoints)
                np.testing.assert_array_equal(a.visibility, b.visibility)
