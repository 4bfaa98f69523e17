"""COCO there and back, other people's COCO, and every kind of damage."""

from __future__ import annotations

import contextlib
import json
import math
from copy import deepcopy
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data import AnnotatedImage, Annotation, Dataset, LabelPixels, read_coco, write_coco
from punnet.data.coco import dataset_to_coco
from punnet.data.dataset import STAGES
from punnet.errors import FileFormatError, OutputError, OutputExistsError, PunnetError
from punnet.geometry import CameraIntrinsics
from punnet.scene import PLUCKABLE, UNPLUCKABLE
from punnet.scene.masks import decode_mask, encode_mask

HEIGHT, WIDTH = 10, 20
CAMERA = {"width": WIDTH, "height": HEIGHT, "fx": 15.0, "fy": 15.5, "cx": 9.5, "cy": 4.5}
POSE = [[1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]]
MASK = np.zeros((HEIGHT, WIDTH), bool)
MASK[4:9, 3:7] = True
FILE: dict[str, Any] = {
    "info": {"description": "three berries"},
    "licenses": [{"id": 1, "name": "CC0"}],
    "made_with": "a tool",
    "images": [
        {
            "id": 4,
            "file_name": "rgb/a.jpg",
            "width": WIDTH,
            "height": HEIGHT,
            "depth_path": "depth/a.png",
            "camera": CAMERA,
            "T_base_camera": POSE,
            "group": "plant-7",
            "view": "far",
        },
        {"id": 2, "file_name": "rgb/b.jpg", "width": WIDTH, "height": HEIGHT},
    ],
    "annotations": [
        {
            "id": 9,
            "image_id": 4,
            "category_id": 1,
            "bbox": [3.0, 1.0, 4.0, 8.0],
            "area": 20,
            "iscrowd": 0,
            "segmentation": encode_mask(MASK),
            "keypoints": [5.0, 1.0, 1, 5.0, 4.0, 2, 5.0, 8.0, 1, 0.0, 0.0, 0, 6.0, 6.0, 2],
            "num_keypoints": 4,
            "visibility_detail": [3, 2, 1, 0, 2],
            "keypoint_depths_m": [0.5, 0.51, 0.52, None, 0.5],
            "ripeness": 0.75,
            "stage": "turning",
            "occlusion": 0.125,
            "weight_g": 12.5,
            "score": 0.5,
            "hand": "left",
        },
        {
            "id": 3,
            "image_id": 4,
            "category_id": 2,
            "bbox": [10.0, 2.0, 5.0, 5.0],
            "area": 25,
            "iscrowd": 1,
            "segmentation": [[10.0, 2.0, 15.0, 2.0, 15.0, 7.0, 10.0, 7.0]],
        },
    ],
    "categories": [
        {
            "id": number,
            "name": name,
            "keypoints": ["picking_point", "top", "bottom", "left_grasp", "right_grasp"],
            "skeleton": [[1, 2], [2, 3], [4, 5]],
        }
        for number, name in ((1, "pluckable"), (2, "unpluckable"))
    ],
}


def saved(folder: Path, data: Any, name: str = "annotations.json") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(json.dumps(data))
    return path


def changed(**changes: Any) -> dict[str, Any]:
    """The file above with its first annotation changed; a field of value ``...`` is taken out."""
    data = deepcopy(FILE)
    data["annotations"][0].update(changes)
    for name in [name for name, value in changes.items() if value is ...]:
        del data["annotations"][0][name]
    return data


def test_every_field_is_read(tmp_path: Path) -> None:
    dataset = read_coco(saved(tmp_path / "set", FILE))
    assert (dataset.name, dataset.info, dataset.licences) == ("set", FILE["info"], FILE["licenses"])
    assert dataset.extra == {"made_with": "a tool"}
    first, second = dataset
    assert (first.id, first.path, first.depth_path) == (
        4,
        tmp_path / "set" / "rgb" / "a.jpg",
        tmp_path / "set" / "depth" / "a.png",
    )
    assert first.camera == CameraIntrinsics(**CAMERA)
    assert (first.group, first.extra) == ("plant-7", {"T_base_camera": POSE, "view": "far"})
    assert (second.id, second.annotations, second.camera, second.group) == (2, (), None, None)
    berry, crowd = first.annotations
    assert (berry.id, berry.class_index, berry.crowd) == (9, PLUCKABLE, False)
    assert berry.box.tolist() == [3, 1, 7, 9]
    assert np.array_equal(first.mask(0), MASK)
    assert berry.keypoints[[0, 4]].tolist() == [[5, 1], [6, 6]]
    assert np.isnan(berry.keypoints[3]).all()
    assert berry.visibility.tolist() == [3, 2, 1, 0, 2]
    assert berry.keypoint_depths == pytest.approx([0.5, 0.51, 0.52, math.nan, 0.5], nan_ok=True)
    assert (berry.ripeness, berry.stage, berry.occlusion, berry.weight) == (0.75, "turning", 0.125, 12.5)
    assert berry.extra == {"score": 0.5, "hand": "left"}
    assert (crowd.id, crowd.class_index, crowd.crowd) == (3, UNPLUCKABLE, True)
    assert crowd.segmentation == FILE["annotations"][1]["segmentation"]
    assert first.mask(1).sum() == 25
    assert crowd.keypoints is None
    assert math.isnan(crowd.ripeness)


