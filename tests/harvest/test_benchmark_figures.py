import json
import math

import pytest
from scipy.stats import binomtest

from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.harvest.benchmark_figures import (
    NEVER_TRIED,
    PICKED_OFF,
    figures_of,
    missed_berries,
    wilson_interval,
)
from punnet.harvest.benchmark_folder import SCHEMA, BenchmarkFolder, read_figures
from punnet.harvest.benchmark_picture import draw_outcomes, row_name
from punnet.harvest.benchmark_plants import AttemptResult, PlantResult
from punnet.harvest.benchmark_watch import Collision
from punnet.harvest.judge import Fate


def a_fate(index, **changes):
    values = {
        "index": index,
        "stage": "ripe",
        "pluckable": True,
        "reachable": True,
        "mass": 20.0,
        "detached": True,
        "punnet": 0,
        "peak_force": 3.0,
        "tool_force": 0.0,
        **changes,
    }
    return Fate(**values)


def hanging(index, **changes):
    return a_fate(index, detached=False, punnet=None, **changes)


def picked(aimed, **changes):
    return AttemptResult("picked", "place", aimed=aimed, **changes)


def failed(aimed, phase="grip", reason="nothing between the pads"):
    return AttemptResult("failed", phase, reason, aimed)


@pytest.mark.parametrize(("hits", "count"), [(0, 5), (3, 5), (5, 5), (97, 100)])
def test_intervals_are_wilsons(hits, count):
    expected = binomtest(hits, count).proportion_ci(method="wilson")
    assert wilson_interval(hits, count) == pytest.approx((expected.low, expected.high), abs=1e-4)


def test_no_trials_say_nothing():
    assert wilson_interval(0, 0) == (0.0, 1.0)
    figures = figures_of([])
    assert figures["success"]["share"] is None
    assert figures["seconds_a_pick"] is None
    json.dumps(figures, allow_nan=False)


def test_every_berry_is_counted_where_it_belongs():
    plant = PlantResult(
        0,
        7,
        (
            a_fate(0),
            hanging(1),  # tried, not got
            a_fate(2, punnet=None),  # dropped
            hanging(3, reachable=False),
            a_fate(4, pluckable=False, peak_force=11.0),  # wrong and bruised
            hanging(5, pluckable=False, tool_force=4.0),
            hanging(6, pluckable=False, tool_force=0.5),
        ),
        (picked(0), failed(1, reason="pressed: with 41 N"), failed(2, "place", "lost on the way")),
        (Collision(0, 1, "grip"), Collision(5, 2, "reach")),
        30.0,
        2.0,
    )
    figures = figures_of([plant])
    assert (figures["success"]["hits"], figures["success"]["of"]) == (1, 3)
    assert (figures["wrong_picks"]["hits"], figures["wrong_picks"]["of"]) == (1, 3)
    assert (figures["damaged"]["hits"], figures["damaged"]["of"]) == (1, 3)
    assert (figures["unripe_touched"]["hits"], figures["unripe_touched"]["of"]) == (1, 3)
    assert figures["unripe_force_n"] == {"count": 1, "median": 4.0, "p95": 4.0, "largest": 4.0}
    assert figures["collisions_during"] == {"reach": 1}
    assert figures["failed_attempts"] == {"grip: pressed": 1, "place: lost on the way": 1}
    assert figures["missed"] == {"grip: pressed": 1, "place: lost on the way": 1}
    assert figures["seconds_a_pick"] == 30.0
    assert figures["computing_seconds_a_pick"] == 2.0
    json.dumps(figures, allow_nan=False)


def test_a_missed_berry_has_the_reason_of_the_last_attempt_at_it():
    attempts = (failed(0), failed(1, "cut", "too high"), failed(0, "reach", "held up"), picked(2))
    fates = (hanging(0), hanging(1), a_fate(2, punnet=None), hanging(3), a_fate(4, punnet=None))
    assert missed_berries([PlantResult(0, 7, fates, attempts)]) == [
        "reach: held up",
        "cut: too high",
        "place: not in the punnet in the end",
        NEVER_TRIED,
        PICKED_OFF,
    ]


