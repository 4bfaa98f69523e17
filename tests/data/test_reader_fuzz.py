"""Whatever lies in a file, a reader gives a data set or an error that says what is wrong."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from punnet.data import Dataset, read_dataset
from punnet.data.formats import FORMATS
from punnet.errors import PunnetError
from punnet.scene.masks import encode_mask

HEIGHT, WIDTH = 12, 16
SQUARE = [2.0, 2, 9, 2, 9, 8, 2, 8]
POINTS = [5, 1, 1, 5, 3, 2, 5, 8, 2, 0, 0, 0, 8, 5, 2]
CAMERA = {"width": WIDTH, "height": HEIGHT, "fx": 15.0, "fy": 15.0, "cx": 7.5, "cy": 5.5}
IMAGE = {"id": 1, "file_name": "a.png", "width": WIDTH, "height": HEIGHT, "camera": CAMERA, "group": "p"}
BERRY = {"id": 4, "image_id": 1, "category_id": 1, "bbox": [2, 1, 7, 7], "iscrowd": 0}
FULL = {**BERRY, "segmentation": [SQUARE], "keypoints": POINTS, "visibility_detail": [3, 2, 2, 0, 2]}
RUNS = {**BERRY, "id": 5, "segmentation": encode_mask(np.eye(HEIGHT, WIDTH) > 0), "weight_g": 12.0}
CATEGORIES = [{"id": 1, "name": "ripe"}]
COCO = {"images": [IMAGE], "annotations": [FULL, RUNS], "categories": CATEGORIES, "info": {}}
PSD = {"images": [IMAGE], "annotations": [{**FULL, "ripeness": 3, "hardness": 1}]}
STRAWDI = {"images": [IMAGE], "annotations": [{**FULL, "label_index": 3, "ripeness3": "ripe"}]}
REGION = {
    "shape_attributes": {"name": "polygon", "all_points_x": [2, 9, 9], "all_points_y": [2, 2, 8]},
    "region_attributes": {"Degree of Ripeness": "3", "Hardness of Picking": "1"},
}
ELLIPSE = {
    "shape_attributes": {"name": "ellipse", "cx": 5, "cy": 5, "rx": 3, "ry": 2},
    "region_attributes": {"class": {"ripe": True}},
}
VIA = {"_via_img_metadata": {"a.png1": {"filename": "a.png", "size": 1, "regions": [REGION, ELLIPSE]}}}
LABELME = {
    "version": "5",
    "imagePath": "a.png",
    "imageHeight": HEIGHT,
    "imageWidth": WIDTH,
    "shapes": [
        {"label": "ripe", "points": [[2, 2], [9, 2], [9, 8]], "group_id": 1, "shape_type": "polygon"},
        {"label": "top", "points": [[5, 3]], "group_id": 1, "shape_type": "point", "flags": {"hidden": True}},
        {"label": "unripe", "points": [[1, 1], [4, 4]], "group_id": None, "shape_type": "circle"},
    ],
}
PICKING = {
    "file_name": "a.png",
    "height": HEIGHT,
    "width": WIDTH,
    "image_id": 3,
    "annotations": [{"bbox": [2, 1, 9, 8], "bbox_mode": 0, "category": "ripe", "keypoints": POINTS}],
}
JSON_FILES: dict[str, tuple[str, dict[str, Any]]] = {
    "coco": ("annotations.json", COCO),
    "cvat": ("instances_default.json", COCO),
    "labelme": ("a.json", LABELME),
    "picking-points": ("a.json", PICKING),
    "psd": ("coco.json", PSD),
    "strawdi": ("coco_keypoints.json", STRAWDI),
    "via": ("via.json", VIA),
}
CSV = (
    "filename,file_size,file_attributes,region_count,region_id,region_shape_attributes,region_attributes\n"
    + 'a.png,1,{},1,0,"{""name"":""rect"",""x"":2,""y"":2,""width"":5,""height"":4}","{""class"":""ripe""}"\n'
)
YAML = "train: images\nval: images\nnames:\n  0: ripe\n  1: unripe\n"
LABELS = "0 .5 .5 .25 .25\n1 .2 .2 .5 .2 .5 .6\n0 .5 .5 .2 .4 .5 .2 1 .5 .3 2 .5 .7 2 0 0 0 .6 .5 2\n"
TEXT_FILES = {
    "via": ("via.csv", CSV),
    "yolo": ("data.yaml", YAML),
    "yolo-labels": ("labels/a.txt", LABELS),
    **{name: (file, json.dumps(data)) for name, (file, data) in JSON_FILES.items() if name != "via"},
}
FUZZ = settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], database=None
)

numbers = st.one_of(
    st.integers(-3, 20), st.integers(), st.floats(), st.sampled_from([1e308, -1e9, 2**63, 2**70, 1e-320])
)
words = st.one_of(st.text(max_size=6), st.sampled_from(["ripe", "", "NaN", "polygon", "\0", "../a.png", "1"]))
values = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, words),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=3)),
    max_leaves=8,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that holds, beside the file that is fuzzed, what each format needs."""
    for place in ("", "img", "images"):
        (tmp_path / place).mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / place / "a.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    (tmp_path / "label").mkdir()
    cv2.imwrite(str(tmp_path / "label" / "a.png"), np.full((HEIGHT, WIDTH), 3, np.uint8))
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "a.txt").write_text(LABELS)
    (tmp_path / "data.yaml").write_text(YAML)
    (tmp_path / "person_keypoints_default.json").write_text(json.dumps(COCO))
    return tmp_path