def test_file_read_and_written_is_the_same_file(tmp_path: Path) -> None:
    dataset = read_coco(saved(tmp_path, FILE))
    write_coco(dataset, tmp_path / "again.json")
    assert json.loads((tmp_path / "again.json").read_text()) == FILE


finite = st.floats(-1000, 1000, allow_nan=False)
shares = st.just(math.nan) | st.floats(0, 1)
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | finite | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=4,
)
extras = st.dictionaries(st.sampled_from(["note", "score", "x", "hand"]), plain, max_size=2)
masks = st.binary(min_size=HEIGHT * WIDTH, max_size=HEIGHT * WIDTH).map(
    lambda data: np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH) > 128
)
polygons = st.lists(st.lists(finite, min_size=6, max_size=6), min_size=1, max_size=2)


@st.composite
def keypoints(draw: st.DrawFn) -> dict[str, Any]:
    codes = np.array(draw(st.lists(st.integers(0, 3), min_size=5, max_size=5)))
    points = np.array(draw(st.lists(st.tuples(finite, finite), min_size=5, max_size=5)))
    points[codes == 0] = np.nan
    return {"keypoints": points, "visibility": codes}


@st.composite
def annotations(draw: st.DrawFn, number: int) -> Annotation:
    left, top = draw(finite), draw(finite)
    width, height = draw(st.floats(0, 500)), draw(st.floats(0, 500))
    depths = st.none() | st.lists(st.just(math.nan) | st.floats(0, 9), min_size=5, max_size=5)
    return Annotation(
        id=number,
        class_index=draw(st.integers(0, 1)),
        box=np.array([left, top, left + width, top + height]),
        segmentation=draw(st.none() | masks.map(encode_mask) | polygons),
        crowd=draw(st.booleans()),
        ripeness=draw(shares),
        occlusion=draw(shares),
        weight=draw(st.just(math.nan) | st.floats(0, 90)),
        stage=draw(st.none() | st.sampled_from(STAGES)),
        keypoint_depths=draw(depths),
        extra=draw(extras),
        **draw(st.just({}) | keypoints()),
    )


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    images = []
    for number in range(draw(st.integers(0, 3))):
        camera = CameraIntrinsics(**CAMERA)
        depth = st.none() | st.just(Path(f"/data/depth/{number}.png"))
        images.append(
            AnnotatedImage(
                id=10 - number,
                path=Path(f"/data/rgb/{number}.jpg"),
                width=WIDTH,
                height=HEIGHT,
                annotations=tuple(draw(annotations(20 * number + k)) for k in range(draw(st.integers(0, 3)))),
                depth_path=draw(depth),
                camera=draw(st.none() | st.just(camera)),
                group=draw(st.none() | st.text(max_size=4)),
                extra=draw(extras),
            )
        )
    rest = st.dictionaries(st.sampled_from(["made_with", "version"]), plain, max_size=2)
    info = st.dictionaries(st.text(max_size=4), plain, max_size=2)
    return Dataset(
        tuple(images), info=draw(info), licences=draw(st.lists(plain, max_size=2)), extra=draw(rest)
    )


ANNOTATION_VALUES = ("id", "class_index", "crowd", "stage", "extra", "segmentation")
ANNOTATION_NUMBERS = ("box", "keypoints", "visibility", "ripeness", "occlusion", "weight", "keypoint_depths")


def assert_equal(one: Dataset, other: Dataset) -> None:
    assert (one.info, one.licences, one.extra) == (other.info, other.licences, other.extra)
    for image, twin in zip(one, other, strict=True):
        for name in ("id", "path", "width", "height", "depth_path", "camera", "group", "extra"):
            assert getattr(image, name) == getattr(twin, name), name
        for annotation, same in zip(image.annotations, twin.annotations, strict=True):
            for name in ANNOTATION_VALUES:
                assert getattr(annotation, name) == getattr(same, name), name
            for name in ANNOTATION_NUMBERS:
                value, found = getattr(annotation, name), getattr(same, name)
                assert (value is None) == (found is None), name
                if value is not None:
                    # A box is written as corner and size: the other corner may be off by the last bit.
                    np.testing.assert_allclose(found, value, rtol=0, atol=1e-9, err_msg=name)


