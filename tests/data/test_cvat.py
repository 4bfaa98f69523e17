"""Masks and skeletons exported apart come together where they lie."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from punnet.data import merge_by_overlap, read_coco, read_cvat, read_dataset, read_strawdi, write_coco
from punnet.data.formats import guess_format
from punnet.errors import FileFormatError
from punnet.scene import KEYPOINTS, PLUCKABLE, UNPLUCKABLE

WIDTH, HEIGHT = 100, 60


def listed(number: int, name: str, **changes: Any) -> dict[str, Any]:
    return {"id": number, "file_name": name, "width": WIDTH, "height": HEIGHT, **changes}


def square(number: int, left: float, **changes: Any) -> dict[str, Any]:
    corners = [left, 20.0, left + 20, 20.0, left + 20, 45.0, left, 45.0]
    return {"id": number, "image_id": 1, "category_id": 2, "segmentation": [corners], **changes}


def skeleton(number: int, left: float, **changes: Any) -> dict[str, Any]:
    """Picking point above a square, four points on its edge; the box as CVAT has it, around the points."""
    points = [(10, -10, 2), (10, 0, 2), (10, 25, 1), (0, 12, 2), (20, 12, 2)]
    flat = [value for u, v, flag in points for value in (left + u, 20.0 + v, flag)]
    entry = {"id": number, "image_id": 7, "category_id": 1, "keypoints": flat, "bbox": [left, 10, 20, 35]}
    return {**entry, "segmentation": [], "num_keypoints": 5, **changes}


def export(
    folder: Path, squares: list[dict[str, Any]], skeletons: list[dict[str, Any]], **changes: Any
) -> Path:
    (folder / "annotations").mkdir(parents=True)
    masks = {
        "images": [listed(1, "a.png"), listed(2, "b.png")],
        "annotations": squares,
        "categories": [{"id": 2, "name": "ripe"}, {"id": 5, "name": "unripe"}],
    }
    points = {
        "images": [listed(7, "a.png", **changes)],
        "annotations": skeletons,
        "categories": [{"id": 1, "name": "berry points", "keypoints": [str(k + 1) for k in range(5)]}],
    }
    (folder / "annotations" / "instances_default.json").write_text(json.dumps(masks))
    (folder / "annotations" / "person_keypoints_default.json").write_text(json.dumps(points))
    return folder


def test_each_berry_gets_its_own_keypoints(tmp_path: Path) -> None:
    squares = [square(11, 5), square(12, 30, category_id=5), square(13, 70)]
    # In another order than the masks, one a little off, and none for the last berry.
    folder = export(tmp_path, squares, [skeleton(1, 31.5), skeleton(2, 5)])
    assert guess_format(folder) == "cvat"
    first, second = read_dataset(folder)
    berries = first.annotations
    assert [berry.id for berry in berries] == [11, 12, 13]
    assert [berry.class_index for berry in berries] == [PLUCKABLE, UNPLUCKABLE, PLUCKABLE]
    assert berries[0].keypoints[0].tolist() == [15, 10]
    assert berries[1].keypoints[0].tolist() == [41.5, 10]
    assert berries[1].visibility.tolist() == [2, 2, 1, 2, 2]
    assert berries[2].keypoints is None
    # The box is stretched to hold the picking point.
    assert berries[0].box.tolist() == [5, 10, 25, 45]
    assert second.annotations == ()


def test_overlapping_berries_are_assigned_best_together(tmp_path: Path) -> None:
    # The skeleton of the second reaches into the first; only one of the two assignments gives both of them a good one.
    folder = export(tmp_path, [square(1, 10), square(2, 22)], [skeleton(1, 20), skeleton(2, 11)])
    berries = read_cvat(folder)[0].annotations
    assert berries[0].keypoints[1].tolist() == [21, 20]
    assert berries[1].keypoints[1].tolist() == [30, 20]


def test_picking_point_alone_finds_the_berry_under_it(tmp_path: Path) -> None:
    alone = [0] * 15
    alone[:3] = [15, 14, 2]
    folder = export(tmp_path, [square(1, 5), square(2, 60)], [skeleton(1, 0, keypoints=alone)])
    berries = read_cvat(folder)[0].annotations
    assert berries[0].visibility.tolist() == [2, 0, 0, 0, 0]
    assert berries[1].keypoints is None


def test_boxes_without_masks_take_part(tmp_path: Path) -> None:
    box = {"id": 4, "image_id": 1, "category_id": 2, "bbox": [5, 20, 20, 25], "segmentation": []}
    (berry,) = read_cvat(export(tmp_path, [box], [skeleton(1, 5)]))[0].annotations
    assert berry.segmentation is None
    assert berry.keypoints is not None


def test_keypoints_that_fit_nothing_are_told(tmp_path: Path) -> None:
    folder = export(tmp_path, [square(1, 5)], [skeleton(1, 5), skeleton(8, 70), skeleton(9, 72)])
    with pytest.warns(UserWarning, match=r"2 sets of key-points fit no berry.*ids 8, 9"):
        dataset = read_cvat(folder)
    assert dataset.extra["unmatched_keypoints"] == [8, 9]
    write_coco(dataset, tmp_path / "merged.json")
    again = read_coco(tmp_path / "merged.json")
    assert again.extra["unmatched_keypoints"] == [8, 9]
    assert np.array_equal(again[0].annotations[0].keypoints, dataset[0].annotations[0].keypoints)


# As CVAT writes what is drawn with the brush, or is marked as crowd.
RUNS = {"size": [HEIGHT, WIDTH], "counts": [620, 30, HEIGHT * WIDTH - 650]}
DRAWN = {"segmentation": RUNS, "bbox": [10, 20, 1, 30], "iscrowd": 1}


def test_crowds_stay_crowds(tmp_path: Path) -> None:
    # CVAT turns its attribute is_crowd into iscrowd and leaves it out; other programs keep it.
    attributes = [{}, {"is_crowd": True}, {"is_crowd": "false", "occluded": True}, {"occluded": False}]
    berries = [
        {**square(1, 5), **DRAWN},
        {**square(2, 60), "attributes": attributes[1]},
        {**square(3, 60), **DRAWN, "attributes": attributes[2]},
        {**square(4, 30), "iscrowd": 0, "attributes": attributes[3]},
    ]
    dataset = read_cvat(export(tmp_path, berries, []))
    assert [berry.crowd for berry in dataset[0].annotations] == [True, True, False, False]
    write_coco(dataset, tmp_path / "merged.json")
    again = read_coco(tmp_path / "merged.json")[0].annotations
    assert [berry.crowd for berry in again] == [True, True, False, False]
    assert [berry.extra.get("attributes", {}) for berry in again] == attributes


def test_a_set_drawn_with_the_brush_is_not_all_crowd(tmp_path: Path) -> None:
    folder = export(tmp_path, [{**square(1, 5), **DRAWN}, {**square(2, 60), **DRAWN}], [])
    with pytest.warns(UserWarning, match=r"all 2 berries are marked iscrowd.*attribute is_crowd"):
        berries = read_cvat(folder)[0].annotations
    assert [berry.crowd for berry in berries] == [False, False]


def test_attributes_of_masks_and_skeletons_are_kept(tmp_path: Path) -> None:
    berry = {**square(1, 5), "attributes": {"occluded": True, "cultivar": "Sonata"}}
    points = skeleton(1, 5, attributes={"occluded": False, "annotator": 3})
    first, second = read_cvat(export(tmp_path, [berry, square(2, 60)], [points]))[0].annotations
    assert first.extra["attributes"] == {"occluded": True, "cultivar": "Sonata", "annotator": 3}
    assert "attributes" not in second.extra


def test_named_keypoints_in_another_order(tmp_path: Path) -> None:
    folder = export(tmp_path, [square(1, 5)], [skeleton(1, 5)])
    file = folder / "annotations" / "person_keypoints_default.json"
    data = json.loads(file.read_text())
    data["categories"][0]["keypoints"] = ["Top", "picking point", *KEYPOINTS[2:]]
    file.write_text(json.dumps(data))
    (berry,) = read_cvat(folder)[0].annotations
    assert berry.keypoints[0].tolist() == [15, 20]
    assert berry.keypoints[1].tolist() == [15, 10]


def test_two_files(tmp_path: Path) -> None:
    folder = export(tmp_path, [square(1, 5)], [skeleton(1, 5)]) / "annotations"
    masks, points = folder / "instances_default.json", folder / "person_keypoints_default.json"
    assert read_cvat(masks, points)[0].annotations[0].keypoints is not None
    with pytest.raises(FileFormatError, match="key-points is needed too"):
        read_cvat(masks)
    points.unlink()
    with pytest.raises(FileFormatError, match=r"person_keypoints_\*\.json.*found 0"):
        read_cvat(tmp_path)


def test_other_photographs_are_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"no photograph.*z\.png.*a\.png"):
        read_cvat(export(tmp_path / "1", [square(1, 5)], [skeleton(1, 5)], file_name="z.png"))
    with pytest.raises(FileFormatError, match=r"a\.png.*\(60, 100\).*\(90, 100\)"):
        read_cvat(export(tmp_path / "2", [square(1, 5)], [skeleton(1, 5)], height=90))
    folder = export(tmp_path / "3", [square(1, 5)], [])
    file = folder / "annotations" / "instances_default.json"
    file.write_text(file.read_text().replace('"ripe"', '"squash"'))
    with pytest.raises(FileFormatError, match="annotation 1: class 'squash'"):
        read_cvat(folder)


def test_real_clusters_are_told_apart(shared_data: Path, rng: np.random.Generator) -> None:
    annotated = read_strawdi(shared_data / "strawdi" / "test").subset(range(12))
    masks, points = [], []
    for image in annotated:
        berries = image.annotations
        masks.append(
            replace(image, annotations=[replace(b, keypoints=None, visibility=None) for b in berries])
        )
        shuffled = [replace(berries[k], segmentation=None) for k in rng.permutation(len(berries))]
        points.append(replace(image, annotations=shuffled))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        merged = merge_by_overlap(replace(annotated, images=masks), replace(annotated, images=points))
    right = [
        found.keypoints is not None and np.array_equal(found.keypoints, true.keypoints, equal_nan=True)
        for image, original in zip(merged, annotated, strict=True)
        for found, true in zip(image.annotations, original.annotations, strict=True)
        if true.keypoints is not None
    ]
    assert len(right) > 40
    assert np.mean(right) > 0.9
