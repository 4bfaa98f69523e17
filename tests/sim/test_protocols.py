"""What data sets are made for: which plants are grown, what the camera aims at, and that weights are as measured."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.sim.berry import make_berry
from punnet.sim.cluster import Cluster, grow_cluster
from punnet.sim.protocols import DATASET_1, NIGHT, PROTOCOLS, VARIED, Protocol, protocol_of
from punnet.sim.ripeness import RipenessStage
from punnet.sim.simulated_folder import describe


def grow(protocol: Protocol, seed: int) -> Cluster:
    rng = np.random.default_rng([seed, *protocol.stream])
    cluster = grow_cluster(rng, protocol.draw_config(rng))
    while not protocol.accepts(cluster):
        cluster = grow_cluster(rng, protocol.draw_config(rng))
    targets = protocol.draw_targets(rng, cluster)
    assert targets
    assert set(targets) <= {berry.index for berry in cluster.berries}
    if protocol is DATASET_1:
        (target,) = targets
        assert cluster.berries[target].berry.stage.pluckable
    return cluster


def test_sets_of_dataset_1_hold_as_many_berries_as_the_thesis_counts() -> None:
    clusters = [grow(DATASET_1, seed) for seed in range(60)]
    ripe = [sum(berry.berry.stage.pluckable for berry in cluster.berries) for cluster in clusters]
    assert min(ripe) >= 1
    # Table 3.2: 1,757 pluckable and 656 unpluckable berries in 1,588 images.
    assert 1.0 < np.mean(ripe) < 1.5
    assert 0.2 < np.mean([len(cluster.berries) for cluster in clusters]) - np.mean(ripe) < 0.75


def test_varied_plants_aim_at_any_berry() -> None:
    clusters = [grow(VARIED, seed) for seed in range(12)]
    assert len({len(cluster.berries) for cluster in clusters}) > 3


def test_a_seed_gives_other_plants_under_each_protocol_and_describes_itself() -> None:
    masses = [grow(protocol, 4).berries[0].berry.mass for protocol in PROTOCOLS.values()]
    assert len(set(masses)) == len(PROTOCOLS)
    assert DATASET_1.group != VARIED.group
    assert DATASET_1.images == 3 * 532
    plain, first = describe(6, 4), describe(6, 4, DATASET_1)
    assert "protocol" not in plain
    assert plain["command"] == "punnet data simulate --images 6 --seed 4"
    assert first["protocol"] == "dataset-1"
    assert first["command"] == "punnet data simulate --protocol dataset-1 --images 6 --seed 4"


def test_night_alone_is_under_a_lamp_and_says_so() -> None:
    assert [protocol.name for protocol in PROTOCOLS.values() if protocol.light == "lamp"] == ["night"]
    assert describe(6, 4, NIGHT)["command"] == "punnet data simulate --protocol night --images 6 --seed 4"


def test_an_unknown_protocol_is_named() -> None:
    with pytest.raises(ConfigurationError, match=r"no protocol 'dataset-3'.*dataset-1"):
        protocol_of("dataset-3")


def test_ripe_berries_weigh_as_those_that_were_weighed(shared_data: Path) -> None:
    measured: dict[str, float] = {}
    with (shared_data / "dyson" / "berry_weights_g.csv").open() as stream:
        for row in csv.DictReader(stream):
            number = re.search(r"__(\d+)_\d+\.pcd", row["pcd_file"])
            assert number is not None
            measured[number.group(1)] = float(row["weight"])
    rng = np.random.default_rng(8)
    simulated = np.sort([make_berry(rng, RipenessStage.RIPE).mass for _ in range(300)])
    real = np.sort(list(measured.values()))
    places = np.linspace(0.05, 0.95, 19)
    apart = np.abs(np.quantile(simulated, places) - np.quantile(real, places))
    assert apart.mean() < 1.2
    assert apart.max() < 3.0
    assert (real[0], real[-1]) == (4.8, 38.9)
    assert simulated[0] >= 4.8
    assert simulated[-1] <= 38.9
