from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset, LabelPixels
from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import PLUCKABLE, UNPLUCKABLE
from punnet.scene.masks import encode_mask

HEIGHT, WIDTH = 12, 20
BOX = np.array([4.0, 5, 9, 11])
POINTS = np.array([[6.0, 2], [6, 5], [6, 11], [np.nan, np.nan], [9, 8]])
CODES = np.array([3, 2, 1, 0, 2])


def annotation(number: int = 1, **changes: Any) -> Annotation:
    return Annotation(**{"id": number, "class_index": PLUCKABLE, "box": BOX, **changes})


def image(
    *annotations: Annotation, number: int = 1, path: Path = Path("a.png"), **changes: Any
) -> AnnotatedImage:
    return AnnotatedImage(number, path, WIDTH, HEIGHT, annotations, **changes)


def rectangle(left: int, top: int, right: int, bottom: int) -> np.ndarray:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top:bottom, left:right] = True
    return mask


def test_box_is_stretched_to_hold_the_keypoints() -> None:
    assert annotation(keypoints=POINTS, visibility=CODES).box.tolist() == [4, 2, 9, 11]


@settings(deadline=None, max_examples=100)
@given(
    st.lists(st.floats(-50, 50), min_size=10, max_size=10),
    st.lists(st.integers(0, 3), min_size=5, max_size=5),
)
def test_box_always_holds_its_keypoints(values: list[float], codes: list[int]) -> None:
    points = np.array(values).reshape(5, 2)
    points[np.array(codes) == 0] = np.nan
    box = annotation(keypoints=points, visibility=np.array(codes)).box
    known = points[np.array(codes) > 0]
    assert (known >= box[:2]).all()
    assert (known <= box[2:]).all()
    assert (box[:2] <= BOX[:2]).all()
    assert (box[2:] >= BOX[2:]).all()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"class_index": 2}, "class"),
        ({"box": [1, 2, 3]}, "box"),
        ({"box": [5, 5, 4, 6]}, "box"),
        ({"box": [np.nan, 0, 1, 1]}, "box"),
        ({"box": "box"}, "box"),
        ({"keypoints": POINTS}, "go together"),
        ({"keypoints": POINTS[:4], "visibility": CODES}, "keypoints"),
        ({"keypoints": POINTS, "visibility": [2, 2, 2, 2, 2]}, "absent"),
        ({"keypoints": POINTS, "visibility": [3, 2, 1, 0, 4]}, "visibility"),
        ({"ripeness": 1.1}, "ripeness"),
        ({"occlusion": -0.1}, "occlusion"),
        ({"weight": -3.0}, "weight"),
        ({"stage": "blue"}, "stage"),
        ({"keypoint_depths": [1.0]}, "keypoint_depths"),
    ],
)
def test_impossible_annotations_are_refused(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(ShapeError, match=f"annotation 1.*{told}"):
        annotation(**changes)


@pytest.mark.parametrize(
    "segmentation",
    [
        [[4, 5, 9, 5]],
        [[4, 5, 9, 5, 9]],
        [[4, 5, 9, 5, 9, float("nan")]],
        [[4, 5, 9, 5, 9, 1e30]],
        [["x", 5, 9, 5, 9, 8]],
        {"size": [WIDTH, HEIGHT], "counts": [WIDTH * HEIGHT]},
        {"size": [HEIGHT, WIDTH], "counts": [3]},
        {"size": [HEIGHT, WIDTH], "counts": "~~~"},
        {"size": [HEIGHT, WIDTH]},
        [],
        "mask",
    ],
)
def test_damaged_outlines_are_refused(segmentation: Any) -> None:
    with pytest.raises(ShapeError, match=r"annotation 7.*segmentation"):
        image(annotation(7, segmentation=segmentation))


def test_the_same_mask_however_it_is_written(tmp_path: Path) -> None:
    mask = rectangle(4, 5, 9, 11)
    labels = np.zeros((HEIGHT, WIDTH), np.uint8)
    labels[mask], labels[0, 0] = 3, 7
    cv2.imwrite(str(tmp_path / "a.png"), labels)
    compressed = encode_mask(mask)
    flat = mask.ravel(order="F")
    edges = [0, *(np.flatnonzero(flat[1:] != flat[:-1]) + 1), flat.size]
    forms = [
        [[4, 5, 9, 5, 9, 11, 4, 11]],
        compressed,
        {**compressed, "counts": compressed["counts"].encode()},
        {"size": [HEIGHT, WIDTH], "counts": np.diff(edges).tolist()},
        LabelPixels(tmp_path / "a.png", 3),
    ]
    made = image(*(annotation(n, segmentation=form) for n, form in enumerate(forms)))
    for index in range(len(forms)):
        assert np.array_equal(made.mask(index), mask), index
    assert all(np.array_equal(found, mask) for found in made.masks(made.annotations))


def test_label_image_that_changes_is_read_again(tmp_path: Path) -> None:
    labelled = image(annotation(segmentation=LabelPixels(tmp_path / "a.png", 3)))
    with pytest.raises(FileFormatError, match=r"a\.png.*missing"):
        labelled.mask(0)
    cv2.imwrite(str(tmp_path / "a.png"), np.full((HEIGHT, WIDTH), 3, np.uint8))
    assert labelled.mask(0).all()
    cv2.imwrite(str(tmp_path / "b.png"), np.zeros((HEIGHT, WIDTH), np.uint8))
    (tmp_path / "b.png").replace(tmp_path / "a.png")
    assert not labelled.mask(0).any()
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((HEIGHT, WIDTH + 1), np.uint8))
    with pytest.raises(FileFormatError, match=r"a\.png.*shape"):
        labelled.mask(0)


