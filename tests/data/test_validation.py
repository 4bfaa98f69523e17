"""Every kind of fault is found, named and, where that needs no guessing, repaired; whatever stands in the file."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data import read_coco, read_dataset
from punnet.data.faults import FAULTS, Fault, FaultReport, Severity
from punnet.data.fixing import fix_coco, rebase
from punnet.data.lenient import read_readable, with_photographs
from punnet.data.raw_coco import RawCoco, find_coco_file, open_raw_coco
from punnet.data.validation import validate_coco, validate_entries
from punnet.errors import FileFormatError
from tests.data.conftest import HEIGHT, WIDTH, clean_coco

Write = Callable[[dict[str, Any]], Path]
Damage = Callable[[dict[str, Any]], Any]


def annotation(data: dict[str, Any], number: int = 0) -> dict[str, Any]:
    entry: dict[str, Any] = data["annotations"][number]
    return entry


def found(report: FaultReport) -> set[str]:
    return {fault.code for fault in report.faults}


def in_memory(data: dict[str, Any]) -> RawCoco:
    return RawCoco(Path("set/annotations.json"), data, Path("set"))


def test_a_clean_file_has_no_fault(coco: dict[str, Any], coco_file: Write) -> None:
    seen: list[tuple[int, int]] = []
    report = validate_coco(coco_file(coco), progress=lambda done, total: seen.append((done, total)))
    assert report.faults == ()
    assert (report.images, report.annotations, report.errors, report.warnings) == (2, 4, 0, 0)
    assert seen == [(1, 2), (2, 2)]


# Code, annotation it is found in (None: an image's or the file's), word of the message, damage.
DAMAGES: list[tuple[str, Any, str, Damage]] = [
    ("foreign-class", None, "--class-map", lambda d: d["categories"][1].update(name="kiwi")),
    ("category-field", None, "no id", lambda d: d["categories"][1].pop("id")),
    ("category-field", None, "stalk", lambda d: d["categories"][1].update(keypoints=["stalk"])),
    ("image-field", None, "camera", lambda d: d["images"][0].update(camera={"fx": 1})),
    ("annotation-field", 1, "iscrowd", lambda d: annotation(d).update(iscrowd="yes")),
    ("keypoint-count", 1, "keypoint_depths_m", lambda d: annotation(d).update(keypoint_depths_m=[1, 2])),
    ("image-field", None, "width", lambda d: d["images"][0].update(width="wide")),
    ("image-field", None, "no object", lambda d: d["images"].append(7)),
    (
        "duplicate-image-id",
        None,
        "its own",
        lambda d: d["images"].append({**d["images"][0], "file_name": "b.png"}),
    ),
    ("duplicate-file-name", None, "merge", lambda d: d["images"].append({**d["images"][0], "id": 3})),
    ("missing-image", None, "not there", lambda d: d["images"][0].update(file_name="c.png")),
    ("missing-image", None, "not there", lambda d: d["images"][0].update(file_name="c" * 300)),
    ("size-mismatch", None, "80×60", lambda d: d["images"][1].update(width=81)),
    ("missing-depth", None, "d.png", lambda d: d["images"][1].update(depth_path="d.png")),
    ("annotation-field", "number 5", "no object", lambda d: d["annotations"].append("berry")),
    ("annotation-field", "x", "whole number", lambda d: annotation(d).update(id="x")),
    ("annotation-field", 1, "category", lambda d: annotation(d).pop("category_id")),
    ("duplicate-annotation-id", 2, "its own", lambda d: annotation(d).update(id=2)),
    ("unlisted-image", 1, "99", lambda d: annotation(d).update(image_id=99)),
    ("unknown-class", 1, "not in", lambda d: annotation(d).update(category_id=9)),
    ("not-finite", 1, "bbox", lambda d: annotation(d)["bbox"].__setitem__(0, float("nan"))),
    ("not-finite", 1, "keypoints", lambda d: annotation(d)["keypoints"].__setitem__(0, float("inf"))),
    (
        "not-finite",
        2,
        "segmentation",
        lambda d: annotation(d, 1)["segmentation"][0].__setitem__(0, float("nan")),
    ),
    ("out-of-range", 1, "ripeness", lambda d: annotation(d).update(ripeness=1.2)),
    ("out-of-range", 1, "weight_g", lambda d: annotation(d).update(weight_g=-3)),
    ("out-of-range", 1, "stage", lambda d: annotation(d).update(stage="blue")),
    ("bad-box", 1, "missing", lambda d: annotation(d).pop("bbox")),
    ("bad-box", 1, "four numbers", lambda d: annotation(d).update(bbox=[1, 2, 3])),
    ("empty-box", 3, "wide", lambda d: annotation(d, 2).update(bbox=[1, 2, 0, 9])),
    ("box-outside-image", 3, "10.0 px", lambda d: annotation(d, 2).update(bbox=[-10, 2, 20, 30])),
    ("bad-polygon", 2, "flat list", lambda d: annotation(d, 1).update(segmentation=[[1, 2, 3, 4, 5]])),
    (
        "bad-polygon",
        2,
        "flat list",
        lambda d: annotation(d, 1).update(segmentation=[[[1, 2], [3, 4], [5, 6]]]),
    ),
    ("bad-polygon", 2, "run lengths", lambda d: annotation(d, 1).update(segmentation="mask")),
    ("short-polygon", 2, "2 points", lambda d: annotation(d, 1).update(segmentation=[[5, 5, 15, 15]])),
    (
        "polygon-outside-image",
        2,
        "5.0 px",
        lambda d: annotation(d, 1).update(segmentation=[[-5, 5, 5, 5, 5, 15, -5, 15]]),
    ),
    ("bad-rle", 1, "add up", lambda d: annotation(d)["segmentation"].update(counts=[5, 5])),
    ("bad-rle", 1, "size", lambda d: annotation(d)["segmentation"].pop("size")),
    ("rle-size", 1, "81×60", lambda d: annotation(d)["segmentation"].update(size=[60, 81])),
    ("empty-mask", 1, "no pixel", lambda d: annotation(d)["segmentation"].update(counts=[WIDTH * HEIGHT])),
    ("empty-mask", 2, "no area", lambda d: annotation(d, 1).update(segmentation=[[5, 5, 9, 9, 15, 15]])),
    ("area-mismatch", 1, "400", lambda d: annotation(d).update(area=900)),
    ("area-mismatch", 2, "missing", lambda d: annotation(d, 1).pop("area")),
    ("keypoint-count", 1, "12 numbers", lambda d: annotation(d).update(keypoints=[1, 2, 2] * 4)),
    ("keypoint-code", 1, "v is 5", lambda d: annotation(d)["keypoints"].__setitem__(2, 5)),
    ("keypoint-outside-box", 1, "picking_point lies", lambda d: annotation(d).update(bbox=[30, 20, 20, 20])),
    ("keypoint-outside-image", 1, "picking_point", lambda d: annotation(d)["keypoints"].__setitem__(1, -8.0)),
    ("keypoint-total", 1, "5 are given", lambda d: annotation(d).update(num_keypoints=3)),
    ("visibility-contradiction", 1, "left_grasp", lambda d: annotation(d)["keypoints"].__setitem__(11, 2)),
    ("visibility-contradiction", 1, "5 codes", lambda d: annotation(d).update(visibility_detail=[1, 2])),
    (
        "visibility-contradiction",
        1,
        "codes are",
        lambda d: annotation(d)["visibility_detail"].__setitem__(0, 7),
    ),
    ("visibility-contradiction", 1, "both or neither", lambda d: annotation(d).pop("keypoints")),
]


@pytest.mark.parametrize(
    ("code", "where", "word", "damage"), DAMAGES, ids=[f"{d[0]}-{d[2]}" for d in DAMAGES]
)
def test_each_damage_is_named(
    code: str, where: Any, word: str, damage: Damage, coco: dict[str, Any], coco_file: Write
) -> None:
    damage(coco)
    report = validate_coco(coco_file(coco))
    faults = [fault for fault in report.faults if fault.code == code]
    assert faults, report.faults
    assert any(word in fault.message and fault.annotation_id == where for fault in faults), faults
    assert faults[0].file.name == "annotations.json"
    json.dumps(report.to_json(), allow_nan=False)


def test_every_known_fault_is_tried() -> None:
    # The one that is left needs a damaged photograph.
    assert set(FAULTS) - {damage[0] for damage in DAMAGES} == {"unreadable-image"}


def test_a_truncated_photograph_is_named(coco: dict[str, Any], coco_file: Write, photographs: Path) -> None:
    (photographs / "a.png").write_bytes((photographs / "a.png").read_bytes()[:30])
    (fault,) = validate_coco(coco_file(coco)).faults
    assert (fault.code, fault.severity, fault.where) == ("unreadable-image", Severity.ERROR, "a.png")


def test_unknown_codes_are_refused() -> None:
    with pytest.raises(KeyError, match="not a fault"):
        Fault("typo", "", Path("x"))


def test_photographs_in_a_folder_of_their_own(coco: dict[str, Any], coco_file: Write, tmp_path: Path) -> None:
    path = coco_file(coco)
    elsewhere = path.rename(tmp_path / "a.json")
    assert found(validate_coco(elsewhere)) == {"missing-image"}
    assert not validate_coco(elsewhere, tmp_path / "set").faults


def test_what_is_no_coco_file_is_refused(tmp_path: Path) -> None:
    for text in ("{", "[]", '{"images": []}', '{"images": 1, "annotations": []}'):
        (tmp_path / "x.json").write_text(text)
        with pytest.raises(FileFormatError, match=r"x\.json"):
            validate_coco(tmp_path / "x.json")
    with pytest.raises(FileFormatError, match="no such file"):
        open_raw_coco(tmp_path / "y.json")
    (tmp_path / "z.json").write_text("{}")
    with pytest.raises(FileFormatError, match="2 JSON files"):
        find_coco_file(tmp_path)


SAFE = {
    "duplicate-annotation-id",
    "short-polygon",
    "box-outside-image",
    "polygon-outside-image",
    "area-mismatch",
    "keypoint-outside-box",
    "keypoint-total",
    "visibility-contradiction",
}


def fixed(data: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
    before = deepcopy(data)
    result = fix_coco(in_memory(data))
    assert data == before, "the file that was read is left as it is"
    return result


def test_a_clean_file_is_left_as_it_is(coco: dict[str, Any]) -> None:
    assert fixed(coco) == (coco, [])


@pytest.mark.parametrize(
    ("damage", "changed"),
    [
        (lambda d: annotation(d).update(id=2), {1: {"id": 5}}),
        (
            lambda d: annotation(d, 1)["segmentation"].append([1, 1, 2, 2]),
            {1: {"segmentation": clean_coco()["annotations"][1]["segmentation"]}},
        ),
        (lambda d: annotation(d, 2).update(bbox=[-10, 2, 90, 30]), {2: {"bbox": [0, 2, 80, 30]}}),
        (lambda d: annotation(d).update(bbox=[30, 20, 20, 20]), {0: {"bbox": [30, 10, 20, 30]}}),
        (lambda d: annotation(d).update(area=7), {0: {"area": 400}}),
        (lambda d: annotation(d).update(num_keypoints=2), {0: {"num_keypoints": 5}}),
        (lambda d: annotation(d)["keypoints"].__setitem__(2, 2), {0: {"keypoints": None}}),
    ],
)
def test_repairs(damage: Damage, changed: dict[int, dict[str, Any]], coco: dict[str, Any]) -> None:
    clean = deepcopy(coco)
    damage(coco)
    data, changes = fixed(coco)
    assert len(changes) == 1
    for number, entry in enumerate(data["annotations"]):
        expected = {**coco["annotations"][number], **changed.get(number, {})}
        if "keypoints" in changed.get(number, {}):
            expected["keypoints"] = clean["annotations"][number]["keypoints"]
        assert entry == expected
    assert not validate_entries(in_memory(data)).faults


def test_a_polygon_is_clipped_at_the_edge(coco: dict[str, Any]) -> None:
    annotation(coco, 1).update(segmentation=[[-10, 5, 10, 5, 10, 15, -10, 15]], bbox=[0, 5, 10, 10])
    data, changes = fixed(coco)
    assert [change.code for change in changes] == ["polygon-outside-image"]
    corners = np.array(annotation(data, 1)["segmentation"]).reshape(-1, 2)
    assert sorted(map(tuple, corners.tolist())) == [(0, 5), (0, 15), (10, 5), (10, 15)]


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: annotation(d, 1).update(segmentation=[[5, 5, 15, 15]]),  # nothing would be left
        lambda d: annotation(d, 2).update(bbox=[-30, 2, 20, 30]),  # nothing of it is in the image
        lambda d: annotation(d)["keypoints"].__setitem__(1, -30.0),  # the point is wrong, not the box
        lambda d: annotation(d)["visibility_detail"].__setitem__(0, 0),  # is it there or not?
        lambda d: d["images"].append(d["images"][0]),
        lambda d: annotation(d).update(category_id=9),
        lambda d: annotation(d).update(bbox=None),
    ],
)
def test_what_would_be_a_guess_stays_as_it_is(damage: Damage, coco: dict[str, Any]) -> None:
    damage(coco)
    assert fixed(coco) == (coco, [])
    assert validate_entries(in_memory(coco)).faults


def test_names_lead_to_the_photographs_from_another_folder(coco: dict[str, Any], coco_file: Write) -> None:
    path = coco_file(coco)
    new = path.parent.parent / "new" / "deep"
    data = rebase(deepcopy(coco), path.parent, path.parent, new)
    assert data["images"][0]["file_name"] == "../../set/a.png"
    new.mkdir(parents=True)
    (new / "fixed.json").write_text(json.dumps(data))
    assert not validate_coco(new / "fixed.json").faults


JSON_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats()
    | st.just(10**400)
    | st.text(max_size=5)
    | st.sampled_from([0, 1, 2, 3, 60, 80]),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=12,
)


@st.composite
def damaged(draw: st.DrawFn) -> dict[str, Any]:
    """The clean object with a few values, at any depth, replaced or removed."""
    data = clean_coco()
    for _ in range(draw(st.integers(1, 3))):
        place: Any = data[draw(st.sampled_from(["images", "annotations", "categories"]))]
        while True:
            key = draw(st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place))))
            if isinstance(place[key], dict | list) and place[key] and draw(st.integers(0, 3)):
                place = place[key]
                continue
            break
        if draw(st.booleans()):
            place[key] = draw(JSON_VALUES)
        else:
            del place[key]
        if not all(data.values()):
            data = clean_coco()
    return data


@settings(max_examples=80, deadline=None)
@given(damaged())
def test_any_damage_is_reported_and_repaired_without_an_exception(data: dict[str, Any]) -> None:
    report = validate_entries(in_memory(data))
    json.dumps(report.to_json())
    repaired, changes = fix_coco(in_memory(data))
    after = validate_entries(in_memory(repaired))
    assert len(after.faults) <= len(report.faults)
    assert {change.code for change in changes} <= SAFE
    # Repairing twice changes nothing more.
    assert fix_coco(in_memory(repaired))[1] == []


@settings(max_examples=60, deadline=None)
@given(damaged())
def test_what_has_no_error_can_be_read_and_the_rest_is_read_without_it(
    tmp_path_factory: pytest.TempPathFactory, data: dict[str, Any]
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "annotations.json"
    path.write_text(json.dumps(data))
    report = validate_entries(open_raw_coco(path))
    if not report.errors and "foreign-class" not in found(report):
        assert len(read_coco(path)) == len(data["images"])
        return
    try:
        dataset, left_out = read_readable(path, "coco")
    except FileFormatError:
        return  # damaged beyond single entries; a plain reason is given
    assert all(fault in report.faults for fault in left_out)
    assert len(dataset) <= len(data["images"])


def test_the_readable_rest_is_as_if_the_damaged_had_not_been_there(
    coco: dict[str, Any], coco_file: Write
) -> None:
    whole = read_dataset(coco_file(coco))
    coco["annotations"].insert(0, {**annotation(coco), "id": 77, "bbox": [1, 2, 3, float("nan")]})
    coco["images"].append({"id": 9, "file_name": None})
    coco["annotations"].append({**annotation(coco, 3), "id": 78, "image_id": 9})
    path = coco_file(coco)
    with pytest.raises(FileFormatError, match="NaN"):
        read_dataset(path)
    rest, left_out = read_readable(path)
    assert {fault.code for fault in left_out} == {"not-finite", "image-field"}
    assert rest.name == whole.name
    assert [image.path.resolve() for image in rest] == [image.path.resolve() for image in whole]
    assert [[a.id for a in image.annotations] for image in rest] == [[1, 2], [3, 4]]


def test_images_without_their_photograph_are_left_out(
    coco: dict[str, Any], coco_file: Write, photographs: Path
) -> None:
    dataset = read_dataset(coco_file(coco))
    cv2.imwrite(str(photographs / "b.png"), np.zeros((HEIGHT, WIDTH + 1, 3), np.uint8))
    kept, left_out = with_photographs(dataset)
    assert [image.id for image in kept] == [1]
    assert len(left_out) == 1
    assert "81×60" in left_out[0]


def test_real_files(shared_data: Path) -> None:
    report = validate_entries(open_raw_coco(shared_data / "strawdi" / "test"))
    assert report.by_code == {"keypoint-outside-box": 766}
    data, changes = fix_coco(open_raw_coco(shared_data / "strawdi" / "test"))
    assert len(changes) == 766
    assert not validate_entries(in_memory(data)).faults
    for folder in ("dc_train", "rh_train"):
        assert not validate_entries(open_raw_coco(shared_data / "psd" / folder)).faults
