from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from punnet.data import read_psd
from punnet.errors import FileFormatError


def write_psd(folder: Path, *annotations: dict[str, Any]) -> Path:
    folder.mkdir(exist_ok=True)
    data = {
        "info": {"hardness": ["uncluttered"]},
        "images": [{"id": 3, "file_name": "3.jpg", "width": 20, "height": 10}],
        "annotations": list(annotations),
        "categories": [{"id": 1, "name": "strawberry"}],
    }
    (folder / "coco.json").write_text(json.dumps(data))
    return folder


def polygon(ripeness: Any, **changes: Any) -> dict[str, Any]:
    corners = [2.0, 1, 8, 1, 8, 6, 2, 6]
    entry = {"id": 7, "image_id": 3, "category_id": 1, "segmentation": [corners], "bbox": [2, 1, 6, 5]}
    return {**entry, "ripeness": ripeness, **changes}


@pytest.mark.parametrize(
    ("code", "class_index", "share", "stage"),
    [
        (0, 1, 0.0, "green"),
        (1, 1, 0.5, "turning"),
        (2, 0, 0.9, "turning"),
        (3, 0, 1.0, "ripe"),
        (4, 1, math.nan, "rotten"),
    ],
)
def test_ripeness_code_gives_class_share_and_stage(
    tmp_path: Path, code: int, class_index: int, share: float, stage: str
) -> None:
    (berry,) = read_psd(write_psd(tmp_path / "psd", polygon(code)))[0].annotations
    assert (berry.class_index, berry.stage) == (class_index, stage)
    assert berry.ripeness == pytest.approx(share, nan_ok=True)
    assert berry.extra["ripeness_code"] == code


@pytest.mark.parametrize(("code", "hidden"), [(0, 0.0), (1, 0.05), (2, 0.45), (3, 0.9), (4, math.nan)])
def test_hardness_gives_occlusion(tmp_path: Path, code: int, hidden: float) -> None:
    (berry,) = read_psd(write_psd(tmp_path / "psd", polygon(3, hardness=code)))[0].annotations
    assert berry.occlusion == pytest.approx(hidden, nan_ok=True)
    assert berry.extra["hardness"] == code


def test_polygon_mask_box_and_photograph(tmp_path: Path) -> None:
    image = read_psd(write_psd(tmp_path / "psd", polygon(3)))[0]
    expected = np.zeros((10, 20), bool)
    expected[1:6, 2:8] = True
    berries = image.berries()
    assert np.array_equal(berries.masks[0], expected)
    assert berries.boxes.tolist() == [[2, 1, 8, 6]]
    assert berries.keypoints is None
    assert berries.ids.tolist() == [7]
    assert image.path == tmp_path / "psd" / "img" / "3.jpg"


def test_image_without_annotations_is_empty(tmp_path: Path) -> None:
    assert [len(image.berries()) for image in read_psd(write_psd(tmp_path / "psd"))] == [0]


@pytest.mark.parametrize(
    "changes",
    [{"ripeness": "red"}, {"ripeness": 7}, {"hardness": 9}, {"bbox": [1, 2]}, {"segmentation": 4}],
)
def test_damaged_annotation_is_told(tmp_path: Path, changes: dict[str, Any]) -> None:
    with pytest.raises(FileFormatError, match=r"coco\.json: annotation 7"):
        read_psd(write_psd(tmp_path / "psd", {**polygon(3), **changes}))


def test_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"coco\.json: no such file"):
        read_psd(tmp_path)


def test_psd_training_set(shared_data: Path) -> None:
    dataset = read_psd(shared_data / "psd" / "rh_train")
    assert len(dataset) == 122
    classes = [annotation.class_index for image in dataset for annotation in image.annotations]
    assert (classes.count(0), classes.count(1)) == (633, 851)
    file = json.loads((shared_data / "psd" / "rh_train" / "coco.json").read_text())
    areas = {entry["id"]: entry["area"] for entry in file["annotations"]}
    image = dataset[0]
    for annotation, mask in zip(image.annotations, image.masks(image.annotations), strict=True):
        assert mask.sum() == pytest.approx(areas[annotation.id], rel=0.1)
