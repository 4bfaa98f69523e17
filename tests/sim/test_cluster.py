import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.sim.cluster import STUB_LENGTH, ClusterConfig, grow_cluster
from punnet.sim.truss import TrussStyle, grow_truss


def test_the_same_seed_grows_the_same_plant_and_another_seed_another():
    first, again, other = (grow_cluster(np.random.default_rng(seed)) for seed in (1, 1, 2))
    centres = [np.array([berry.centre for berry in cluster.berries]) for cluster in (first, again, other)]
    assert np.array_equal(centres[0], centres[1])
    assert centres[0].shape != centres[2].shape or not np.allclose(centres[0], centres[2])


@pytest.mark.parametrize("seed", range(5))
def test_berries_keep_their_distance_and_hang_below_their_truss(seed):
    config = ClusterConfig()
    cluster = grow_cluster(np.random.default_rng(seed), config)
    berries = cluster.berries
    assert [berry.index for berry in berries] == list(range(len(berries)))
    for i, one in enumerate(berries):
        for other in berries[:i]:
            gap = np.linalg.norm(one.centre - other.centre)
            assert gap >= config.clearance * (one.radius + other.radius) - 1e-12
    for hanging in cluster.trusses:
        for number, berry in enumerate(hanging.berries):
            stub_top = berry.T_base_berry[:3, 3] + STUB_LENGTH * berry.T_base_berry[:3, 2]
            assert np.allclose(stub_top, hanging.truss.hanging_point(number))
            assert berry.centre[2] < hanging.truss.links[0].start[2]


def test_berries_hang_where_the_arm_reaches():
    places = np.array(
        [b.centre for seed in range(8) for b in grow_cluster(np.random.default_rng(seed)).berries]
    )
    assert np.all(places.mean(axis=0) > (0.70, -0.2, 0.6))
    assert np.all(places.mean(axis=0) < (0.80, 0.1, 0.8))


def test_links_of_a_truss_join(rng):
    truss = grow_truss(rng, np.array([0.8, 0.0, 0.9]), 4, TrussStyle())
    assert len(truss.tips) == 4
    for index, link in enumerate(truss.links):
        assert link.parent < index
        if link.parent >= 0:
            assert np.allclose(link.start, truss.links[link.parent].end)


@pytest.mark.parametrize(
    "bad", [{"trusses": (3, 2)}, {"berries": (0, 2)}, {"stage_shares": {}}, {"hanging_leaves": (-1, 2)}]
)
def test_impossible_plants_are_refused(bad):
    with pytest.raises(ConfigurationError, match="cluster:"):
        ClusterConfig(**bad)
