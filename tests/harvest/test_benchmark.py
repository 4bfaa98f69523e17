import json

import pytest
from scipy.stats import binomtest

from punnet.errors import BundleError, ConfigurationError
from punnet.harvest.benchmark import (
    BenchmarkResult,
    ClusterResult,
    cluster_seed,
    run_benchmark,
    wilson_interval,
)
from punnet.harvest.judge import Fate
from punnet.sim.cluster import ClusterConfig


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


@pytest.mark.parametrize(("hits", "count"), [(0, 5), (3, 5), (5, 5), (97, 100)])
def test_intervals_are_wilsons(hits, count):
    expected = binomtest(hits, count).proportion_ci(method="wilson")
    assert wilson_interval(hits, count) == pytest.approx((expected.low, expected.high), abs=1e-4)


def test_no_trials_say_nothing():
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_every_berry_is_counted_where_it_belongs():
    attempts = (
        {"outcome": "picked", "phase": "place", "reason": None, "reason_kind": ""},
        {
            "outcome": "failed",
            "phase": "grip",
            "reason": "nothing between the pads",
            "reason_kind": "nothing",
        },
    )
    fates = (
        a_fate(0),
        a_fate(1, detached=False, punnet=None),  # tried, not got
        a_fate(2, punnet=None),  # dropped
        a_fate(3, reachable=False, detached=False, punnet=None),
        a_fate(4, pluckable=False, peak_force=11.0),  # wrong and bruised
        a_fate(5, pluckable=False, detached=False, punnet=None, tool_force=4.0),
    )
    figures = BenchmarkResult("colour", 0, (ClusterResult(7, fates, attempts, 30.0, 2.0),)).to_json()
    assert (figures["success"]["hits"], figures["success"]["of"]) == (1, 3)
    assert (figures["wrong_picks"]["hits"], figures["wrong_picks"]["of"]) == (1, 3)
    assert (figures["damaged"]["hits"], figures["damaged"]["of"]) == (1, 3)
    assert (figures["unripe_touched"]["hits"], figures["unripe_touched"]["of"]) == (1, 2)
    assert figures["failure_reasons"] == {"grip: nothing": 1}
    assert figures["seconds_a_pick"] == 30.0
    json.dumps(figures, allow_nan=False)


def test_a_berry_that_was_never_tried_is_a_failure_with_a_reason():
    result = BenchmarkResult("colour", 0, (ClusterResult(7, (a_fate(0, detached=False, punnet=None),)),))
    assert list(result.failure_reasons()) == ["look: never recognised as ripe and in reach"]


def test_clusters_of_two_benchmarks_differ():
    seeds = {cluster_seed(seed, number) for seed in range(20) for number in range(50)}
    assert len(seeds) == 1000


def test_counts_are_checked():
    with pytest.raises(ConfigurationError, match="clusters and workers"):
        run_benchmark(0, 1)


def test_a_detector_that_cannot_be_had_ends_it_at_once():
    with pytest.raises(BundleError, match="eyes-closed"):
        run_benchmark(2, 5, perception="eyes-closed")


def test_workers_make_no_difference():
    plant = ClusterConfig(trusses=(1, 1), berries=(1, 2), canopy_leaves=(0, 0), hanging_leaves=(0, 0))
    alone, together = (
        run_benchmark(2, 5, workers=workers, perception="oracle", cluster=plant) for workers in (1, 2)
    )
    strip = [
        [(fate.index, fate.punnet, fate.detached) for fate in result.fates] for result in (alone, together)
    ]
    assert strip[0] == strip[1]
    assert all(cluster.error is None for cluster in alone.clusters)
