"""What is counted, worked by hand; and a figure that shows it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import AnnotatedImage, Annotation, Dataset
from punnet.data.statistics import dataset_statistics, draw_statistics
from punnet.errors import OutputError, OutputExistsError
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Visibility

POINTS = np.array([[20.0, 5], [20, 10], [20, 40], [10, 25], [30, 25]])
CODES = np.array([3, 2, 1, 2, 2])


def a_set() -> Dataset:
    berries = (
        Annotation(
            1, PLUCKABLE, np.array([10, 10, 30, 50.0]), ripeness=1.0, stage="ripe", weight=20.0, occlusion=0.5
        ),
        Annotation(
            2,
            UNPLUCKABLE,
            np.array([10, 5, 30, 45.0]),
            keypoints=POINTS,
            visibility=CODES,
            keypoint_depths=np.array([0.5, np.nan, 0.4, 0.4, 0.4]),
        ),
        Annotation(3, UNPLUCKABLE, np.array([0, 0, 2, 2.0]), crowd=True, weight=99.0),
    )
    return Dataset(
        (
            AnnotatedImage(1, Path("a.png"), 100, 64, berries, group="one"),
            AnnotatedImage(2, Path("b.png"), 100, 64, group="one"),
        ),
        name="two",
    )


def test_counts() -> None:
    found = dataset_statistics(a_set())
    assert (found.images, found.berries, found.crowd, found.groups) == (2, 2, 1, 1)
    values = {name: one.values.tolist() for name, one in found.distributions.items()}
    assert values["berries an image"] == [2, 0]
    assert values["box size"] == pytest.approx([np.sqrt(800)] * 2)
    assert values["box size / image size"] == pytest.approx([np.sqrt(800) / 80] * 2)
    assert values["height / width of box"] == [2, 2]
    assert values["weight"] == [20]
    assert values["occlusion"] == [0.5]
    assert values["distance of picking point"] == [0.5]
    assert found.distributions["weight"].classes.tolist() == [PLUCKABLE]
    assert found.visibility.tolist() == np.eye(4, dtype=int)[CODES].tolist()
    assert found.stages == {"ripe": 1}


def test_json_is_plain_and_strict() -> None:
    data: dict[str, Any] = json.loads(json.dumps(dataset_statistics(a_set()).to_json(), allow_nan=False))
    assert data["visibility"]["picking_point"]["hidden by other"] == 1
    assert data["distributions"]["weight"] == {
        "unit": "g",
        "count": 1,
        "mean": 20.0,
        "percentiles": dict.fromkeys(("5", "25", "50", "75", "95"), 20.0),
    }


def test_an_empty_set() -> None:
    found = dataset_statistics(Dataset(()))
    assert (found.images, found.berries) == (0, 0)
    assert found.distributions["weight"].percentiles() is None
    json.dumps(found.to_json(), allow_nan=False)


@pytest.mark.parametrize("dataset", [a_set(), Dataset(())], ids=["two", "empty"])
def test_a_figure(dataset: Dataset, tmp_path: Path) -> None:
    path = draw_statistics(dataset_statistics(dataset), tmp_path / "figure.png")
    picture = cv2.imread(str(path))
    assert min(picture.shape[:2]) > 200
    with pytest.raises(OutputExistsError):
        draw_statistics(dataset_statistics(dataset), path)


def test_a_figure_of_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"figure\.doc: give a name that ends in \.png or \.svg or \.pdf"):
        draw_statistics(dataset_statistics(a_set()), tmp_path / "figure.doc")
    assert not list(tmp_path.iterdir())


def test_every_code_of_visibility_has_a_name() -> None:
    names = dataset_statistics(a_set()).to_json()["visibility"]["top"]
    assert len(names) == len(Visibility)