@settings(max_examples=60, deadline=None)
@given(dataset=datasets(), place=st.sampled_from(["/data", "/elsewhere/deep"]))
def test_written_and_read_again_is_equal_in_every_field(
    dataset: Dataset, place: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    text = json.dumps(dataset_to_coco(dataset, Path(place)), allow_nan=False)
    folder = tmp_path_factory.mktemp("coco")
    data = json.loads(text)
    # As if the file lay in /data or elsewhere, where this test can't write.
    for image in data["images"]:
        for name in ("file_name", "depth_path"):
            if name in image:
                assert not Path(image[name]).is_absolute()
                image[name] = str(Path(place, image[name]).resolve())
    assert_equal(dataset, read_coco(saved(folder, data)))


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_damaged_files_raise_only_our_errors(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Any one value of the file replaced by any other, or taken out."""
    damaged = deepcopy(FILE)
    value: Any = damaged
    while True:
        key = data.draw(st.sampled_from(sorted(value) if isinstance(value, dict) else range(len(value))))
        inner = value[key]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.integers(0, 3)) == 0:
            break
        value = inner
    strange = st.sampled_from(
        [1e308, -1e308, 2**70, -(2**63), 1e-320, math.nan, math.inf, "\0", "\ud800", "1e999"]
    )
    replacement = data.draw(st.just(...) | plain | strange | st.just([[[]]]))
    if replacement is ...:
        del value[key]
    else:
        value[key] = replacement
    with contextlib.suppress(PunnetError):
        dataset = read_coco(saved(tmp_path_factory.mktemp("coco"), damaged))
        for image in dataset:
            image.berries()
            for index in range(len(image.annotations)):
                image.mask(index)
            with contextlib.suppress(PunnetError):
                image.frame()
        write_coco(dataset, tmp_path_factory.mktemp("coco") / "again.json")


@settings(max_examples=30, deadline=None)
@given(cut=st.integers(0, 2000), insert=st.binary(max_size=3))
def test_files_that_are_cut_or_overwritten_raise_only_our_errors(
    cut: int, insert: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = json.dumps(FILE).encode()
    path = tmp_path_factory.mktemp("coco") / "annotations.json"
    for content in (whole[:cut], whole[:cut] + insert + whole[cut + len(insert) :]):
        path.write_bytes(content)
        with contextlib.suppress(PunnetError):
            read_coco(path)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "[" * 100_000,
        '{"images": 3, "annotations": []}',
        '{"images": [{}], "annotations": []}',
        '{"images": [4], "annotations": []}',
        '{"images": [], "annotations": [4]}',
    ],
)
def test_what_is_no_coco_is_told(tmp_path: Path, text: str) -> None:
    (tmp_path / "coco.json").write_text(text)
    with pytest.raises(FileFormatError, match=r"coco\.json"):
        read_coco(tmp_path / "coco.json")


def test_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"coco\.json: no such file"):
        read_coco(tmp_path / "coco.json")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bbox": [1, 2, 3]}, "bbox"),
        ({"bbox": [1, 2, -3, 4]}, "box"),
        ({"bbox": ..., "segmentation": ..., "keypoints": ..., "visibility_detail": ...}, "no bbox"),
        ({"category_id": 3}, "category_id 3"),
        ({"category_id": ...}, "category_id"),
        ({"segmentation": [[1, 2, 3, 4]]}, "polygon"),
        ({"segmentation": {"size": [20, 10], "counts": "0"}}, "run lengths"),
        ({"segmentation": 4}, "segmentation"),
        ({"keypoints": [1, 2, 2]}, "keypoints"),
        ({"keypoints": [1, 2, 5] * 5}, "visibility"),
        ({"visibility_detail": [0, 2, 1, 0, 2]}, "contradicts"),
        ({"visibility_detail": [2, 2]}, "visibility_detail"),
        ({"ripeness": 3}, "ripeness"),
        ({"ripeness": "red"}, "ripeness"),
        ({"stage": "purple"}, "stage"),
        ({"weight_g": -1}, "weight"),
        ({"keypoint_depths_m": [1]}, "keypoint_depths_m"),
        ({"iscrowd": "yes"}, "iscrowd"),
        ({"id": 3}, "id 3 is given twice"),
        ({"image_id": 99}, "not listed"),
    ],
)
def test_damage_is_told_with_file_annotation_and_fault(
    tmp_path: Path, changes: dict[str, Any], told: str
) -> None:
    path = saved(tmp_path, changed(**changes))
    with pytest.raises(FileFormatError) as caught:
        read_coco(path)
    assert str(path) in str(caught.value)
    assert told in str(caught.value)
    if "id" not in changes:
        assert "annotation 9" in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"width": 0}, "size"),
        ({"height": "tall"}, "height"),
        ({"file_name": ...}, "file_name"),
        ({"file_name": 7}, "file_name"),
        ({"camera": {"width": 20}}, "camera"),
        ({"camera": 5}, "camera"),
        ({"depth_path": 5}, "depth_path"),
        ({"id": 2}, "image id 2 is given twice"),
    ],
)
def test_damage_of_images_is_told(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    data = deepcopy(FILE)
    data["images"][0].update(changes)
    data["images"][0] = {name: value for name, value in data["images"][0].items() if value is not ...}
    with pytest.raises(FileFormatError, match=told):
        read_coco(saved(tmp_path, data))


def test_box_is_stretched_to_hold_the_keypoints(tmp_path: Path) -> None:
    dataset = read_coco(saved(tmp_path, changed(bbox=[3, 4, 4, 5])))
    assert dataset[0].annotations[0].box.tolist() == [3, 1, 7, 9]
    assert dataset_to_coco(dataset, tmp_path)["annotations"][0]["bbox"] == [3, 1, 4, 8]


def test_keypoints_that_nobody_annotated_are_not_absent_ones(tmp_path: Path) -> None:
    nothing = changed(keypoints=[0] * 15, num_keypoints=0, visibility_detail=...)
    assert read_coco(saved(tmp_path, nothing))[0].annotations[0].keypoints is None
    absent = changed(keypoints=[0] * 15, num_keypoints=0, visibility_detail=[0] * 5)
    assert read_coco(saved(tmp_path, absent))[0].annotations[0].visibility.tolist() == [0] * 5


def test_box_comes_from_outline_or_keypoints_if_it_must(tmp_path: Path) -> None:
    data = changed(bbox=..., keypoints=..., visibility_detail=...)
    assert read_coco(saved(tmp_path, data))[0].annotations[0].box.tolist() == [3, 4, 7, 9]
    points_alone = changed(bbox=..., segmentation=...)
    assert read_coco(saved(tmp_path, points_alone))[0].annotations[0].box.tolist() == [5, 1, 6, 8]


def test_empty_segmentation_is_none(tmp_path: Path) -> None:
    dataset = read_coco(saved(tmp_path, changed(segmentation=[])))
    assert dataset[0].mask(0) is None
    assert dataset_to_coco(dataset, tmp_path)["annotations"][0]["area"] == 32


def test_categories_go_by_name(tmp_path: Path) -> None:
    data = deepcopy(FILE)
    data["categories"] = [
        {"id": 1, "name": "Un-ripe"},
        {"id": 2, "name": "Ripe"},
        {"id": 0, "name": "berries"},
    ]
    data["categories"][0]["name"] = "Unripe"
    berries = read_coco(saved(tmp_path, data))[0].annotations
    assert [berry.class_index for berry in berries] == [UNPLUCKABLE, PLUCKABLE]


def test_unknown_categories_need_a_word_from_the_user(tmp_path: Path) -> None:
    data = deepcopy(FILE)
    data["categories"] = [{"id": 1, "name": "strawberry"}, {"id": 2, "name": "leaf"}]
    path = saved(tmp_path, data)
    with pytest.raises(FileFormatError, match="annotation 9: class 'strawberry' is not known"):
        read_coco(path)
    berries = read_coco(path, class_map={"Strawberry": "pluckable", "leaf": "ignore"})[0].annotations
    assert [(berry.id, berry.class_index) for berry in berries] == [(9, PLUCKABLE)]
    assert berries[0].extra["category_name"] == "strawberry"


def test_without_categories_the_ids_are_ours(tmp_path: Path) -> None:
    data = deepcopy(FILE)
    del data["categories"]
    assert [a.class_index for a in read_coco(saved(tmp_path, data))[0].annotations] == [
        PLUCKABLE,
        UNPLUCKABLE,
    ]


def test_keypoints_in_another_order_are_put_in_ours(tmp_path: Path) -> None:
    data = deepcopy(FILE)
    for category in data["categories"]:
        category["keypoints"] = ["top", "bottom", "picking_point", "left_grasp", "right_grasp"]
    berry = read_coco(saved(tmp_path, data))[0].annotations[0]
    assert berry.keypoints[:3].tolist() == [[5, 8], [5, 1], [5, 4]]
    assert berry.visibility.tolist() == [1, 3, 2, 0, 2]
    assert berry.keypoint_depths[:3].tolist() == [0.52, 0.5, 0.51]
    data["categories"][0]["keypoints"] = ["nose", "eye"]
    with pytest.raises(FileFormatError, match="category 1 has the key-points"):
        read_coco(saved(tmp_path, data))


def test_compressed_run_lengths_of_another_tool(tmp_path: Path) -> None:
    from pycocotools import mask as pycocotools

    theirs = pycocotools.encode(np.asfortranarray(MASK, dtype=np.uint8))
    data = changed(segmentation={"size": theirs["size"], "counts": theirs["counts"].decode()})
    assert np.array_equal(read_coco(saved(tmp_path, data))[0].mask(0), MASK)


def test_our_file_is_read_by_pycocotools(tmp_path: Path) -> None:
    from pycocotools.coco import COCO

    write_coco(read_coco(saved(tmp_path, FILE)), tmp_path / "again.json")
    theirs = COCO(str(tmp_path / "again.json"))
    assert np.array_equal(theirs.annToMask(theirs.anns[9]), MASK)
    assert theirs.annToMask(theirs.anns[3]).sum() == 25


def test_masks_in_pngs_become_run_lengths(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), MASK.astype(np.uint8) * 7)
    berry = Annotation(1, PLUCKABLE, np.array([3, 4, 7, 9]), LabelPixels(tmp_path / "a.png", 7))
    dataset = Dataset((AnnotatedImage(1, tmp_path / "a.jpg", WIDTH, HEIGHT, (berry,)),))
    entry = dataset_to_coco(dataset, tmp_path)["annotations"][0]
    assert np.array_equal(decode_mask(entry["segmentation"]), MASK)
    assert entry["area"] == 20
    (tmp_path / "a.png").unlink()
    with pytest.raises(FileFormatError, match=r"a\.png"):
        write_coco(dataset, tmp_path / "out.json")
    assert not (tmp_path / "out.json").exists()


def test_uncompressed_run_lengths_are_written_compressed(tmp_path: Path) -> None:
    data = changed(segmentation={"size": [HEIGHT, WIDTH], "counts": [0, HEIGHT * WIDTH]})
    written = dataset_to_coco(read_coco(saved(tmp_path, data)), tmp_path)["annotations"][0]
    assert isinstance(written["segmentation"]["counts"], str)
    assert decode_mask(written["segmentation"]).all()
    assert written["area"] == HEIGHT * WIDTH


def test_photographs_are_found_beside_the_file(tmp_path: Path) -> None:
    path = saved(tmp_path / "annotations", FILE)
    photo = tmp_path / "images" / "rgb" / "a.jpg"
    photo.parent.mkdir(parents=True)
    cv2.imwrite(str(photo), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert read_coco(path)[0].path == photo
    assert read_coco(path, tmp_path / "elsewhere")[0].path == tmp_path / "elsewhere" / "rgb" / "a.jpg"


def test_paths_survive_another_folder_and_links(tmp_path: Path) -> None:
    photo = tmp_path / "photos" / "rgb" / "a.jpg"
    photo.parent.mkdir(parents=True)
    cv2.imwrite(str(photo), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    deep = tmp_path / "results" / "deep"
    deep.mkdir(parents=True)
    (tmp_path / "link").symlink_to(deep)
    dataset = read_coco(saved(tmp_path / "photos", FILE)).subset([0])
    for place in (deep / "a.json", tmp_path / "link" / "b.json"):
        write_coco(dataset, place)
        assert read_coco(place)[0].path.samefile(photo)


def test_existing_files_need_force(tmp_path: Path) -> None:
    dataset = read_coco(saved(tmp_path, FILE))
    with pytest.raises(OutputExistsError, match="--force"):
        write_coco(dataset, tmp_path / "annotations.json")
    write_coco(dataset.subset([]), tmp_path / "annotations.json", force=True)
    assert len(read_coco(tmp_path / "annotations.json")) == 0


def test_what_json_cannot_say_is_told_and_nothing_is_written(tmp_path: Path) -> None:
    dataset = Dataset((), info={"when": object()})
    with pytest.raises(OutputError, match="JSON"):
        write_coco(dataset, tmp_path / "out.json")
    assert not list(tmp_path.iterdir())
