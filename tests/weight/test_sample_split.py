"""Parts of weighed berries: no plant in two, and always the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.weight.sample_split import PARTS, images_of_part, part_of, split_groups
from punnet.weight.samples import MissedBerry, WeightSamples, collect_samples
from tests.train.weight.domes import dome
from tests.weight.weighed import weighed_dataset


def samples(count: int, views: int = 3) -> WeightSamples:
    berry, total = dome(), count * views
    return WeightSamples(
        observations=(berry,) * total,
        grams=np.full(total, 20.0),
        groups=tuple(f"plant {number % count}" for number in range(total)),
        occlusion=np.zeros(total),
        distance=np.full(total, 0.3),
        image=np.arange(total),
        annotation=np.arange(total),
    )


def test_no_plant_is_in_two_parts_and_shares_are_met() -> None:
    whole = samples(1000)
    parts = split_groups(whole)
    groups = [set(part.groups) for part in (parts.train, parts.validation, parts.test)]
    assert sum(map(len, groups)) == len(set.union(*groups)) == 1000
    assert len(parts.train) + len(parts.validation) + len(parts.test) == len(whole)
    assert len(groups[2]) == pytest.approx(200, abs=40)
    assert len(groups[1]) == pytest.approx(100, abs=30)


def test_a_plant_stays_where_it_is_whatever_else_there_is() -> None:
    few, many = split_groups(samples(100)), split_groups(samples(400, views=1))
    assert set(few.test.groups) <= set(many.test.groups)
    assert set(few.validation.groups) <= set(many.validation.groups)
    assert set(split_groups(samples(100), seed=1).test.groups) != set(few.test.groups)


def test_missed_berries_go_with_their_plant() -> None:
    whole = samples(100)
    plant = split_groups(whole).test.groups[0]
    parts = split_groups(replace(whole, missed=(MissedBerry("why", 20.0, plant, 0.5, 1, 1),)))
    assert [len(part.missed) for part in (parts.train, parts.validation, parts.test)] == [0, 0, 1]


def test_parts_by_name() -> None:
    whole = samples(60)
    assert part_of(whole, "all") is whole
    aside = part_of(whole, "test")
    assert aside.groups == split_groups(whole).test.groups
    assert part_of(aside, "test").groups == aside.groups  # of images that are all of that part
    with pytest.raises(ConfigurationError, match="in part 'train'; give more"):
        part_of(aside, "train")
    with pytest.raises(ConfigurationError, match="no part 'rest'"):
        part_of(whole, "rest")


@pytest.mark.parametrize(("shares", "said"), [((0.6, 0.4), "leave some"), ((-0.1, 0.1), "leave some")])
def test_impossible_shares_are_refused(shares: tuple[float, float], said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        split_groups(samples(10), test=shares[0], validation=shares[1])


def test_too_few_plants_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="too few"):
        split_groups(samples(1))


def test_the_images_of_a_part_are_those_of_its_samples(tmp_path: Path) -> None:
    dataset = weighed_dataset(tmp_path, [0.012 + 0.0003 * number for number in range(16)])
    parts = {name: [image.group for image in images_of_part(dataset, name)] for name in PARTS}
    assert sorted(str(group) for name in ("test", "validation", "train") for group in parts[name]) == sorted(
        str(image.group) for image in dataset
    )
    assert parts["test"] == list(split_groups(collect_samples(dataset), validation=0.0).test.groups)
    assert len(parts["all"]) == 16
