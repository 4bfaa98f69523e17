"""YOLO: what Ultralytics, Roboflow and Punnet write is read; what is written is read again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data import (
    AnnotatedImage,
    Annotation,
    Dataset,
    read_dataset,
    read_strawdi,
    read_yolo,
    write_yolo,
)
from punnet.data.formats import guess_format
from punnet.data.yolo_writer import YoloTask
from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError
from punnet.scene import PLUCKABLE, UNPLUCKABLE
from punnet.scene.masks import encode_mask

HEIGHT, WIDTH = 40, 80


def photograph(path: Path, height: int = HEIGHT, width: int = WIDTH) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.zeros((height, width, 3), np.uint8))
    return path


def yolo(folder: Path, lines: str, yaml: str = "names: [ripe, unripe]\ntrain: images\n") -> Path:
    photograph(folder / "images" / "a.png")
    (folder / "labels").mkdir()
    (folder / "labels" / "a.txt").write_text(lines)
    if yaml:
        (folder / "data.yaml").write_text(yaml)
    return folder


def test_boxes_are_partial_labels(tmp_path: Path) -> None:
    (image,) = read_yolo(yolo(tmp_path, "0 0.5 0.5 0.25 0.5\n\n1 0.1 0.1 0.1 0.1 0.75\n"))
    assert (image.width, image.height) == (WIDTH, HEIGHT)
    first, second = image.annotations
    assert first.box.tolist() == [30, 10, 50, 30]
    assert (first.class_index, first.segmentation, first.keypoints) == (PLUCKABLE, None, None)
    assert (second.class_index, second.extra) == (UNPLUCKABLE, {"score": 0.75})
    assert image.extra == {"split": "train"}
    assert image.berries().masks is None


def test_outlines(tmp_path: Path) -> None:
    (image,) = read_yolo(yolo(tmp_path, "0 0.25 0.25 0.5 0.25 0.5 0.75 0.25 0.75"))
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[10:30, 20:40] = True
    assert np.array_equal(image.mask(0), expected)


POSE = "0 .5 .5 .2 .4 .5 .2 1 .5 .3 2 .5 .7 2 0 0 0 .6 .5 2"


@pytest.mark.parametrize("yaml", ["", "train: images\nnames: [ripe]\nkpt_shape: [5, 3]\n"])
def test_poses(tmp_path: Path, yaml: str) -> None:
    (image,) = read_yolo(yolo(tmp_path, POSE, yaml), class_map={"0": "pluckable"})
    (berry,) = image.annotations
    assert berry.visibility.tolist() == [1, 2, 2, 0, 2]
    assert berry.keypoints[0].tolist() == [40, 8]
    assert np.isnan(berry.keypoints[3]).all()
    assert berry.box.tolist() == pytest.approx([32, 8, 48, 28])


def test_poses_without_visibility_and_in_another_order(tmp_path: Path) -> None:
    yaml = (
        "train: images\nnames: [ripe]\nkpt_shape: [5, 2]\n"
        "kpt_names: {0: [top, picking point, Bottom, left-grasp, right_grasp]}\n"
    )
    line = "0 .5 .5 .2 .4 .5 .3 .5 .2 .5 .7 0 0 .6 .5"
    (berry,) = read_yolo(yolo(tmp_path, line, yaml))[0].annotations
    assert berry.visibility.tolist() == [2, 2, 2, 0, 2]
    assert berry.keypoints[0].tolist() == [40, 8]
    assert berry.keypoints[1].tolist() == [40, 12]


def test_parts_and_the_ways_to_name_them(tmp_path: Path) -> None:
    for place in ("train/images/a.png", "train/images/b.png", "valid/images/c.png", "test/images/d.png"):
        label = photograph(tmp_path / place).with_suffix(".txt")
        label = Path(str(label).replace("images", "labels"))
        label.parent.mkdir(parents=True, exist_ok=True)
        label.write_text("0 .5 .5 .1 .1")
    (tmp_path / "list.txt").write_text("./test/images/d.png\n")
    (tmp_path / "data.yaml").write_text(
        "train: ../train/images\nval: [valid/images]\ntest: list.txt\nnames: {0: ripe}\n"
    )
    dataset = read_yolo(tmp_path / "data.yaml")
    assert [(image.path.name, image.extra["split"]) for image in dataset] == [
        ("a.png", "train"),
        ("b.png", "train"),
        ("c.png", "val"),
        ("d.png", "test"),
    ]
    assert all(len(image.annotations) == 1 for image in dataset)
    assert [image.id for image in dataset] == [1, 2, 3, 4]


def test_folders_without_yaml(tmp_path: Path) -> None:
    for part in ("train", "val"):
        photograph(tmp_path / "images" / part / f"{part}.png")
    (tmp_path / "labels" / "train").mkdir(parents=True)
    (tmp_path / "labels" / "train" / "train.txt").write_text("3 .5 .5 .1 .1")
    assert guess_format(tmp_path) == "yolo"
    dataset = read_dataset(tmp_path, class_map={"3": "unpluckable"})
    assert [(image.extra["split"], len(image.annotations)) for image in dataset] == [("train", 1), ("val", 0)]


def test_a_class_number_goes_before_its_wrong_name(tmp_path: Path) -> None:
    folder = yolo(tmp_path, "0 .5 .5 .1 .1", "train: images\nnames: [unripe]\n")
    assert read_yolo(folder)[0].annotations[0].class_index == UNPLUCKABLE
    assert read_yolo(folder, class_map={"0": "pluckable"})[0].annotations[0].class_index == PLUCKABLE
    assert read_yolo(folder, class_map={"unripe": "ignore"})[0].annotations == ()


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("2 .5 .5 .1 .1", r"a\.txt, line 1.*'2'"),
        ("0 .5 .5 .1 .1\n0 .5 .5 .1", r"line 2.*4 numbers"),
        ("0 .5 .5 .1 nan", r"line 1.*number"),
        ("zero .5 .5 .1 .1", r"line 1.*number"),
        ("0.5 .5 .5 .1 .1", r"line 1.*whole"),
        ("0 .5 .5 -.1 .1", "box"),
        (POSE.replace(" 1 ", " 7 "), "visibility"),
        ("0 .5 .5 .5 .5 .5 1e9", r"line 1"),
        ("0 " + "1e300 " * 6, r"line 1"),
    ],
)
def test_damaged_lines_are_told(tmp_path: Path, lines: str, told: str) -> None:
    with pytest.raises(FileFormatError, match=told):
        read_yolo(yolo(tmp_path, lines))


@pytest.mark.parametrize(
    ("yaml", "told"),
    [
        ("[1, 2]", "object"),
        ("a: [", "YAML"),
        ("names: [ripe]", "none of train"),
        ("train: nowhere\nnames: [ripe]", "no photographs at"),
        ("train: images\nnames: ripe", "names"),
        ("train: images\nnames: [ripe]\nkpt_shape: [17, 3]", "kpt_shape"),
        (
            "train: images\nnames: [ripe]\nkpt_shape: [5, 3]\nkpt_names: {0: [nose, eye, ear, arm, leg]}",
            "nose",
        ),
        ("train: 3\nnames: [ripe]", "name of a file"),
        ("date: 2001-99-99", "YAML"),
    ],
)
def test_damaged_yaml_is_told(tmp_path: Path, yaml: str, told: str) -> None:
    with pytest.raises(FileFormatError, match=told):
        read_yolo(yolo(tmp_path, "0 .5 .5 .1 .1", yaml))


def test_what_is_not_yolo_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"data\.yaml is needed"):
        read_yolo(tmp_path)
    (tmp_path / "images").mkdir()
    (tmp_path / "labels").mkdir()
    with pytest.raises(FileFormatError, match="no photographs in"):
        read_yolo(tmp_path)
    (tmp_path / "images" / "a.png").write_text("no image")
    with pytest.raises(FileFormatError, match=r"a\.png.*not an image"):
        read_yolo(tmp_path)


POINTS = np.array([[30.0, 4], [30, 8], [30, 28], [20, 18], [np.nan, np.nan]])


def dataset(folder: Path, *annotations: Annotation) -> Dataset:
    path = photograph(folder / "photographs" / "a.png")
    return Dataset((AnnotatedImage(1, path, WIDTH, HEIGHT, annotations),))


def berry(number: int = 1, **changes: Any) -> Annotation:
    return Annotation(
        **{"id": number, "class_index": number % 2, "box": np.array([20.0, 8, 40, 28]), **changes}
    )


@settings(deadline=None, max_examples=40)
@given(
    centre=st.tuples(st.floats(12, 68), st.floats(12, 28)),
    axes=st.tuples(st.floats(4, 12), st.floats(4, 12)),
)
def test_masks_come_back(tmp_path_factory: pytest.TempPathFactory, centre: Any, axes: Any) -> None:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    mask = ((u - centre[0]) / axes[0]) ** 2 + ((v - centre[1]) / axes[1]) ** 2 <= 1
    folder = tmp_path_factory.mktemp("yolo")
    lost = losses(dataset(folder, berry(segmentation=encode_mask(mask))), folder / "out", "segment")
    assert lost == []
    (image,) = read_yolo(folder / "out")
    found = image.mask(0)
    assert (found & mask).sum() / (found | mask).sum() > 0.98
    assert image.annotations[0].class_index == UNPLUCKABLE


def losses(source: Dataset, folder: Path, task: YoloTask) -> list[str]:
    """What was lost of a set without ``val``, beside that."""
    *lost, _ = write_yolo(source, folder, task)
    return lost


def test_keypoints_come_back(tmp_path: Path) -> None:
    source = dataset(tmp_path, berry(keypoints=POINTS, visibility=np.array([3, 2, 1, 2, 0])), berry(2))
    lost = losses(source, tmp_path / "out", "pose")
    assert lost == [
        "1 × hidden by something else, written as hidden (1)",
        "1 × without key-points, written as absent",
    ]
    first, second = read_yolo(tmp_path / "out")[0].annotations
    assert first.visibility.tolist() == [1, 2, 1, 2, 0]
    assert first.keypoints == pytest.approx(POINTS, abs=1e-3, nan_ok=True)
    assert first.box.tolist() == pytest.approx([20, 4, 40, 28], abs=1e-3)
    assert second.class_index == PLUCKABLE
    assert second.keypoints is None


def test_parts_and_holes_of_a_mask_are_joined(tmp_path: Path) -> None:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[5:15, 10:20] = mask[5:25, 30:50] = mask[30, 60] = True
    mask[8:12, 35:40] = mask[20, 45] = False
    lost = losses(dataset(tmp_path, berry(segmentation=encode_mask(mask))), tmp_path / "out", "segment")
    assert lost == ["1 × mask of several parts or with holes, joined by lines without width"]
    found = read_yolo(tmp_path / "out")[0].mask(0)
    assert found is not None
    assert (found == mask).all()


def test_what_yolo_does_not_hold_is_told(tmp_path: Path) -> None:
    full = berry(
        1,
        keypoints=POINTS + np.array([60.0, 0]),
        visibility=np.array([2, 2, 2, 2, 0]),
        ripeness=0.5,
        occlusion=0.1,
        weight=12.0,
        stage="ripe",
        keypoint_depths=np.full(5, 0.4),
        extra={"score": 0.5},
        segmentation=[[20.0, 8, 40, 8, 40, 28]],
    )
    source = dataset(tmp_path, full, berry(2, crowd=True))
    pose = "\n".join(write_yolo(source, tmp_path / "pose", "pose"))
    segment = "\n".join(write_yolo(source, tmp_path / "segment", "segment"))
    for text in (pose, segment):
        for word in ("crowd", "ripeness", "occlusion", "weight", "stage", "depths", "other fields"):
            assert f"1 × {word}" in text
    assert "outside of the image" in pose
    assert "mask, not written" in pose
    assert "key-points, not written" in segment
    values = [float(word) for word in (tmp_path / "pose/labels/train/a.txt").read_text().split()]
    # Ultralytics throws away a whole photograph with one number outside of 0 … 1 (flags are up to 2).
    shares = values[1:5] + [value for k, value in enumerate(values[5:]) if k % 3 != 2]
    assert all(0 <= value <= 1 for value in shares)
    assert len(read_yolo(tmp_path / "segment")[0].annotations) == 1


def test_photographs_of_one_name_are_kept_apart(tmp_path: Path) -> None:
    images = tuple(
        AnnotatedImage(n, photograph(tmp_path / str(n) / f"a.{suffix}"), WIDTH, HEIGHT, (berry(n),))
        for n, suffix in enumerate(("png", "png", "jpg"))
    )
    write_yolo({"train": Dataset(images[:2]), "val": Dataset(images[2:])}, tmp_path / "out", "segment")
    found = read_yolo(tmp_path / "out")
    assert sorted(image.path.name for image in found) == ["a-2.png", "a.jpg", "a.png"]
    assert [image.extra["split"] for image in found] == ["train", "train", "val"]
    assert all(len(image.annotations) == 1 for image in found)


def test_without_val_the_images_of_train_stand_in_and_it_is_said(tmp_path: Path) -> None:
    source = dataset(tmp_path, berry(segmentation=[[20.0, 8, 40, 8, 40, 28]]))
    (said,) = write_yolo(source, tmp_path / "alone", "segment")
    assert "no part val" in said
    assert "val: images/train" in (tmp_path / "alone" / "data.yaml").read_text()
    assert write_yolo({"train": source, "val": source}, tmp_path / "both", "segment") == []
    assert "val: images/val" in (tmp_path / "both" / "data.yaml").read_text()


def test_parts_that_were_read_are_written_again(tmp_path: Path) -> None:
    source = dataset(tmp_path, berry(segmentation=[[20.0, 8, 40, 8, 40, 28]]))
    parts = {"val": source, "train": source, "test": source}
    write_yolo(parts, tmp_path / "first", "segment")
    assert write_yolo(read_yolo(tmp_path / "first"), tmp_path / "again", "segment") == []
    assert sorted(image.extra["split"] for image in read_yolo(tmp_path / "again")) == ["test", "train", "val"]


def test_writing_is_whole_and_overwrites_nothing(tmp_path: Path) -> None:
    source = dataset(tmp_path, berry())
    write_yolo(source, tmp_path / "out", "segment")
    with pytest.raises(OutputExistsError):
        write_yolo(source, tmp_path / "out", "pose")
    write_yolo(source, tmp_path / "out", "pose", force=True)
    assert "kpt_shape" in (tmp_path / "out" / "data.yaml").read_text()
    source[0].path.unlink()
    with pytest.raises(FileFormatError, match=r"a\.png.*copied"):
        write_yolo(source, tmp_path / "other", "segment")
    assert not (tmp_path / "other").exists()
    for parts, task in (({}, "pose"), ({"all": source}, "pose"), (source, "boxes")):
        with pytest.raises(ConfigurationError):
            write_yolo(parts, tmp_path / "other", task)


def test_strawdi_there_and_back(shared_data: Path, tmp_path: Path) -> None:
    source = read_strawdi(shared_data / "strawdi" / "test").subset(range(3))
    write_yolo(source, tmp_path / "segment", "segment")
    write_yolo(source, tmp_path / "pose", "pose")
    masks = {image.path.name: image for image in read_yolo(tmp_path / "segment")}
    poses = {image.path.name: image for image in read_yolo(tmp_path / "pose")}
    for image in source:
        for index, annotation in enumerate(image.annotations):
            mask, found = image.mask(index), masks[image.path.name].mask(index)
            assert (mask & found).sum() / (mask | found).sum() > 0.99
            pose = poses[image.path.name].annotations[index]
            assert pose.class_index == annotation.class_index
            assert pose.box == pytest.approx(annotation.box, abs=0.01)
            if annotation.keypoints is not None:
                assert pose.keypoints == pytest.approx(annotation.keypoints, abs=0.01, nan_ok=True)
                assert pose.visibility.tolist() == annotation.visibility.tolist()


def test_boxes_of_field_photographs(shared_data: Path) -> None:
    folder = shared_data / "straw_detect" / "test"
    with pytest.raises(FileFormatError, match="class '0' is not known"):
        read_dataset(folder)
    dataset = read_dataset(folder, class_map={"0": "pluckable"})
    assert len(dataset) == 58
    assert sum(len(image.annotations) for image in dataset) == 255
