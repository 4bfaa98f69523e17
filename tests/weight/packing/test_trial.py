"""Batches, files of errors, trials and their comparison."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.weight.packing import (
    BerryPopulation,
    FillByCount,
    FirstFit,
    LookAhead,
    PackingConfig,
    WeighedBerry,
)
from punnet.weight.packing.batches import Batch, EstimationErrors, draw_batch, read_errors, read_weights
from punnet.weight.packing.comparison import BAR, compare
from punnet.weight.packing.figure import draw_comparison
from punnet.weight.packing.trial import pack_batch, run_trial

POPULATION = BerryPopulation()


def some_errors(spread: float = 0.08, count: int = 2_000) -> EstimationErrors:
    rng = np.random.default_rng(7)
    true = np.clip(rng.normal(18.6, 5.7, count), 4.8, 38.9)
    estimates = true * np.exp(rng.normal(0, spread, count))
    bounds = np.exp(1.645 * spread * np.array([-1.0, 1.0]))
    return EstimationErrors(true, estimates, estimates[:, None] * bounds)


@pytest.fixture(scope="module")
def errors() -> EstimationErrors:
    return some_errors()


def test_drawn_berries_weigh_what_the_field_s_do_and_err_as_the_estimator_does(errors):
    batch = draw_batch(np.random.default_rng(1), 4_000, errors, POPULATION)
    assert batch.true.mean() == pytest.approx(18.6, abs=0.4)
    assert batch.true.std() == pytest.approx(5.6, abs=0.3)
    assert (batch.true >= 4.8).all()
    assert (batch.true <= 38.9).all()
    relative = np.array([berry.estimate for berry in batch.berries]) / batch.true
    assert np.log(relative).std() == pytest.approx(0.08, abs=0.01)
    covered = [berry.low <= true <= berry.high for berry, true in zip(batch.berries, batch.true, strict=True)]
    assert np.mean(covered) == pytest.approx(0.9, abs=0.03)
    measured = draw_batch(np.random.default_rng(1), 50, errors, POPULATION, np.array([10.0, 20.0]))
    assert set(measured.true) == {10.0, 20.0}


def test_typical_error_is_that_of_what_is_believed(errors):
    assert errors.typical(POPULATION) == pytest.approx(0.08, abs=0.01)
    blind = EstimationErrors(errors.true, np.full(2_000, np.nan), np.full((2_000, 2), np.nan))
    assert blind.typical(POPULATION) == pytest.approx(5.7 / 18.6, rel=0.05)


def test_a_trial_keeps_its_books(errors):
    config = PackingConfig(population=replace(POPULATION, error=0.08))
    batch = draw_batch(np.random.default_rng(3), 300, errors, POPULATION)
    for policy in (LookAhead(config), FirstFit(config), FillByCount(config)):
        result = pack_batch(policy, 3, batch, np.random.default_rng(0))
        still_open = result.berries - result.packed - result.rejected - result.aside
        assert 0 <= still_open <= 3 * config.most_berries
        assert result.verdict.count == len(result.weights)
        assert result.giveaway == pytest.approx((result.weights.mean() - 250) / 250)


def test_by_count_is_counted_by_hand():
    """Ten berries of 20 g and then ten of 30 g, four a punnet of 90 g: 80, 80, 100, 120, 120 g."""
    true = np.repeat([20.0, 30.0], 10)
    batch = Batch(tuple(WeighedBerry(number, true[number]) for number in range(20)), true)
    config = PackingConfig(nominal=90.0, most_berries=4, cell_error=0.0)
    result = pack_batch(FillByCount(config, 4), 1, batch, np.random.default_rng(0))
    # 80 g is more than 4.5 g short: rejected, by the weigh cell
    assert result.weights.tolist() == [100.0, 120.0, 120.0]
    assert (result.packed, result.rejected) == (12, 8)
    assert result.giveaway == pytest.approx((10 + 30 + 30) / 270)


def test_first_fit_is_worked_out_by_hand():
    """60 g, two open: 30 and 20 fit the first, 25 goes to the second, 20 fills the first least above."""
    true = np.array([30.0, 20.0, 25.0, 40.0, 20.0])
    batch = Batch(tuple(WeighedBerry(n, g, g, g) for n, g in enumerate(true)), true)
    config = PackingConfig(nominal=60.0, cell_error=0.0)
    result = pack_batch(FirstFit(config), 2, batch, np.random.default_rng(0))
    # 25 + 40 = 65 goes above by 5, 50 + 40 by 30; then 50 + 20 above by 10, while an empty one takes 20 without
    assert result.weights.tolist() == [65.0]


def test_with_weigh_cells_little_is_given_away_and_every_batch_passes(errors):
    comparison = compare(errors, batches=2, berries=500, seed=2)
    with_cells, without = comparison.settings
    own, first_fit = with_cells.results[:2]
    assert with_cells.meets_bar
    assert own.giveaway < 0.01 < first_fit.giveaway
    assert own.passed == 2
    # without, only the estimates' errors are left to cost: each batch still passes, for more given away
    assert not without.meets_bar
    assert without.results[0].passed == 2
    assert without.results[0].giveaway > BAR
    tuned = [result for result in with_cells.results if "best" in result.name]
    assert tuned
    assert own.giveaway < tuned[0].giveaway
    figures = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert figures["settings"][0]["results"][0]["policy"] == "look-ahead"
    assert draw_comparison(comparison).startswith(b"\x89PNG")


def test_the_same_seed_packs_the_same(errors):
    batch = draw_batch(np.random.default_rng(3), 200, errors, POPULATION)
    policy = LookAhead()
    one, other = (run_trial(policy, 2, [batch], seed=4).weights for _ in range(2))
    assert np.array_equal(one, other)


def test_error_files(tmp_path):
    table = tmp_path / "errors.csv"
    table.write_text("true_g,estimate_g,low_g,high_g,view\n20,19,17,21,near\n10,,,,far\n")
    errors = read_errors(table)
    assert errors.true.tolist() == [20.0, 10.0]
    assert errors.intervals[0].tolist() == [17.0, 21.0]
    assert math.isnan(errors.estimates[1])
    rows = [{"true_g": 20.0, "estimate_g": 19.0, "low_g": 17.0, "high_g": None}]
    for content in (rows, {"rows": rows, "coverage": 0.8}):
        path = tmp_path / "errors.json"
        path.write_text(json.dumps(content))
        assert read_errors(path).estimates.tolist() == [19.0]
    assert read_errors(path).coverage == 0.8
    weights = tmp_path / "weights.csv"
    weights.write_text("file,weight\na,12.5\nb,20\n")
    assert read_weights(weights).tolist() == [12.5, 20.0]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", "true_g,estimate_g\n1,2\n", "has no 'low_g'"),
        ("a.csv", "true_g,estimate_g,low_g,high_g\n1,x,0,2\n", "row 1: 'estimate_g' must be a number"),
        ("a.csv", "true_g,estimate_g,low_g,high_g\n-1,1,0,2\n", "must be positive"),
        ("a.csv", "true_g,estimate_g,low_g,high_g\n1,1,2,0\n", "wrong way round"),
        ("a.json", "{", "can't be read"),
        ("a.csv", "true_g,estimate_g,low_g,high_g\n", "has no rows of true_g"),
        ("a.json", '{"figures": 3}', "no list of rows"),
        ("a.json", '{"rows": [], "coverage": 9.0}', "coverage"),
    ],
)
def test_damaged_error_files(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(FileFormatError, match=said):
        read_errors(path)


def test_missing_files(tmp_path):
    with pytest.raises(FileFormatError, match="can't be read as a table of weights: No such file"):
        read_errors(tmp_path / "none.csv")
    table = tmp_path / "weights.csv"
    for content, said in (
        ("grams\n3\n", "no column 'weight'"),
        ("weight\n0\n", "positive"),
        ("weight\n", "no column"),
    ):
        table.write_text(content)
        with pytest.raises(FileFormatError, match=said):
            read_weights(table)


def test_impossible_trials_are_refused(errors):
    with pytest.raises(ConfigurationError, match="batches"):
        compare(errors, batches=0)
    with pytest.raises(ConfigurationError, match="cell_error"):
        compare(errors, PackingConfig(cell_error=None))
    with pytest.raises(ConfigurationError, match="at least one batch"):
        run_trial(LookAhead(), 2, [], 0)
    with pytest.raises(ConfigurationError, match="by count"):
        FillByCount(PackingConfig(most_berries=3), 4)
    with pytest.raises(ShapeError, match="estimation errors"):
        EstimationErrors(np.ones(3), np.ones(2), np.ones((3, 2)))
