"""LabelMe: outlines of every kind, key-points by group, and what is wrong told with file and shape."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import AnnotatedImage, read_dataset, read_labelme
from punnet.data.formats import guess_format
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

HEIGHT, WIDTH = 40, 60
SQUARE = [[10, 10], [30, 10], [30, 30], [10, 30]]


def shape(label: str, points: list[list[float]], kind: str = "polygon", **fields: Any) -> dict[str, Any]:
    return {"label": label, "points": points, "group_id": None, "shape_type": kind, "flags": {}, **fields}


def point(label: str, u: float, v: float, group: int | None = 1, **flags: bool) -> dict[str, Any]:
    return shape(label, [[u, v]], "point", group_id=group, flags=flags)


def png(mask: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", mask.astype(np.uint8) * 255)[1].tobytes()).decode()


def labelme(folder: Path, *shapes: dict[str, Any], name: str = "a", **changes: Any) -> Path:
    path = folder / f"{name}.json"
    data = {
        "version": "5.5.0",
        "flags": {},
        "shapes": list(shapes),
        "imagePath": f"{name}.jpg",
        "imageData": None,
        "imageHeight": HEIGHT,
        "imageWidth": WIDTH,
    }
    path.write_text(json.dumps({**data, **changes}))
    return path


def read_one(folder: Path, *shapes: dict[str, Any], **settings: Any) -> AnnotatedImage:
    (image,) = read_labelme(labelme(folder, *shapes), **settings)
    return image


def test_a_folder_is_read_in_the_order_of_names(tmp_path: Path) -> None:
    labelme(tmp_path, shape("unripe", SQUARE), name="b")
    labelme(tmp_path, shape("ripe", SQUARE), shape("ripe", SQUARE), name="a")
    assert guess_format(tmp_path) == "labelme"
    dataset = read_dataset(tmp_path)
    assert [image.path for image in dataset] == [tmp_path / "a.jpg", tmp_path / "b.jpg"]
    assert [[a.id for a in image.annotations] for image in dataset] == [[1, 2], [3]]
    assert dataset[0].annotations[0].segmentation == [[10, 10, 30, 10, 30, 30, 10, 30]]
    assert [image.annotations[0].class_index for image in dataset] == [PLUCKABLE, UNPLUCKABLE]
    assert dataset[0].size == (HEIGHT, WIDTH)


def test_keypoints_belong_to_the_outline_of_their_group(tmp_path: Path) -> None:
    image = read_one(
        tmp_path,
        point("bottom", 20, 30, group=2),
        shape("ripe", SQUARE, group_id=1),
        point("picking_point", 20, 2),
        shape("unripe", [[40, 10], [50, 10], [45, 20]], group_id=2),
        point("Top", 20.5, 10, hidden_by_other=True),
        point("left-grasp", 10, 20, hidden_by_itself=True),
        point("right grasp", 30, 20, occluded=True, truncated=True),
    )
    first, second = image.annotations
    assert first.visibility is not None
    assert first.keypoints is not None
    assert first.visibility.tolist() == [2, 3, 0, 1, 1]
    assert first.keypoints[[0, 1, 3]].tolist() == [[20, 2], [20.5, 10], [10, 20]]
    assert np.isnan(first.keypoints[2]).all()
    assert first.box.tolist() == [10, 2, 30, 30]
    assert second.visibility is not None
    assert second.visibility.tolist() == [0, 0, 2, 0, 0]


def test_parts_of_a_group_are_one_berry(tmp_path: Path) -> None:
    image = read_one(
        tmp_path,
        shape("ripe", [[10, 10], [14, 10], [14, 30], [10, 30]], group_id=4),
        shape("ripe", [[20, 10], [30, 10], [30, 30], [20, 30]], group_id=4),
        shape("ripe", SQUARE),
    )
    assert len(image.annotations) == 2
    mask = image.mask(0)
    assert mask is not None
    assert mask.sum() == 4 * 20 + 10 * 20


def test_rectangles_are_boxes_without_a_mask(tmp_path: Path) -> None:
    image = read_one(
        tmp_path,
        shape("ripe", [[30, 25], [10, 5]], "rectangle"),
        shape("ripe", [[10, 5], [30, 5], [30, 25], [10, 25]], "rectangle"),
    )
    assert [a.box.tolist() for a in image.annotations] == [[10, 5, 30, 25]] * 2
    assert [a.segmentation for a in image.annotations] == [None, None]


def test_circles_and_masks(tmp_path: Path) -> None:
    drawn = np.zeros((8, 6), bool)
    drawn[2:, 1:4] = True
    image = read_one(
        tmp_path,
        shape("ripe", [[30, 20], [30, 32]], "circle"),
        shape("ripe", [[5, 7], [10, 14]], "mask", mask=png(drawn)),
    )
    circle, mask = image.mask(0), image.mask(1)
    assert circle is not None
    assert mask is not None
    assert circle.sum() == pytest.approx(np.pi * 12**2, rel=0.02)
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[7:15, 5:11] = drawn
    assert (mask == expected).all()


def test_labels_are_mapped_kept_and_ignored(tmp_path: Path) -> None:
    shapes = (
        shape("leaf", SQUARE, group_id=1),
        point("top", 3, 3, group=1),
        shape("Erdbeere", SQUARE, description="of the left row"),
    )
    image = read_one(tmp_path, *shapes, class_map={"leaf": "ignore", "erdbeere": "pluckable"})
    (annotation,) = image.annotations
    assert annotation.class_index == PLUCKABLE
    assert annotation.keypoints is None
    assert annotation.extra == {"category_name": "Erdbeere", "description": "of the left row"}
    with pytest.raises(FileFormatError, match=r"a\.json: shape 0: class 'leaf' is not known.*class_map"):
        read_one(tmp_path, *shapes)


def test_keypoints_go_to_the_berry_of_a_group_that_also_holds_something_ignored(tmp_path: Path) -> None:
    image = read_one(
        tmp_path,
        shape("calyx", SQUARE, group_id=1),
        shape("ripe", SQUARE, group_id=1),
        point("top", 20, 10),
        class_map={"calyx": "ignore"},
    )
    (annotation,) = image.annotations
    assert annotation.visibility is not None
    assert annotation.visibility.tolist() == [0, 2, 0, 0, 0]


def test_size_and_photograph_of_older_and_windows_files(tmp_path: Path) -> None:
    (tmp_path / "img").mkdir()
    cv2.imwrite(str(tmp_path / "img" / "x.png"), np.zeros((12, 34, 3), np.uint8))
    (tmp_path / "json").mkdir()
    path = labelme(
        tmp_path / "json", imagePath="..\\img\\x.png", imageHeight=None, imageWidth=None, shapes=[]
    )
    (image,) = read_labelme(path)
    assert image.path.resolve() == (tmp_path / "img" / "x.png").resolve()
    assert image.size == (12, 34)


@pytest.mark.parametrize(
    ("shapes", "told"),
    [
        ([shape("ripe", SQUARE[:2])], "corners"),
        ([shape("ripe", [[1, 2], [3, 4], [5]])], "point"),
        ([shape("ripe", [[1, 2], [3, 4], [5, None]])], "number"),
        ([shape("ripe", SQUARE, "linestrip")], "linestrip"),
        ([shape("ripe", SQUARE[:3], "rectangle")], "corners"),
        ([shape("ripe", SQUARE[:1], "circle")], "2 points"),
        ([shape("ripe", [[1, 1], [3, 3]], "mask", mask="?")], "base64"),
        ([shape("ripe", [[1, 1], [3, 3]], "mask", mask="aGFsbG8=")], "PNG"),
        ([shape("ripe", [[1, 1], [30, 30]], "mask", mask=png(np.ones((4, 4))))], "4×4"),
        (
            [shape("ripe", SQUARE, group_id=1), shape("ripe", SQUARE[:2], "rectangle", group_id=1)],
            "one group",
        ),
        ([shape("ripe", SQUARE), point("top", 1, 1, group=None)], "belongs to no outline"),
        ([shape("ripe", SQUARE, group_id=2), point("top", 1, 1, group=1)], "belongs to no outline"),
        ([shape("ripe", SQUARE, group_id=1), point("tip", 1, 1)], "'tip' is none of the key-points"),
        ([shape("ripe", SQUARE, group_id=1), point("top", 1, 1), point("top", 2, 2)], "twice"),
        ([3], "object"),
    ],
)
def test_faults_are_told_with_file_and_shape(tmp_path: Path, shapes: list[Any], told: str) -> None:
    with pytest.raises(FileFormatError, match=r"a\.json: shape \d") as caught:
        read_one(tmp_path, *shapes)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"shapes": None}, "shapes"),
        ({"imagePath": 3}, "imagePath"),
        ({"imageHeight": 0}, "60×0 is not possible"),
        ({"imageHeight": 10**6, "imageWidth": 10**6}, "not possible"),
        ({"imageHeight": None}, "a.jpg"),
    ],
)
def test_damaged_files(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    path = labelme(tmp_path, shape("ripe", SQUARE), **changes)
    with pytest.raises(FileFormatError) as caught:
        read_labelme(path)
    assert told in str(caught.value)


def test_a_folder_without_files_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no JSON files"):
        read_labelme(tmp_path)
