from __future__ import annotations

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.perception.segmentation import (
    ColourThresholds,
    berry_pixels,
    guarded_otsu,
    lab_planes,
    pixel_ripeness,
)
from tests.perception.drawings import GRAVEL, LEAF, PALE, RIPE, TURNING


def patch(colour: tuple[int, int, int]) -> np.ndarray:
    return lab_planes(np.full((20, 20, 3), colour, np.uint8))


def test_otsu_parts_two_heaps() -> None:
    values = np.concatenate((np.full(500, 10), np.full(300, 40))).astype(np.uint8)
    assert 10 <= guarded_otsu(values, 5, 60) < 40


@pytest.mark.parametrize(("heaps", "expected"), [((1, 5), 10.0), ((60, 90), 18.0), ((7, 7), 10.0)])
def test_otsu_is_guarded(heaps: tuple[int, int], expected: float) -> None:
    assert guarded_otsu(np.repeat(heaps, 100).astype(np.uint8), 10, 18) == expected


def test_otsu_of_nothing_is_the_stricter_bound() -> None:
    assert guarded_otsu(np.zeros(0, np.uint8), 10, 18) == 18


@pytest.mark.parametrize(
    ("colour", "expected"),
    [(RIPE, {"red"}), (PALE, {"pale", "leaf"}), (LEAF, {"leaf"}), (GRAVEL, set())],
)
def test_colours_fall_where_they_belong(colour: tuple[int, int, int], expected: set[str]) -> None:
    # Stems and green fruit share their hues: shape must tell them apart, colour says both.
    pixels = berry_pixels(patch(colour), ColourThresholds())
    assert {name for name in ("red", "pale", "leaf") if getattr(pixels, name)[5, 5]} == expected


def test_shade_grows_from_lit_flesh_but_not_alone() -> None:
    image = np.full((40, 40, 3), GRAVEL, np.uint8)
    image[5:15, 5:15] = RIPE
    image[15:25, 5:15] = (70, 48, 46)
    image[30:38, 30:38] = (70, 48, 46)
    red = berry_pixels(lab_planes(image), ColourThresholds()).red
    assert red[20, 10] == 1
    assert red[34, 34] == 0


def test_ripeness_rises_from_green_over_turning_to_red() -> None:
    means = [
        float((ripe * weight).sum() / weight.sum())
        for ripe, weight in (pixel_ripeness(patch(colour)) for colour in (PALE, TURNING, RIPE))
    ]
    assert means[0] < 0.05 < means[1] < 0.9 < means[2]


@pytest.mark.parametrize(
    "settings",
    [{"red_lowest": 20.0, "red_highest": 10.0}, {"red_growth": 0.0}, {"pale_hue_deg": (110.0, 60.0)}],
)
def test_bounds_out_of_order_are_refused(settings: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match="colour thresholds"):
        ColourThresholds(**settings)
