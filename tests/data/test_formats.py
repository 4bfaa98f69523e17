"""Each format is guessed from what lies there, and read by its name."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.data.formats import FORMATS, guess_format, read_dataset
from punnet.errors import ConfigurationError, FileFormatError

IMAGE = {"id": 1, "file_name": "1.jpg", "width": 20, "height": 10}
BERRY = {"id": 1, "image_id": 1, "category_id": 1, "bbox": [2, 1, 6, 5], "label_index": 3}
COCO = {"images": [IMAGE], "annotations": [BERRY]}
PSD = {"info": {"hardness": []}, "images": [IMAGE], "annotations": [{**BERRY, "ripeness": 3, "hardness": 0}]}


def coco(folder: Path, name: str = "annotations.json") -> Path:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(json.dumps(COCO))
    return folder


def psd(folder: Path) -> Path:
    (folder / "coco.json").write_text(json.dumps(PSD))
    return folder


def strawdi(folder: Path) -> Path:
    for part in ("img", "label"):
        (folder / part).mkdir()
    cv2.imwrite(str(folder / "label" / "1.png"), np.full((10, 20), 3, np.uint8))
    (folder / "coco_keypoints.json").write_text(json.dumps(COCO))
    return folder


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (coco, "coco"),
        (lambda folder: coco(folder) / "annotations.json", "coco"),
        (lambda folder: coco(folder, "mine.json") / "mine.json", "coco"),
        (lambda folder: coco(folder, "annotations/annotations.json"), "coco"),
        (lambda folder: coco(folder, "detections.json"), "coco"),
        (lambda folder: coco(folder, "coco.json"), "coco"),
        (psd, "psd"),
        (strawdi, "strawdi"),
    ],
)
def test_format_is_guessed_and_read(tmp_path: Path, make, name: str) -> None:
    place = make(tmp_path)
    assert guess_format(place) == name
    for given in (None, name):
        (image,) = read_dataset(place, given)
        assert [annotation.id for annotation in image.annotations] == [1]


def test_class_map_reaches_the_reader(tmp_path: Path) -> None:
    data = {**COCO, "categories": [{"id": 1, "name": "erdbeere"}]}
    (tmp_path / "annotations.json").write_text(json.dumps(data))
    with pytest.raises(FileFormatError, match="erdbeere"):
        read_dataset(tmp_path)
    dataset = read_dataset(tmp_path, class_map={"erdbeere": "unpluckable"})
    assert dataset[0].annotations[0].class_index == 1
    with pytest.raises(ConfigurationError, match="purple"):
        read_dataset(tmp_path, class_map={"erdbeere": "purple"})


def test_every_format_has_its_own_name_and_a_line_about_it() -> None:
    assert {"coco", "psd", "strawdi"} <= FORMATS.keys()
    for name, known in FORMATS.items():
        assert known.name == name
        assert known.description


def test_what_nobody_knows_is_told_with_what_is_possible(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no labels")
    for place in (tmp_path, tmp_path / "notes.txt"):
        with pytest.raises(FileFormatError, match="strawdi") as caught:
            read_dataset(place)
        assert str(place) in str(caught.value)
        assert all(name in str(caught.value) for name in FORMATS)


def test_missing_path_and_unknown_name_are_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="nowhere: no such file"):
        read_dataset(tmp_path / "nowhere")
    with pytest.raises(ConfigurationError, match="no data format 'tiff'"):
        read_dataset(tmp_path, "tiff")


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_a_folder_without_the_format_raises_only_our_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "annotations.json").write_text("[1, 2")
    with pytest.raises(FileFormatError, match=tmp_path.name):
        read_dataset(tmp_path, name)
    with pytest.raises(FileFormatError):
        read_dataset(tmp_path)


def test_local_sets_are_recognised(shared_data: Path) -> None:
    assert guess_format(shared_data / "strawdi" / "test") == "strawdi"
    assert guess_format(shared_data / "psd" / "rh_train") == "psd"
