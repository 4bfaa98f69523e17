"""Pages hold every image once, with what is annotated drawn on it; what can't be read is said in the picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data import Dataset, LabelPixels, read_coco
from punnet.data.contact_sheet import SheetLayout, contact_sheet, write_contact_sheets
from punnet.data.drawing import draw_annotated
from punnet.errors import ConfigurationError
from punnet.outputs import OutputFolder
from punnet.scene.overlay import CLASS_COLOURS


@pytest.fixture
def dataset(coco: dict[str, Any], coco_file: Callable[[dict[str, Any]], Path]) -> Dataset:
    return read_coco(coco_file(coco))


def has(picture: np.ndarray, colour: tuple[int, int, int]) -> bool:
    return bool((np.abs(picture.astype(int) - colour).max(axis=2) < 40).any())


def test_masks_and_boxes_are_drawn_in_the_colours_of_the_classes(dataset: Dataset) -> None:
    picture = draw_annotated(dataset[0], 80)
    assert picture.shape == (60, 80, 3)
    assert has(picture[18:42, 28:52], CLASS_COLOURS[0])
    assert has(picture[3:17, 3:17], CLASS_COLOURS[1])
    assert (picture[45:, 60:] == 90).all()  # nothing where nothing is


def test_it_is_drawn_at_the_size_asked_for(dataset: Dataset) -> None:
    small = draw_annotated(dataset[0], 40)
    assert small.shape == (30, 40, 3)
    assert has(small[9:21, 14:26], CLASS_COLOURS[0])
    assert draw_annotated(dataset[0], 4000).shape == (60, 80, 3)


def test_crowd_is_drawn_grey(dataset: Dataset) -> None:
    berries, crowd = dataset[1].annotations
    with_crowd = draw_annotated(dataset[1], 80)
    without = draw_annotated(replace(dataset[1], annotations=(berries,)), 80)
    changed = np.argwhere((with_crowd != without).any(axis=2))
    left, top, right, bottom = crowd.box
    assert len(changed)
    assert (changed.min(axis=0) >= (top - 1, left - 1)).all()
    assert (changed.max(axis=0) <= (bottom + 1, right + 1)).all()


def test_what_can_not_be_read_is_said_in_the_picture(dataset: Dataset, tmp_path: Path) -> None:
    missing = replace(dataset[0], path=tmp_path / "gone.png")
    assert draw_annotated(missing, 80).shape == (60, 80, 3)
    labelled = tuple(
        replace(a, segmentation=LabelPixels(tmp_path / "gone.png", 1)) for a in dataset[0].annotations
    )
    picture = draw_annotated(replace(dataset[0], annotations=labelled), 80)
    assert not has(picture, CLASS_COLOURS[0])
    assert picture.shape == (60, 80, 3)


def test_a_photograph_of_another_size_is_stretched_to_the_annotation(dataset: Dataset) -> None:
    cv2.imwrite(str(dataset[0].path), np.full((30, 20, 3), 90, np.uint8))
    assert draw_annotated(dataset[0], 80).shape == (60, 80, 3)


def test_pages(dataset: Dataset, tmp_path: Path) -> None:
    images = tuple(replace(dataset[0], id=10 + k, annotations=()) for k in range(5))
    several = replace(dataset, images=images)
    layout = SheetLayout(columns=2, rows=1, cell=64)
    with OutputFolder(tmp_path / "sheets") as output:
        pages = [page.name for page in write_contact_sheets(several, output, layout)]
    assert pages == ["sheet-001.png", "sheet-002.png", "sheet-003.png"]
    widths = {cv2.imread(str(tmp_path / "sheets" / page)).shape[1] for page in pages}
    assert len(widths) == 1  # the last page, half empty, is as wide


def test_a_page_shows_each_image_in_its_place(dataset: Dataset) -> None:
    page = contact_sheet(list(dataset), SheetLayout(columns=2, rows=1, cell=80), "two")
    bare = contact_sheet([dataset[0]], SheetLayout(columns=2, rows=1, cell=80), "two")
    assert page.shape == bare.shape
    changed = np.argwhere((page != bare).any(axis=2))
    assert changed[:, 1].min() >= 80  # the second image, to the right


@pytest.mark.parametrize(
    "settings", [{"columns": 0}, {"rows": 0}, {"cell": 10}, {"columns": 100, "rows": 100}]
)
def test_impossible_layouts_are_refused(settings: dict[str, int]) -> None:
    with pytest.raises(ConfigurationError, match="contact sheet"):
        SheetLayout(**settings)