def test_errors_of_place_and_weight():
    attempts = (
        picked(0, estimate=22.0, true_weight=20.0, located_error=0.002, cut_error=0.004),
        picked(1, estimate=15.0, true_weight=20.0, located_error=0.004, cut_error=0.006),
        picked(2, true_weight=20.0),
    )
    figures = figures_of([PlantResult(0, 7, (), attempts)])
    assert figures["weight"]["bias"] == pytest.approx(-0.075)
    assert figures["weight"]["mean_error"] == pytest.approx(0.175)
    assert figures["weight"]["within_10_percent"]["hits"] == 1
    assert figures["located_error_mm"]["median"] == pytest.approx(3.0)
    assert figures["cut_error_mm"]["largest"] == pytest.approx(6.0)


def test_punnets_fill_up_over_plants():
    plants = [
        PlantResult(
            n,
            n,
            (),
            tuple(picked(0, estimate=20.5, interval=(18.0, 23.0), true_weight=20.0) for _ in range(4)),
        )
        for n in range(20)
    ]
    packing = figures_of(plants)["packing"]
    # 80 berries of 20 g are six punnets of 13 and two left; two may still be open
    assert 4 <= packing["punnets"] <= 6
    assert 0.0 <= packing["giveaway"] < 0.08
    assert packing["short"] == 0
    assert figures_of(plants[:1])["packing"]["giveaway"] is None


def test_a_plant_survives_json():
    plant = PlantResult(
        3,
        9,
        (a_fate(0), hanging(1)),
        (
            picked(
                0, estimate=20.25, interval=(18.0, 22.5), true_weight=20.5, cut_error=0.0125, seconds=12.5
            ),
            failed(1),
        ),
        (Collision(1, 2, "reach"),),
        30.5,
        1.25,
        "stopped",
    )
    again = PlantResult.from_json(json.loads(json.dumps(plant.to_json(), allow_nan=False)), "here")
    assert again.to_json() == plant.to_json()
    assert math.isnan(again.attempts[1].estimate)
    with pytest.raises(FileFormatError, match="here"):
        PlantResult.from_json({"number": 3}, "here")


SETTINGS = {
    "schema": SCHEMA,
    "suite": "easy",
    "suite_version": 1,
    "perception": "colour",
    "choice": "mean",
    "order": "cheapest",
    "planner": "promp-depth",
    "planner_bundle": None,
    "seed": 1,
}


def figures(**settings):
    plant = PlantResult(
        0, 7, (a_fate(0), hanging(1), hanging(2)), (picked(0), failed(1), failed(2, "cut", "no"))
    )
    return {**SETTINGS, **settings, **figures_of([plant])}


def test_the_picture_shows_every_run():
    one, two = draw_outcomes([figures()]), draw_outcomes([figures(), figures(suite="night")])
    assert one.startswith(b"\x89PNG")
    assert two != one
    assert draw_outcomes([{**figures(), **figures_of([])}]).startswith(b"\x89PNG")


def test_a_row_is_named_by_what_was_measured():
    assert row_name(figures()) == "colour + promp-depth + mean, cheapest"
    learned = figures(planner="fused", planner_bundle="reach-2", choice="collision-aware")
    assert row_name(learned) == "colour + fused (reach-2) + collision-aware, cheapest"


def test_a_folder_keeps_plants_and_is_not_overwritten(tmp_path):
    folder = BenchmarkFolder(tmp_path / "run", SETTINGS)
    folder.open(force=False)
    folder.add(PlantResult(0, 7, (a_fate(0),)))
    folder.add(PlantResult(1, 8, error="could not be grown"))
    assert list(BenchmarkFolder(tmp_path / "run", SETTINGS).results()) == [0]
    other = BenchmarkFolder(tmp_path / "run", {**SETTINGS, "choice": "clearest"})
    with pytest.raises(OutputExistsError, match="begun with choice 'mean'"):
        other.open(force=False)
    other.open(force=True)
    assert other.results() == {}
    with pytest.raises(FileFormatError, match="figures"):
        read_figures(other.folder)
    other.complete(figures(choice="clearest"))
    assert read_figures(other.folder)["choice"] == "clearest"
    other.complete(figures(schema="punnet-harvest-benchmark/1"))
    with pytest.raises(FileFormatError, match=r"benchmark/1.*measure again"):
        read_figures(other.folder)


def test_other_folders_are_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("the only copy")
    for place, error in ((tmp_path, OutputExistsError), (tmp_path / "thesis.txt", OutputError)):
        with pytest.raises(error):
            BenchmarkFolder(place, SETTINGS).open(force=True)
    damaged = BenchmarkFolder(tmp_path / "run", SETTINGS)
    damaged.open(force=False)
    (damaged.folder / "plants" / "000000.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"000000\.json"):
        damaged.results()