def read(folder: Path, name: str, file: str) -> Dataset:
    kind = name.removesuffix("-labels")
    of_folder = kind in ("cvat", "psd", "strawdi", "yolo")
    return read_dataset(folder if of_folder else folder / file, kind)


def use(folder: Path, name: str, file: str) -> None:
    """Read, and ask for everything; only errors made on purpose may come of it."""
    with contextlib.suppress(PunnetError):
        for image in read(folder, name, file):
            image.berries()


def places(value: Any, here: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to all that is inside a JSON value, itself first."""
    yield here
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in inside:
        yield from places(inner, (*here, key))


def changed(value: Any, way: tuple[Any, ...], change: Callable[[Any, Any], None]) -> Any:
    """A copy in which ``change`` was made to what holds the end of the way, at its last key."""
    whole = {"": copy.deepcopy(value)}
    holder: Any = whole
    for key in ("", *way)[:-1]:
        holder = holder[key]
    change(holder, ("", *way)[-1])
    return whole.get("")


def test_every_format_is_fuzzed() -> None:
    assert {name.removesuffix("-labels") for name in (*JSON_FILES, *TEXT_FILES)} == set(FORMATS)


@pytest.mark.parametrize("name", [*JSON_FILES, "yolo", "yolo-labels"])
@pytest.mark.filterwarnings("ignore:.*sets of key-points")
def test_what_is_fuzzed_is_sound(folder: Path, name: str) -> None:
    file, text = TEXT_FILES[name] if name in TEXT_FILES else (JSON_FILES[name][0], json.dumps(VIA))
    (folder / file).write_text(text)
    assert read(folder, name, file)[0].annotations


@pytest.mark.parametrize("name", JSON_FILES)
@pytest.mark.filterwarnings("ignore:.*sets of key-points")
@FUZZ
@given(st.data())
def test_json_with_a_part_replaced_or_missing(folder: Path, name: str, data: st.DataObject) -> None:
    file, whole = JSON_FILES[name]
    damaged: Any = whole
    for _ in range(data.draw(st.integers(1, 2), label="changes")):
        way = data.draw(st.sampled_from(list(places(damaged))), label="place")
        if data.draw(st.booleans(), label="left out"):
            damaged = changed(damaged, way, lambda holder, key: holder.pop(key))
        else:
            new = data.draw(values, label="value")
            damaged = changed(damaged, way, lambda holder, key, new=new: holder.__setitem__(key, new))
    (folder / file).write_text(json.dumps(damaged))
    use(folder, name, file)


@pytest.mark.parametrize("name", TEXT_FILES)
@pytest.mark.filterwarnings("ignore:.*sets of key-points")
@FUZZ
@given(data=st.data())
def test_text_cut_off_or_overwritten(folder: Path, name: str, data: st.DataObject) -> None:
    file, text = TEXT_FILES[name]
    begin = data.draw(st.integers(0, len(text)), label="begin")
    end = data.draw(
        st.one_of(st.just(len(text)), st.integers(begin, min(begin + 20, len(text)))), label="end"
    )
    piece = data.draw(
        st.one_of(
            st.just(b""),
            st.binary(max_size=8),
            st.sampled_from(
                [b"[", b"{", b"nan", b"1e999", b"-1", b'"', b",", b": &a [*a]", b"!!python/x", b"\0"]
            ),
        ),
        label="piece",
    )
    (folder / file).write_bytes(text[:begin].encode() + piece + text[end:].encode())
    use(folder, name, file)


@FUZZ
@given(st.binary(max_size=200), st.sampled_from(["x.json", "x.csv", "x.yaml", "x.txt"]))
def test_anything_at_all_is_guessed_or_refused(folder: Path, content: bytes, file: str) -> None:
    (folder / file).write_bytes(content)
    told = file
    try:
        read_dataset(folder / file)
    except PunnetError as error:
        told = str(error)
    assert file in told


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a":' * 100_000, "9" * 5000, '{"images": [], "annotations": 3}']
)
@pytest.mark.parametrize("file", ["x.json", "x.yaml"])
def test_bottomless_nesting_and_endless_numbers(folder: Path, file: str, text: str) -> None:
    (folder / file).write_text(text)
    with pytest.raises(PunnetError, match=r"x\."):
        read_dataset(folder / file)