def test_berries_leave_out_crowd_and_fill_in_what_is_missing() -> None:
    berries = image(
        annotation(4, segmentation=encode_mask(rectangle(4, 5, 9, 11)), extra={"score": 0.25}, weight=12.0),
        annotation(5, crowd=True),
        annotation(9, class_index=UNPLUCKABLE, keypoints=POINTS, visibility=CODES, ripeness=0.5),
    ).berries()
    assert berries.ids.tolist() == [4, 9]
    assert berries.classes.tolist() == [PLUCKABLE, UNPLUCKABLE]
    assert berries.masks.sum(axis=(1, 2)).tolist() == [30, 0]
    assert np.isnan(berries.keypoints[0]).all()
    assert berries.visibility.tolist() == [[0] * 5, CODES.tolist()]
    assert np.array_equal(berries.keypoints[1], POINTS, equal_nan=True)
    assert berries.scores.tolist() == [0.25, 1]
    assert berries.weights[0] == 12
    assert np.isnan(berries.weights[1])
    assert berries.ripeness[1] == 0.5


def test_berries_without_masks_or_keypoints_say_so() -> None:
    berries = image(annotation()).berries()
    assert (berries.masks, berries.keypoints, berries.visibility) == (None, None, None)
    assert len(image(annotation(crowd=True)).berries()) == 0
    assert image().berries().image_size == (HEIGHT, WIDTH)


def test_frame_has_depth_camera_and_pose(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((HEIGHT, WIDTH, 3), (10, 20, 30), np.uint8))
    cv2.imwrite(str(tmp_path / "d.png"), np.full((HEIGHT, WIDTH), 400, np.uint16))
    camera = CameraIntrinsics(WIDTH, HEIGHT, 15.0, 15.0, 9.5, 5.5)
    pose = np.eye(4)
    pose[:3, 3] = (0.1, 0.2, 0.3)
    known = image(
        path=tmp_path / "a.png",
        depth_path=tmp_path / "d.png",
        camera=camera,
        extra={"T_base_camera": pose.tolist()},
    )
    frame = known.frame()
    assert frame.rgb[0, 0].tolist() == [30, 20, 10]
    assert frame.depth == pytest.approx(0.4)
    assert frame.camera == camera
    assert np.array_equal(frame.T_base_camera, pose)
    fine = replace(known, extra={"depth_scale": 0.0001}).frame()
    assert fine.depth == pytest.approx(0.04)
    bare = image(path=tmp_path / "a.png").frame()
    assert (bare.depth, bare.camera, bare.T_base_camera) == (None, None, None)


@pytest.mark.parametrize(
    "extra",
    [
        {"depth_scale": "mm"},
        {"depth_scale": 5},
        {"T_base_camera": [[1, "x"]]},
        {"T_base_camera": [[2.0] * 4] * 4},
    ],
)
def test_frame_refuses_damaged_fields(tmp_path: Path, extra: dict[str, Any]) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    with pytest.raises(ShapeError, match=r"depth_scale|T_base_camera"):
        image(path=tmp_path / "a.png", extra=extra).frame()


def test_frame_of_another_size_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((WIDTH, HEIGHT, 3), np.uint8))
    with pytest.raises(ShapeError, match=r"a\.png.*12×20.*20×12"):
        image(path=tmp_path / "a.png").frame()


def test_subset_keeps_order_and_everything_else() -> None:
    dataset = Dataset(
        tuple(image(number=n) for n in range(4)), name="set", info={"a": 1}, licences=[{"id": 1}]
    )
    part = dataset.subset(np.array([3, 1]))
    assert [entry.id for entry in part] == [3, 1]
    assert (len(part), part[1].id) == (2, 1)
    assert (part.name, part.info, part.licences) == ("set", {"a": 1}, [{"id": 1}])
    for outside in (4, -1):
        with pytest.raises(ConfigurationError, match="there are 4"):
            dataset.subset([outside])


def test_ids_are_unique() -> None:
    with pytest.raises(ShapeError, match="image id 1"):
        Dataset((image(), image()))
    with pytest.raises(ShapeError, match="annotation id 1"):
        Dataset((image(annotation()), image(annotation(), number=2)))


@pytest.mark.parametrize(("width", "height"), [(0, 4), (4, -1), (2**20, 2**20)])
def test_impossible_sizes_are_refused(width: int, height: int) -> None:
    with pytest.raises(ShapeError, match="size"):
        AnnotatedImage(1, Path("a.png"), width, height)
