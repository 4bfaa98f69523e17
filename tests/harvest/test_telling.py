"""What a report says of berries that stayed on the plant."""

import numpy as np
import pytest

from punnet.harvest.telling import why_left
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Strawberries


def berry(class_index, ripeness, point=(0.7, 0.0, 0.7)):
    return Strawberries(
        image_size=(20, 20),
        boxes=np.array([[5.0, 5.0, 15.0, 15.0]]),
        classes=np.array([class_index]),
        ripeness=np.array([ripeness]),
        picking_points=np.array([point]),
    )


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (berry(UNPLUCKABLE, 0.3), "not ripe yet (ripeness 30%)"),
        (berry(UNPLUCKABLE, 0.99), "over-ripe or rotten (ripeness 99%)"),
        (berry(UNPLUCKABLE, np.nan), "not to be picked"),
        (berry(PLUCKABLE, 0.95, (np.nan,) * 3), "too few depth readings"),
        (berry(PLUCKABLE, 0.95), "the run ended before its turn"),
    ],
)
def test_why_a_berry_stays(left, words):
    assert words in why_left(left, 0)
