from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import detections_to_coco, read_psd, read_strawdi
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Strawberries
from punnet.scene.masks import decode_mask


def write_psd(folder: Path, annotations: list[dict[str, Any]]) -> Path:
    folder.mkdir(exist_ok=True)
    data = {
        "images": [{"id": 3, "file_name": "3.jpg", "width": 20, "height": 10}],
        "annotations": annotations,
        "categories": [{"id": 1, "name": "strawberry"}],
    }
    (folder / "coco.json").write_text(json.dumps(data))
    return folder


def polygon(ripeness: int, **changes: Any) -> dict[str, Any]:
    corners = [2.0, 1, 8, 1, 8, 6, 2, 6]
    entry = {"id": 7, "image_id": 3, "category_id": 1, "segmentation": [corners], "bbox": [2, 1, 6, 5]}
    return {**entry, "ripeness": ripeness, **changes}


def write_strawdi(folder: Path) -> Path:
    (folder / "label").mkdir(parents=True)
    labels = np.zeros((10, 20), np.uint8)
    labels[4:9, 3:7] = 5
    cv2.imwrite(str(folder / "label" / "8.png"), labels)
    annotation = {
        "id": 1,
        "image_id": 8,
        "category_id": 1,
        "label_index": 5,
        "bbox": [3, 4, 4, 5],
        "keypoints": [5, 1, 1, 5, 4, 2, 5, 8, 2, 0, 0, 0, 6, 6, 2],
    }
    image = {"id": 8, "file_name": "8.jpg", "width": 20, "height": 10}
    data = {"images": [image], "annotations": [annotation], "categories": []}
    (folder / "coco_keypoints.json").write_text(json.dumps(data))
    return folder


@pytest.mark.parametrize(("ripeness", "expected"), [(0, 1), (1, 1), (2, 0), (3, 0), (4, 1)])
def test_psd_class_by_ripeness(tmp_path: Path, ripeness: int, expected: int) -> None:
    item = read_psd(write_psd(tmp_path / "psd", [polygon(ripeness)]))[0]
    assert item.berries.classes.tolist() == [expected]


def test_psd_polygon_mask_and_box(tmp_path: Path) -> None:
    item = read_psd(write_psd(tmp_path / "psd", [polygon(3)]))[0]
    expected = np.zeros((10, 20), bool)
    expected[1:6, 2:8] = True
    assert np.array_equal(item.berries.masks[0], expected)
    assert item.berries.boxes.tolist() == [[2, 1, 8, 6]]
    assert item.berries.keypoints is None
    assert item.berries.ripeness.tolist() == [1.0]
    assert item.berries.ids.tolist() == [7]
    assert item.image_path == tmp_path / "psd" / "img" / "3.jpg"


def test_image_without_annotations_is_empty(tmp_path: Path) -> None:
    dataset = read_psd(write_psd(tmp_path / "psd", []))
    assert [len(item.berries) for item in dataset] == [0]


def test_strawdi_label_image_and_keypoints(tmp_path: Path) -> None:
    berries = read_strawdi(write_strawdi(tmp_path / "strawdi"))[0].berries
    assert berries.masks[0].sum() == 20
    assert berries.classes.tolist() == [PLUCKABLE]
    assert berries.visibility.tolist() == [[1, 2, 2, 0, 2]]
    assert np.isnan(berries.keypoints[0, 3]).all()
    # The picking point lies above the fruit: the box is stretched to hold it.
    assert berries.boxes.tolist() == [[3, 1, 7, 9]]


def test_missing_label_image_is_told(tmp_path: Path) -> None:
    folder = write_strawdi(tmp_path / "strawdi")
    (folder / "label" / "8.png").unlink()
    with pytest.raises(FileFormatError, match=r"8\.png.*missing"):
        read_strawdi(folder)[0]


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"images": 3, "annotations": []}', '{"images": [{}], "annotations": []}']
)
def test_damaged_file_is_told(tmp_path: Path, text: str) -> None:
    (tmp_path / "coco.json").write_text(text)
    with pytest.raises(FileFormatError, match=r"coco\.json"):
        read_psd(tmp_path)


def test_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        read_psd(tmp_path)


@pytest.mark.parametrize("changes", [{"ripeness": "red"}, {"bbox": [1, 2]}, {"segmentation": 4}])
def test_damaged_annotation_is_told(tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(FileFormatError, match="image 3"):
        read_psd(write_psd(tmp_path / "psd", [{**polygon(3), **changes}]))[0]


def test_annotation_of_an_unlisted_image_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="not listed"):
        read_psd(write_psd(tmp_path / "psd", [polygon(3, image_id=99)]))


def test_detections_keep_everything_coco_can_say() -> None:
    mask = np.zeros((1, 10, 20), bool)
    mask[0, 4:9, 3:7] = True
    points = np.array([[[5.0, 1], [5, 4], [5, 8], [np.nan, np.nan], [6, 6]]])
    berries = Strawberries(
        image_size=(10, 20),
        boxes=np.array([[3.0, 1, 7, 9]]),
        scores=np.array([0.75]),
        classes=np.array([UNPLUCKABLE]),
        masks=mask,
        keypoints=points,
        visibility=np.array([[3, 2, 1, 0, 2]]),
        ripeness=np.array([0.25]),
        weights=np.array([12.0]),
    )
    data = json.loads(
        json.dumps(detections_to_coco([(4, "a.jpg", berries), (5, "b.jpg", Strawberries.empty((9, 9)))]))
    )
    assert [image["id"] for image in data["images"]] == [4, 5]
    (entry,) = data["annotations"]
    assert (entry["category_id"], entry["image_id"], entry["score"]) == (2, 4, 0.75)
    assert entry["bbox"] == [3, 1, 4, 8]
    assert entry["area"] == 20
    assert np.array_equal(decode_mask(entry["segmentation"]), mask[0])
    assert entry["keypoints"] == [5, 1, 1, 5, 4, 2, 5, 8, 1, 0, 0, 0, 6, 6, 2]
    assert entry["num_keypoints"] == 4
    assert entry["visibility_detail"] == [3, 2, 1, 0, 2]
    assert (entry["ripeness"], entry["weight_g"]) == (0.25, 12.0)


def test_strawdi_test_set(shared_data: Path) -> None:
    dataset = read_strawdi(shared_data / "strawdi" / "test")
    assert len(dataset) == 200
    assert sum(len(entries) for entries in dataset.annotations.values()) == 1132
    item = dataset[0]
    assert item.image_path.is_file()
    for annotation, mask in zip(dataset.annotations[item.image_id], item.berries.masks, strict=True):
        assert mask.sum() == annotation["area"]


def test_psd_training_set(shared_data: Path) -> None:
    dataset = read_psd(shared_data / "psd" / "rh_train")
    assert len(dataset) == 122
    item = dataset[0]
    for annotation, mask in zip(dataset.annotations[item.image_id], item.berries.masks, strict=True):
        assert mask.sum() == pytest.approx(annotation["area"], rel=0.1)
