"""The average-quantity rule against figures worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, ShapeError
from punnet.weight.packing import AVERAGE_QUANTITY, MINIMUM_QUANTITY, PackingRule
from punnet.weight.packing.rule import ToleranceBand


@pytest.mark.parametrize(
    ("nominal", "tolerance"),
    [
        (20, 1.8),  # 9%
        (50, 4.5),  # 9%, and the fixed 4.5 g that begins there
        (75, 4.5),
        (125, 5.7),  # 4.5% is 5.625, rounded up to a tenth
        (150, 6.8),  # 6.75
        (200, 9.0),
        (227, 9.0),
        (250, 9.0),
        (300, 9.0),
        (340, 10.2),  # 3%
        (400, 12.0),
        (500, 15.0),
        (800, 15.0),
        (2_000, 30.0),  # 1.5%
    ],
)
def test_tolerable_negative_errors(nominal, tolerance):
    assert AVERAGE_QUANTITY.tolerance(nominal) == pytest.approx(tolerance, abs=1e-12)


@pytest.mark.parametrize("nominal", [0, -250, math.nan, math.inf, 10_001])
def test_a_weight_without_tolerance_is_refused(nominal):
    with pytest.raises(ConfigurationError, match="no tolerance"):
        AVERAGE_QUANTITY.tolerance(nominal)


def batch(*below, of=80, rest=252.0):
    return [*below, *[rest] * (of - len(below))]


@pytest.mark.parametrize(
    ("weights", "short", "far_short", "faults"),
    [
        (batch(), 0, 0, []),
        (batch(241.0), 0, 0, []),  # exactly nominal − TNE is not short
        (batch(240.9, 233), 2, 0, []),  # 2 of 80 are 2.5%
        (batch(240.9, 240, 239), 3, 0, ["3 of 80"]),
        (batch(232.0), 1, 0, []),  # exactly nominal − 2 TNE is not far short
        (batch(231.9), 1, 1, ["18 g short"]),
        (batch(rest=249.9), 0, 0, ["mean is 249.90"]),
        (batch(240.0, of=39), 1, 0, ["1 of 39"]),  # 2.5% of 39 is less than one
        (batch(240.0, of=40), 1, 0, []),
        (batch(200, 240, 240, rest=249.0), 3, 1, ["3 of 80", "18 g short", "mean is"]),
        ([], 0, 0, []),
    ],
)
def test_batches_judged_by_hand(weights, short, far_short, faults):
    verdict = AVERAGE_QUANTITY.judge(weights, 250)
    assert (verdict.count, verdict.short, verdict.far_short) == (len(weights), short, far_short)
    assert len(verdict.faults) == len(faults)
    assert all(part in fault for part, fault in zip(faults, verdict.faults, strict=True))
    assert verdict.passes == (not faults)


def test_another_rule_takes_its_place():
    assert MINIMUM_QUANTITY.judge([250, 250.1], 250).passes
    assert not MINIMUM_QUANTITY.judge([249.9, 300], 250).passes
    lenient = PackingRule("lenient", "test", (ToleranceBand(1_000, share=0.5),), 0.5, mean_counts=False)
    assert lenient.judge([130, 130], 250).passes
    assert not lenient.judge([120, 120, 250], 250).passes


@given(st.lists(st.floats(200, 300), min_size=1, max_size=60), st.randoms())
def test_the_order_of_punnets_does_not_count(weights, random):
    mixed = list(weights)
    random.shuffle(mixed)
    one, other = AVERAGE_QUANTITY.judge(weights, 250), AVERAGE_QUANTITY.judge(mixed, 250)
    assert (one.short, one.far_short, one.passes) == (other.short, other.far_short, other.passes)


@given(st.lists(st.floats(200, 300), min_size=1, max_size=60), st.floats(0, 30))
def test_more_in_every_punnet_never_fails_a_batch(weights, more):
    if AVERAGE_QUANTITY.judge(weights, 250).passes:
        assert AVERAGE_QUANTITY.judge(np.array(weights) + more, 250).passes


@pytest.mark.parametrize("bad", [[[250.0]], [250.0, math.nan], [math.inf]])
def test_weights_that_are_none(bad):
    with pytest.raises(ShapeError, match="finite weights"):
        AVERAGE_QUANTITY.judge(bad, 250)


@pytest.mark.parametrize(
    ("bands", "share"),
    [((), 0.0), ((ToleranceBand(100), ToleranceBand(50)), 0.0), ((ToleranceBand(100),), 1.0)],
)
def test_impossible_rules_are_refused(bands, share):
    with pytest.raises(ConfigurationError, match="ascending"):
        PackingRule("bad", "test", bands, share)
