"""No plant in two parts, shares as asked, the same seed the same split, lists applied to the letter."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data import AnnotatedImage, Annotation, Dataset, read_coco
from punnet.data.splits import (
    SplitError,
    apply_split,
    choose_part,
    read_split,
    share_out,
    split_dataset,
    strawdi_split,
    write_split,
)
from punnet.errors import FileFormatError
from punnet.scene import PLUCKABLE

SHARES = {"train": 0.8, "validation": 0.1, "test": 0.1}


def a_set(groups: list[str | None], ripe: list[int] | None = None, folder: Path = Path("photos")) -> Dataset:
    """One image a group name, with as many pluckable berries as ``ripe`` says."""
    images = []
    for i, group in enumerate(groups):
        count = 0 if ripe is None else ripe[i]
        berries = tuple(
            Annotation(100 * i + k + 1, PLUCKABLE, np.array([1, 1, 5, 5.0])) for k in range(count)
        )
        images.append(
            AnnotatedImage(i + 1, folder / f"plant{i // 3}-{i % 3}.png", 40, 30, berries, group=group)
        )
    return Dataset(tuple(images), name="drawn")


@settings(max_examples=60, deadline=None)
@given(
    groups=st.lists(st.integers(0, 40), min_size=20, max_size=100).map(lambda some: [*some, *range(40)]),
    seed=st.integers(0, 1000),
    strata=st.booleans(),
)
def test_groups_stay_together_and_shares_hold(groups: list[int], seed: int, *, strata: bool) -> None:
    numbers = np.array(groups, float) if strata else None
    parts = share_out(groups, SHARES, np.random.default_rng(seed), strata=numbers)
    assert sorted(i for part in parts.values() for i in part) == list(range(len(groups)))
    owners = {name: {groups[i] for i in part} for name, part in parts.items()}
    assert sum(map(len, owners.values())) == len(set(groups))
    largest = max(groups.count(group) for group in set(groups))
    for name, share in SHARES.items():
        assert abs(len(parts[name]) - share * len(groups)) <= largest + 1


def test_single_images_are_shared_exactly() -> None:
    parts = share_out(range(200), SHARES, np.random.default_rng(0))
    assert [len(part) for part in parts.values()] == [160, 20, 20]


def test_parts_are_alike_in_their_ripe_berries(rng: np.random.Generator) -> None:
    ripe = rng.integers(0, 5, 100).tolist()
    split = split_dataset(a_set([None] * 100, ripe), SHARES)
    means = [np.mean([ripe[i] for i in part]) for part in split.parts.values()]
    assert np.ptp(means) < 0.35


def test_the_seed_decides() -> None:
    dataset = a_set([str(i // 2) for i in range(60)])
    first, again, other = (split_dataset(dataset, SHARES, seed=seed).parts for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_what_tells_the_groups() -> None:
    by_group = split_dataset(a_set([f"g{i // 3}" for i in range(60)]), SHARES)
    by_pattern = split_dataset(a_set([None] * 60), SHARES, pattern=r"(plant\d+)-")
    by_image = split_dataset(a_set([None] * 60), SHARES)
    assert (by_group.grouped_by, by_image.grouped_by) == ("group", "image")
    assert by_pattern.grouped_by == r"pattern (plant\d+)-"
    assert [len(set(split.groups)) for split in (by_group, by_pattern, by_image)] == [20, 20, 60]
    assert [split.straddling for split in (by_group, by_pattern, by_image)] == [[], [], []]
    some = split_dataset(a_set(["one", "one", None, None] * 10), {"train": 0.5, "test": 0.5})
    assert len(set(some.groups)) == 21  # an image without a group is one by itself


@pytest.mark.parametrize(
    ("shares", "pattern", "words"),
    [
        ({"train": 0.8, "test": 0.1}, None, "sum to 0.9"),
        ({"train": 1.2, "test": -0.2}, None, "above 0"),
        ({}, None, "above 0"),
        (SHARES, "(", "not a regular expression"),
        (SHARES, "nothing", "found in no file name"),
        (SHARES, "plant", "1 group"),
    ],
)
def test_impossible_splits_are_refused(shares: dict[str, float], pattern: str | None, words: str) -> None:
    with pytest.raises(SplitError, match=words):
        split_dataset(a_set([None] * 30), shares, pattern=pattern)


def test_parts_on_disk_lead_to_the_photographs(tmp_path: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    dataset = a_set([str(i // 2) for i in range(20)], [1] * 20, folder)
    for image in dataset:
        cv2.imwrite(str(image.path), np.zeros((30, 40, 3), np.uint8))
    out = tmp_path / "parts"
    out.mkdir()
    split = split_dataset(dataset, SHARES, seed=3)
    write_split(dataset, split, out)
    lists = read_split(out / "split.json")
    for name in SHARES:
        part = read_coco(out / f"{name}.json")
        assert all(image.path.is_file() for image in part)
        assert [image.path.name for image in part] == lists[name]
        assert [image.id for image in part] == [dataset[i].id for i in split.parts[name]]
    assert json.loads((out / "split.json").read_text())["seed"] == 3
    assert apply_split(dataset, lists, "split.json").parts == split.parts
    assert len(choose_part(dataset, str(out / "split.json"))) == len(split.parts["test"])


def test_files_of_one_name_are_listed_by_id(tmp_path: Path) -> None:
    images = tuple(AnnotatedImage(i, Path(f"plant{i}/rgb.png"), 8, 8) for i in range(1, 11))
    dataset = Dataset(images)
    split = split_dataset(dataset, {"train": 0.5, "test": 0.5})
    write_split(dataset, split, tmp_path)
    lists = read_split(tmp_path / "split.json")
    assert all(isinstance(label, int) for part in lists.values() for label in part)
    assert apply_split(dataset, lists, "split.json").parts == split.parts


def test_lists_are_applied_to_the_letter() -> None:
    dataset = a_set(["a", "a", "b"])
    split = apply_split(dataset, {"train": ["plant0-0.png"], "test": [2]}, "x.json")
    assert split.parts == {"train": [0], "test": [1]}
    assert split.straddling == ["a"]
    with pytest.raises(SplitError, match=r"x\.json: 1 images of part 'train'.*'gone\.png'"):
        apply_split(dataset, {"train": ["gone.png", 1]}, "x.json")
    with pytest.raises(SplitError, match="both 'train' and 'test'"):
        apply_split(dataset, {"train": [1], "test": ["plant0-0.png"]}, "x.json")


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"parts": {}}',
        '{"parts": {"a": []}}',
        '{"parts": {"a": [true]}}',
        '{"parts": {"../a": [1]}}',
    ],
)
def test_damaged_lists_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "split.json").write_text(text)
    with pytest.raises(FileFormatError, match=r"split\.json"):
        read_split(tmp_path / "split.json")


def test_the_fixed_split_of_strawdi() -> None:
    train, test = strawdi_split()
    assert (len(train), len(test)) == (160, 40)
    assert len({*train, *test}) == 200
    assert ({2290, 2807} <= set(train)) or ({2290, 2807} <= set(test))  # one plant


def test_the_fixed_split_fits_the_data(shared_data: Path) -> None:
    data = json.loads((shared_data / "strawdi" / "test" / "coco_keypoints.json").read_text())
    train, test = strawdi_split()
    assert {image["id"] for image in data["images"]} == {*train, *test}
    ripe = [a["image_id"] for a in data["annotations"] if a["category_id"] == 1]
    in_test = sum(number in set(test) for number in ripe)
    assert abs(in_test / len(ripe) - 0.2) < 0.01
