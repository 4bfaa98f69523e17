import numpy as np

from punnet.harvest.punnets import slot_offset
from punnet.sim.punnets import PUNNET_SIZE


def test_places_lie_inside_and_apart():
    places = np.array([slot_offset(count) for count in range(6)])
    assert (np.abs(places) < np.array(PUNNET_SIZE[:2]) / 2 - 0.015).all()
    gaps = np.linalg.norm(places[:, None] - places, axis=2) + 9 * np.eye(6)
    assert gaps.min() > 0.04
    assert np.array_equal(slot_offset(7), slot_offset(1))


def test_the_first_ones_lie_far_apart():
    assert np.linalg.norm(slot_offset(1) - slot_offset(0)) > 0.1
