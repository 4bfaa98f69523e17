"""VGG Image Annotator: CSV and JSON of versions 1 and 2, classes by PSD's codes and by name."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import Dataset, read_dataset, read_psd, read_via
from punnet.data.formats import guess_format
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE, UNPLUCKABLE

HEIGHT, WIDTH = 40, 60
COLUMNS = ["filename", "file_size", "file_attributes", "region_count", "region_id"]
COLUMNS += ["region_shape_attributes", "region_attributes"]
TRIANGLE = {"name": "polygon", "all_points_x": [10, 30, 10], "all_points_y": [5, 5, 25]}
RIPE = {"Hardness of Picking": "2", "Degree of Ripeness": "3"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    return tmp_path


def write_csv(path: Path, *rows: tuple[str, dict[str, Any], dict[str, Any]], first: str = "filename") -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([first, *COLUMNS[1:]])
        for number, (name, shape, attributes) in enumerate(rows):
            writer.writerow([name, 1000, "{}", len(rows), number, json.dumps(shape), json.dumps(attributes)])
    return path


def write_json(path: Path, *regions: dict[str, Any], project: bool = False) -> Path:
    entries = {
        "a.png1000": {"filename": "a.png", "size": 1000, "regions": list(regions), "file_attributes": {}}
    }
    path.write_text(json.dumps({"_via_settings": {}, "_via_img_metadata": entries} if project else entries))
    return path


def region(shape: dict[str, Any], attributes: dict[str, Any]) -> dict[str, Any]:
    return {"shape_attributes": shape, "region_attributes": attributes}


def read_one(folder: Path, shape: dict[str, Any], attributes: dict[str, Any], **settings: Any) -> Dataset:
    return read_via(write_json(folder / "via.json", region(shape, attributes)), **settings)


def test_csv_as_psd_has_it(folder: Path) -> None:
    """Photographs keep their order, one without regions has one row, and the codes mean what PSD says."""
    path = write_csv(
        folder / "via.csv",
        ("b.png", {}, {}),
        ("a.png", TRIANGLE, RIPE),
        ("a.png", TRIANGLE, {"Hardness of Picking": "4", "Degree of Ripeness": "0"}),
    )
    empty, image = read_via(path)
    assert (empty.path, empty.annotations) == (folder / "b.png", ())
    assert image.size == (HEIGHT, WIDTH)
    ripe, green = image.annotations
    assert (ripe.class_index, ripe.ripeness, ripe.stage, ripe.occlusion) == (PLUCKABLE, 1.0, "ripe", 0.45)
    assert (green.class_index, green.ripeness, green.stage) == (UNPLUCKABLE, 0.0, "green")
    assert np.isnan(green.occlusion)
    assert ripe.segmentation == [[10, 5, 30, 5, 10, 25]]
    assert ripe.box.tolist() == [10, 5, 30, 25]
    assert ripe.extra["via_attributes"] == RIPE
    assert (ripe.extra["ripeness_code"], ripe.extra["hardness"]) == (3, 2)
    assert (ripe.id, green.id) == (1, 2)


@pytest.mark.parametrize(("code", "expected"), [("0", 1), ("1", 1), ("2", 0), ("3", 0), ("4", 1)])
def test_half_ripe_is_left_and_nine_tenths_is_picked(folder: Path, code: str, expected: int) -> None:
    (image,) = read_one(folder, TRIANGLE, {"Degree of Ripeness": code})
    assert image.annotations[0].class_index == expected


def test_codes_give_way_to_the_class_map(folder: Path) -> None:
    for target, expected in (("unpluckable", [UNPLUCKABLE]), ("ignore", [])):
        (image,) = read_one(folder, TRIANGLE, RIPE, class_map={"3": target})
        assert [a.class_index for a in image.annotations] == expected


def test_export_project_and_version_1_say_the_same(folder: Path) -> None:
    one = region(TRIANGLE, RIPE)
    export = write_json(folder / "export.json", one)
    project = write_json(folder / "project.json", one, project=True)
    old = folder / "old.json"
    old.write_text(json.dumps({"a.png1": {"filename": "a.png", "regions": {"0": one}}}))
    old_csv = write_csv(folder / "old.csv", ("a.png", TRIANGLE, RIPE), first="#filename")
    found = [read_via(path)[0].annotations[0] for path in (export, project, old, old_csv)]
    assert [a.segmentation for a in found] == [[[10, 5, 30, 5, 10, 25]]] * 4
    assert [a.class_index for a in found] == [PLUCKABLE] * 4


@pytest.mark.parametrize(
    ("attributes", "expected", "stage"),
    [
        ({"class": "Ripe"}, PLUCKABLE, "ripe"),
        ({"ripeness": "un-ripe"}, None, None),
        ({"ripeness": "unripe"}, UNPLUCKABLE, None),
        ({"maturity": "x", "label": "green"}, UNPLUCKABLE, "green"),
        ({"type": {"ripe": False, "rotten": True}}, UNPLUCKABLE, "rotten"),
        ({"class": "", "name": "pluckable"}, PLUCKABLE, None),
        ({"type": "berry", "Degree of Ripeness": "3"}, PLUCKABLE, "ripe"),
        ({"class": "1"}, None, None),
        ({"colour": "red"}, None, None),
        ({}, None, None),
    ],
)
def test_class_by_name(
    folder: Path, attributes: dict[str, Any], expected: int | None, stage: str | None
) -> None:
    if expected is None:
        with pytest.raises(FileFormatError, match=r"via\.json.*a\.png.*region 0"):
            read_one(folder, TRIANGLE, attributes)
        return
    (annotation,) = read_one(folder, TRIANGLE, attributes)[0].annotations
    assert (annotation.class_index, annotation.stage) == (expected, stage)


def test_class_map_tells_names_that_nobody_knows(folder: Path) -> None:
    with pytest.raises(FileFormatError, match=r"class_map=\{'berry'"):
        read_one(folder, TRIANGLE, {"class": "berry"})
    (image,) = read_one(folder, TRIANGLE, {"class": "berry"}, class_map={"Berry": "pluckable"})
    assert image.annotations[0].class_index == PLUCKABLE


def test_a_rectangle_is_a_box_without_a_mask(folder: Path) -> None:
    shape = {"name": "rect", "x": 5, "y": 6, "width": 10, "height": 20}
    (annotation,) = read_one(folder, shape, RIPE)[0].annotations
    assert annotation.box.tolist() == [5, 6, 15, 26]
    assert annotation.segmentation is None


def test_circles_and_ellipses_have_the_area_they_should(folder: Path) -> None:
    for shape, area in (
        ({"name": "circle", "cx": 30, "cy": 20, "r": 15}, np.pi * 15**2),
        ({"name": "ellipse", "cx": 30, "cy": 20, "rx": 18, "ry": 9}, np.pi * 18 * 9),
        ({"name": "ellipse", "cx": 30, "cy": 20, "rx": 18, "ry": 9, "theta": 0.7}, np.pi * 18 * 9),
    ):
        mask = read_one(folder, shape, RIPE)[0].mask(0)
        assert mask is not None
        assert mask.sum() == pytest.approx(area, rel=0.02)
    # theta turns the long axis down to the right, as VIA draws it (y points down).
    assert mask[20 + 9, 30 + 10]
    assert not mask[20 - 9, 30 + 10]


def test_photographs_are_found_in_a_folder_beside(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "a.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    path = write_csv(tmp_path / "via.csv", ("a.png", TRIANGLE, RIPE))
    assert read_via(path)[0].path == tmp_path / "images" / "a.png"
    path.rename(tmp_path / "images" / "via.csv")
    assert read_dataset(tmp_path / "images")[0].path == tmp_path / "images" / "a.png"


def test_the_format_is_guessed(folder: Path) -> None:
    assert guess_format(write_csv(folder / "via.csv", ("a.png", TRIANGLE, RIPE))) == "via"
    assert guess_format(write_json(folder / "x.json")) == "via"
    assert guess_format(write_json(folder / "y.json", project=True)) == "via"


@pytest.mark.parametrize(
    ("shape", "attributes", "told"),
    [
        ({"name": "polygon", "all_points_x": [1, 2], "all_points_y": [1, 2]}, RIPE, "corners"),
        ({"name": "polygon", "all_points_x": [1, 2, 3], "all_points_y": [1, 2]}, RIPE, "one length"),
        ({"name": "polygon", "all_points_x": [1, 2, "x"], "all_points_y": [1, 2, 3]}, RIPE, "number"),
        ({"name": "polygon"}, RIPE, "all_points_x"),
        ({"name": "point", "cx": 3, "cy": 4}, RIPE, "point"),
        ({"name": "rect", "x": 3, "y": 4, "width": 5}, RIPE, "height"),
        ({"name": "rect", "x": 3, "y": 4, "width": -5, "height": 5}, RIPE, "box"),
        (TRIANGLE, {"Degree of Ripeness": "7"}, "0 … 4"),
        (TRIANGLE, {"Degree of Ripeness": "3", "Hardness of Picking": "9"}, "0 … 4"),
        (TRIANGLE, {"Degree of Ripeness": "3", "Hardness of Picking": "hard"}, "Hardness of Picking"),
    ],
)
@pytest.mark.parametrize("kind", ["csv", "json"])
def test_faults_are_told_with_file_and_place(
    folder: Path, kind: str, shape: dict[str, Any], attributes: dict[str, Any], told: str
) -> None:
    sound, damaged = region(TRIANGLE, RIPE), region(shape, attributes)
    if kind == "csv":
        path = write_csv(folder / "via.csv", ("a.png", TRIANGLE, RIPE), ("a.png", shape, attributes))
    else:
        path = write_json(folder / "via.json", sound, damaged)
    place = r"via\.csv, line 3" if kind == "csv" else r"via\.json: a\.png1000, region 1"
    with pytest.raises(FileFormatError, match=place) as caught:
        read_via(path)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "columns"),
        ("filename,x\na.png,1\n", "region_attributes"),
        (",".join(COLUMNS) + "\na.png,1,{},1,0,{\n", "line 2"),
        (",".join(COLUMNS) + '\n,1,{},1,0,"{""name"":""rect""}",{}\n', "filename"),
        (",".join(COLUMNS) + "\nmissing.png,1,{},0,0,{},{}\n", "missing.png"),
    ],
)
def test_damaged_csv(folder: Path, text: str, told: str) -> None:
    path = folder / "via.csv"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=r"(?s)" + told):
        read_via(path)


def test_real_polygons_come_through_via_as_they_are(shared_data: Path, tmp_path: Path) -> None:
    """PSD's own upstream form: its polygons and codes written as VIA's CSV read the same as its COCO."""
    expected = read_psd(shared_data / "psd" / "rh_train").subset(range(3))
    rows: list[tuple[str, dict[str, Any], dict[str, Any]]] = []
    for image in expected:
        for annotation in image.annotations:
            assert isinstance(annotation.segmentation, list)
            corners = annotation.segmentation[0]
            shape = {"name": "polygon", "all_points_x": corners[::2], "all_points_y": corners[1::2]}
            codes = {
                "Degree of Ripeness": str(annotation.extra["ripeness_code"]),
                "Hardness of Picking": str(annotation.extra["hardness"]),
            }
            rows.append((image.path.name, shape, codes))
    found = read_via(write_csv(tmp_path / "psd.csv", *rows), expected[0].path.parent)
    assert len(found) == 3
    for one, other in zip(found, expected, strict=True):
        assert (one.path, one.size) == (other.path, other.size)
        assert len(one.annotations) == len(other.annotations) > 0
        for a, b in zip(one.annotations, other.annotations, strict=True):
            assert (a.segmentation, a.class_index, a.stage) == (b.segmentation, b.class_index, b.stage)
            np.testing.assert_equal([a.ripeness, a.occlusion], [b.ripeness, b.occlusion])
