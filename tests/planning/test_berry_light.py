"""How a berry is lit."""

import numpy as np
import pytest

from punnet.data.demos.pictures import mark_target
from punnet.planning.berry_light import berry_light

BOX = [60.0, 20.0, 100.0, 60.0]


def photograph(red: int, around: int = 30) -> np.ndarray:
    rgb = np.full((96, 128, 3), around, dtype=np.uint8)
    rgb[30:50, 70:90] = (red, 20, 20)
    return rgb


def test_a_brighter_berry_has_more_light() -> None:
    dark, bright = berry_light(photograph(80), BOX), berry_light(photograph(200), BOX)
    assert bright - dark == pytest.approx(np.log(200 / 80), abs=0.06)  # the berry is part of the picture


def test_exposure_is_taken_out() -> None:
    short = photograph(100)
    assert berry_light(2 * short, BOX) == pytest.approx(berry_light(short, BOX), abs=0.02)


@pytest.mark.parametrize(
    ("rgb", "box"),
    [
        (photograph(100), [200.0, 20.0, 240.0, 60.0]),
        (photograph(100), [-60.0, 20.0, -20.0, 60.0]),
        (photograph(100), [20.0, -80.0, 60.0, -40.0]),
        (mark_target(photograph(100), BOX), BOX),
        (np.zeros((96, 128, 3), dtype=np.uint8), BOX),
    ],
)
def test_nothing_to_see_is_unknown(rgb: np.ndarray, box: list[float]) -> None:
    assert np.isnan(berry_light(rgb, box))
