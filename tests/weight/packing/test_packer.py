"""The packer's books: every berry in one place, grams as the weigh cell says, no punnet too full."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, RobotError, ShapeError
from punnet.weight.packing import (
    MINIMUM_QUANTITY,
    BerryPopulation,
    FirstFit,
    LookAhead,
    Packer,
    PackingConfig,
    WeighedBerry,
)
from punnet.weight.packing.end_value import EndValue, likely_berries

POPULATION = BerryPopulation(error=0.08)
WITH_CELLS = LookAhead(PackingConfig(nominal=60.0, most_berries=5, cell_error=0.5, population=POPULATION))
WITHOUT = LookAhead(PackingConfig(nominal=60.0, most_berries=5, cell_error=None, population=POPULATION))


def berry(number: int, grams: float = 18.0) -> WeighedBerry:
    if math.isnan(grams):
        return WeighedBerry(number, grams)
    return WeighedBerry(number, grams, 0.9 * grams, 1.1 * grams)


def whereabouts(packer: Packer) -> Counter[int]:
    """How often each berry is somewhere."""
    punnets = [*packer.punnets.values(), *packer.packed, *packer.rejected, *packer.missing_punnets]
    held = [berry.number for punnet in punnets for berry in punnet.berries]
    return Counter([*held, *(b.number for b in packer.aside), *(b.number for b in packer.lost_berries)])


EVENTS = st.lists(
    st.tuples(
        st.floats(4.8, 38.9) | st.just(math.nan),
        st.sampled_from(("drop", "drop", "drop", "lose", "missing", "wrong reading")),
        st.floats(-0.2, 0.2),
    ),
    max_size=40,
)


@settings(max_examples=60, deadline=None)
@given(EVENTS, st.sampled_from((WITH_CELLS, WITHOUT, FirstFit(WITH_CELLS.config))), st.integers(1, 3))
def test_whatever_happens_every_berry_is_in_exactly_one_place(events, policy, places):
    packer = Packer(policy, places)
    true: dict[int, float] = {}
    for number, (grams, event, error) in enumerate(events):
        true[number] = 18.6 if math.isnan(grams) else grams * (1 + error)
        follow(packer, berry(number, grams), event, true)
        assert whereabouts(packer) == Counter(range(number + 1))
        assert all(len(punnet.berries) <= 5 for punnet in packer.punnets.values())
        assert len(packer.aside) <= packer.config.aside_places
        assert len(packer.punnets) == places


def follow(packer: Packer, item: WeighedBerry, event: str, true: dict[int, float]) -> None:
    """One berry through its event, with the punnets replaced as on a line."""
    number = packer.choose(item)
    if number is None and len(packer.aside) < packer.config.aside_places:
        packer.put_aside(item)
        return
    if number is None:
        number = packer.best(item)[0]
    packer.place(number, item)
    if event == "lose":
        packer.lost(number, item)
    if event == "missing":
        packer.missing(number)
        packer.open()
        return
    content = sum(true[held.number] for held in packer.punnets[number].berries)
    if event == "wrong reading":
        with pytest.raises(RobotError, match="weigh cell"):
            packer.observe(number, math.nan)
    elif packer.config.cell_error is not None:
        packer.observe(number, content)
        assert packer.punnets[number].grams == pytest.approx(content)
    for full in packer.due():
        packer.close(full)
        packer.open()


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(4.8, 38.9), min_size=1, max_size=30), st.sampled_from((WITH_CELLS, WITHOUT)))
def test_grams_are_conserved_without_readings(weights, policy):
    packer = Packer(policy, 2)
    for number, grams in enumerate(weights):
        item = berry(number, grams)
        found = packer.best(item)
        packer.place(found[0], item)
        for full in packer.due():
            packer.close(full)
            packer.open()
    punnets = [*packer.punnets.values(), *packer.packed, *packer.rejected]
    believed = sum(POPULATION.belief(berry(number, grams))[0] for number, grams in enumerate(weights))
    assert sum(punnet.grams for punnet in punnets) == pytest.approx(believed)
    assert packer.tally.grams == pytest.approx(sum(punnet.grams for punnet in packer.packed))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0, 55), min_size=3, max_size=3),
    st.floats(4.8, 38.9),
    st.permutations(range(3)),
    st.sampled_from((WITH_CELLS, WITHOUT)),
)
def test_the_order_of_punnets_is_irrelevant(contents, grams, order, policy):
    def chosen(readings):
        packer = Packer(policy, 3)
        for number, reading in enumerate(readings):
            packer.observe(number, reading)
        found = packer.best(berry(9, grams))
        return None if found is None else (readings[found[0]], found[1])

    assert chosen(contents) == chosen([contents[place] for place in order])


def test_a_reading_takes_the_place_of_the_estimates():
    packer = Packer(WITH_CELLS, 1)
    packer.place(0, berry(1, 20.0))
    assert packer.punnets[0].grams == pytest.approx(20.0, abs=0.3)
    assert packer.observe(0, 23.0) == 23.0
    packer.place(0, berry(2, 10.0))
    assert packer.punnets[0].grams == pytest.approx(33.0, abs=0.5)
    assert packer.observe(0, 32.0) == pytest.approx(9.0)
    assert packer.punnets[0].variance == 0.25
    assert [held.number for held in packer.punnets[0].berries] == [1, 2]


def test_a_berry_lost_on_the_way_leaves_the_books_right():
    packer = Packer(WITH_CELLS, 1)
    packer.place(0, berry(1, 20.0))
    packer.observe(0, 20.0)
    packer.place(0, berry(2, 15.0))
    assert packer.observe(0, 20.3) == pytest.approx(0.3)
    packer.lost(0, berry(2))
    assert packer.punnets[0].grams == 20.3
    assert len(packer.punnets[0].berries) == 1
    unread = Packer(WITHOUT, 1)
    unread.place(0, berry(1, 20.0))
    unread.lost(0, berry(1))
    assert (unread.punnets[0].grams, unread.punnets[0].variance) == (0.0, 0.0)


def test_a_punnet_that_is_gone_takes_its_berries_along():
    packer = Packer(WITH_CELLS, 2)
    packer.place(1, berry(1))
    assert [held.number for held in packer.missing(1).berries] == [1]
    with pytest.raises(RobotError, match="punnet 1: is not there; open ones are"):
        packer.place(1, berry(2))
    assert packer.best(berry(2))[0] == 0
    assert packer.open() == 2


def target_of(packer: Packer) -> float:
    return packer.policy.target(packer.punnets[0], packer.tally)


def test_a_berry_completes_the_punnet_that_lacks_its_weight():
    packer = Packer(WITH_CELLS, 3)
    lacking = (29.5, 19.5, 11.5)
    for number, grams in enumerate(lacking):
        packer.observe(number, target_of(packer) - grams)
    assert [packer.choose(berry(1, grams)) for grams in lacking] == [0, 1, 2]
    assert packer.choose(berry(1, 38.0)) is None


def test_what_lies_aside_comes_back_when_it_serves():
    packer = Packer(WITH_CELLS, 1)
    packer.place(0, berry(1))
    packer.observe(0, target_of(packer) - 11.5)
    big, right = berry(2, 33.0), berry(3, 11.5)
    assert packer.choose(big) is None
    packer.put_aside(big)
    assert packer.take_back() is None
    packer.put_aside(right)
    assert packer.take_back() == (right, 0)
    assert packer.handled_again == 1
    packer.place(0, right)
    packer.observe(0, target_of(packer) + 0.6)
    assert packer.due() == [0]
    packer.close(0)
    packer.open()
    assert packer.aside == [big]


def test_what_is_too_light_at_the_count_is_rejected():
    packer = Packer(WITH_CELLS, 1)
    for number in range(5):
        packer.place(0, berry(number, 6.0))
    packer.observe(0, 30.0)
    assert packer.due() == [0]
    assert packer.best(berry(9)) is None
    packer.close(0)
    assert (len(packer.packed), len(packer.rejected), packer.tally.punnets) == (0, 1, 0)


def test_the_target_makes_up_for_what_was_packed_before():
    steered = LookAhead(PackingConfig(population=POPULATION))
    packer = Packer(steered, 1)
    packer.observe(0, 254.0)
    punnet = packer.punnets[0]
    before = steered.target(punnet, packer.tally)
    packer.place(0, berry(1, 1.0))
    packer.observe(0, 254.0)
    packer.close(0)
    number = packer.open()
    assert 250.0 - 2.6 < steered.target(packer.punnets[number], packer.tally) < before


def test_not_knowing_costs_a_margin_and_a_strict_rule_more():
    def margin(**config):
        policy = LookAhead(PackingConfig(population=POPULATION, **config))
        packer = Packer(policy, 1)
        return policy.target(packer.punnets[0], packer.tally) - 250.0

    assert 0 < margin() < 1.0 < margin(cell_error=None) < margin(cell_error=None, rule=MINIMUM_QUANTITY)


@pytest.mark.parametrize("number", [1, -1])
def test_a_place_that_is_not_there(number):
    packer = Packer(WITH_CELLS, 1)
    for act in (
        lambda: packer.place(number, berry(1)),
        lambda: packer.observe(number, 10.0),
        lambda: packer.lost(number, berry(1)),
        lambda: packer.missing(number),
        lambda: packer.close(number),
    ):
        with pytest.raises(RobotError, match="is not there"):
            act()


def test_what_can_not_be_is_refused_and_changes_nothing():
    packer = Packer(WITH_CELLS, 2)
    packer.place(0, berry(1))
    with pytest.raises(RobotError, match="lies in a punnet already"):
        packer.place(1, berry(1))
    with pytest.raises(RobotError, match="was not placed"):
        packer.lost(1, berry(1))
    for reading in (math.nan, math.inf, -6.0):
        with pytest.raises(RobotError, match="check and tare"):
            packer.observe(0, reading)
    for number in range(2, 6):
        packer.place(0, berry(number))
    with pytest.raises(RobotError, match="no more may go in"):
        packer.place(0, berry(7))
    full = Packer(LookAhead(PackingConfig(aside_places=0)), 1)
    with pytest.raises(RobotError, match="no more room"):
        full.put_aside(berry(1))
    assert whereabouts(packer) == Counter(range(1, 6))


@pytest.mark.parametrize(
    "make",
    [
        lambda: PackingConfig(nominal=0.0),
        lambda: PackingConfig(most_berries=0),
        lambda: PackingConfig(aside_places=-1),
        lambda: PackingConfig(cell_error=math.nan),
        lambda: BerryPopulation(mean=3.0),
        lambda: BerryPopulation(error=0.0),
        lambda: LookAhead(confidence=0.4),
        lambda: LookAhead(decline=0.0),
        lambda: Packer(WITH_CELLS, 0),
        lambda: WeighedBerry(1, -3.0),
        lambda: WeighedBerry(1, 3.0, 4.0, 2.0),
        lambda: WeighedBerry(1, 3.0, coverage=1.0),
    ],
)
def test_impossible_settings_are_refused(make):
    with pytest.raises((ConfigurationError, ShapeError)):
        make()


def test_an_estimate_counts_by_how_well_it_is_known():
    assert POPULATION.belief(WeighedBerry(1, math.nan)) == (18.6, 5.7**2)
    sure, variance = POPULATION.belief(WeighedBerry(1, 30.0, 29.9, 30.1))
    assert sure == pytest.approx(30.0, abs=0.01)
    assert variance < 0.01
    vague, variance = POPULATION.belief(WeighedBerry(1, 30.0, 1.0, 90.0))
    assert 18.6 < vague < 20.5
    assert 25 < variance < 5.7**2
    # ± 1.645 σ of the interval, weighed against the field's spread
    mean, variance = POPULATION.belief(WeighedBerry(1, 10.0, 10 - 1.645 * 5.7, 10 + 1.645 * 5.7))
    assert (mean, variance) == (pytest.approx(14.3, abs=0.01), pytest.approx(5.7**2 / 2, rel=1e-3))


def test_the_value_of_a_punnet_is_that_of_its_best_course():
    value = WITH_CELLS._value
    lacking = np.arange(-10.0, 60.0, 2.5)
    for left in range(1, 6):
        ends = value.ends(left, lacking)
        assert (ends <= lacking**2 / 5.7 + 1e-12).all()
        assert (value.ends(left - 1, lacking) >= ends - 1e-9).all()  # one more berry allowed never costs
    assert value.closes(0.0) == 0.0
    assert value.waits(0, 10.0) == math.inf


def test_waiting_is_worth_what_it_leads_to():
    """The value solves the Bellman equation: put in, it comes out."""
    decline = 0.1
    value = EndValue.solve(60.0, 1, POPULATION, decline, 0.0)
    weights = likely_berries(POPULATION)
    for lacking in (5.0, 18.5, 30.0):
        costs = (lacking - weights) ** 2 / 5.7
        waits = value.waits(1, lacking)
        assert np.mean(np.minimum(costs, waits + decline)) == pytest.approx(waits, abs=1e-9)
