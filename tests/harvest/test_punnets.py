import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.harvest.punnets import PunnetFiller, slot_offset
from punnet.sim.punnets import PUNNET_SIZE


def test_a_punnet_is_filled_before_the_next():
    filler = PunnetFiller(2, nominal=50.0)
    assert filler.choose() == 0
    assert filler.observe(0, 30.0) == 30.0
    assert filler.choose() == 0
    assert filler.observe(0, 55.0) == 25.0
    assert filler.choose() == 1
    filler.observe(1, 60.0)
    assert filler.choose() is None


def test_a_count_fills_it_too():
    filler = PunnetFiller(1, most=2)
    filler.observe(0, 1.0)
    filler.observe(0, 2.0)
    assert filler.choose() is None


def test_places_lie_inside_and_apart():
    places = np.array([slot_offset(count) for count in range(6)])
    assert (np.abs(places) < np.array(PUNNET_SIZE[:2]) / 2 - 0.015).all()
    gaps = np.linalg.norm(places[:, None] - places, axis=2) + 9 * np.eye(6)
    assert gaps.min() > 0.04
    assert np.array_equal(slot_offset(7), slot_offset(1))


@pytest.mark.parametrize("bad", [{"punnets": 0}, {"punnets": 1, "nominal": 0.0}, {"punnets": 1, "most": 0}])
def test_impossible_punnets_are_refused(bad):
    with pytest.raises(ConfigurationError, match="punnets"):
        PunnetFiller(**bad)
