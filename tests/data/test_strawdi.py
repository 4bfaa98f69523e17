from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import read_strawdi
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE


def write_labels(folder: Path, name: str = "8") -> Path:
    for part in ("img", "label"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    labels = np.zeros((10, 20), np.uint8)
    labels[4:9, 3:7] = 5
    labels[1:3, 12:18] = 9
    cv2.imwrite(str(folder / "label" / f"{name}.png"), labels)
    cv2.imwrite(str(folder / "img" / f"{name}.jpg"), np.zeros((10, 20, 3), np.uint8))
    return folder


def write_strawdi(folder: Path, **changes: Any) -> Path:
    write_labels(folder)
    annotation = {
        "id": 1,
        "image_id": 8,
        "category_id": 1,
        "label_index": 5,
        "bbox": [3, 4, 4, 5],
        "keypoints": [5, 1, 1, 5, 4, 2, 5, 8, 2, 0, 0, 0, 6, 6, 2],
        "ripeness3": "partially_ripe",
        **changes,
    }
    bare = {"id": 2, "image_id": 8, "category_id": 2, "label_index": 9, "bbox": [12, 1, 6, 2]}
    image = {"id": 8, "file_name": "8.jpg", "width": 20, "height": 10}
    data = {
        "images": [image],
        "annotations": [annotation, {**bare, "keypoints": [0.0] * 15}],
        "categories": [],
    }
    (folder / "coco_keypoints.json").write_text(json.dumps(data))
    return folder


def test_label_image_and_keypoints(tmp_path: Path) -> None:
    image = read_strawdi(write_strawdi(tmp_path / "strawdi"))[0]
    berries = image.berries()
    assert berries.masks.sum(axis=(1, 2)).tolist() == [20, 12]
    assert berries.classes.tolist() == [PLUCKABLE, UNPLUCKABLE]
    assert berries.visibility[0].tolist() == [1, 2, 2, 0, 2]
    assert np.isnan(berries.keypoints[0, 3]).all()
    # The picking point lies above the fruit: the box is stretched to hold it.
    assert berries.boxes[0].tolist() == [3, 1, 7, 9]
    assert image.path == tmp_path / "strawdi" / "img" / "8.jpg"


def test_zeros_are_keypoints_that_nobody_annotated(tmp_path: Path) -> None:
    assert read_strawdi(write_strawdi(tmp_path / "strawdi"))[0].annotations[1].keypoints is None


def test_three_classes_of_ripeness_are_used_and_kept(tmp_path: Path) -> None:
    berry, unknown = read_strawdi(write_strawdi(tmp_path / "strawdi"))[0].annotations
    assert (berry.stage, berry.ripeness) == ("turning", 0.5)
    assert berry.extra == {"label_index": 5, "ripeness3": "partially_ripe"}
    assert unknown.stage is None
    assert np.isnan(unknown.ripeness)


def test_labels_alone_need_a_class(tmp_path: Path) -> None:
    folder = write_labels(write_labels(tmp_path / "strawdi", "2"), "11")
    with pytest.raises(FileFormatError, match="strawberry"):
        read_strawdi(folder)
    dataset = read_strawdi(folder, class_map={"strawberry": "unpluckable"})
    assert [image.path.name for image in dataset] == ["11.jpg", "2.jpg"]
    assert [annotation.id for image in dataset for annotation in image.annotations] == [1, 2, 3, 4]
    berries = dataset[1].berries()
    assert berries.boxes.tolist() == [[3, 4, 7, 9], [12, 1, 18, 3]]
    assert berries.masks.sum(axis=(1, 2)).tolist() == [20, 12]
    assert berries.classes.tolist() == [UNPLUCKABLE] * 2


def test_missing_label_image_is_told(tmp_path: Path) -> None:
    folder = write_strawdi(tmp_path / "strawdi")
    (folder / "label" / "8.png").unlink()
    with pytest.raises(FileFormatError, match=r"8\.png.*missing"):
        read_strawdi(folder)[0].berries()


def test_missing_label_image_is_told_without_keypoints_too(tmp_path: Path) -> None:
    folder = write_labels(tmp_path / "strawdi")
    (folder / "label" / "8.png").write_text("no image")
    with pytest.raises(FileFormatError, match=r"8\.png"):
        read_strawdi(folder, class_map={"strawberry": "pluckable"})


def test_another_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="not StrawDI"):
        read_strawdi(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"label_index": "five"},
        {"label_index": None},
        {"category_id": None},
        {"keypoints": [1, 2]},
        {"bbox": 4},
    ],
)
def test_damaged_annotation_is_told(tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(FileFormatError, match=r"coco_keypoints\.json: annotation 1"):
        read_strawdi(write_strawdi(tmp_path / "strawdi", **changes))


def test_strawdi_test_set(shared_data: Path) -> None:
    folder = shared_data / "strawdi" / "test"
    dataset = read_strawdi(folder)
    assert (len(dataset), sum(len(image.annotations) for image in dataset)) == (200, 1132)
    image = dataset[0]
    assert image.path.is_file()
    file = json.loads((folder / "coco_keypoints.json").read_text())
    areas = {entry["id"]: entry["area"] for entry in file["annotations"]}
    for annotation, mask in zip(image.annotations, image.masks(image.annotations), strict=True):
        assert mask.sum() == areas[annotation.id]
