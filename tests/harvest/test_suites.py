import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.geometry import make_transform
from punnet.harvest.suites import SUITES, covered_shares, suite_of, touching_group
from punnet.sim.berry import make_berry
from punnet.sim.cluster import Cluster, ClusterConfig, HangingBerry, HangingTruss, grow_cluster
from punnet.sim.ripeness import RipenessStage

SEEDS = (3, 4, 5)
QUICK = ("easy", "clustered", "occluded", "night")  # the thesis' plants are looked at before they are taken


def plants(name):
    for seed in SEEDS:
        world_seed, config = SUITES[name].plant(seed)
        yield config, grow_cluster(np.random.default_rng(world_seed), config.cluster)


def ripe(cluster):
    return np.array([berry.berry.stage.pluckable for berry in cluster.berries])


def a_cluster(*places, stages=None):
    """Berries of one shape with their middles at the given places."""
    shape = make_berry(np.random.default_rng(1), RipenessStage.RIPE)
    hanging = tuple(
        HangingBerry(index, shape, make_transform(np.eye(3), np.array(place) - shape.centre))
        for index, place in enumerate(places)
    )
    return shape, Cluster(ClusterConfig(), (HangingTruss(None, hanging),))


@pytest.mark.parametrize("name", QUICK)
def test_the_same_seed_gives_the_same_plant_and_another_one_another(name):
    suite = SUITES[name]
    first, again, other = suite.plant(7), suite.plant(7), suite.plant(8)
    assert (first[0], first[1].cluster) == (again[0], again[1].cluster)
    assert first[0] != other[0]


def test_suites_share_no_plants():
    assert len({SUITES[name].plant(7)[0] for name in QUICK}) == len(QUICK)


@pytest.mark.parametrize("name", QUICK)
def test_every_plant_has_something_to_pick(name):
    assert all(ripe(cluster).any() for _, cluster in plants(name))


def test_easy_berries_hang_wide_apart():
    for _, cluster in plants("easy"):
        assert len(touching_group(cluster)) == 1
        assert len(cluster.berries) <= 6


def test_thesis_plants_have_one_ripe_berry_among_others():
    world_seed, config = SUITES["thesis"].plant(3)
    cluster = grow_cluster(np.random.default_rng(world_seed), config.cluster)
    assert ripe(cluster).sum() == 1
    assert len(cluster.berries) >= 2
    assert config.cluster.hanging_leaves[0] >= 1


def test_clustered_berries_touch():
    for _, cluster in plants("clustered"):
        group = touching_group(cluster)
        assert 3 <= len(group) <= 12
        assert ripe(cluster)[list(group)].any()


def test_occluded_plants_hide_a_ripe_berry_behind_unripe_ones_and_have_leaves_in_front():
    for config, cluster in plants("occluded"):
        assert covered_shares(cluster, by=~ripe(cluster))[ripe(cluster)].max() > 0.2
        assert covered_shares(cluster)[ripe(cluster)].max() < 0.85
        assert config.cluster.veils[0] >= 2


def test_night_is_lit_by_a_lamp_alone():
    assert {suite.name for suite in SUITES.values() if suite.light == "lamp"} == {"night"}
    assert SUITES["night"].plant(3)[1].light == "lamp"


def test_a_group_is_what_hangs_skin_to_skin():
    width = 2 * float(make_berry(np.random.default_rng(1), RipenessStage.RIPE).semi_axes[:2].mean())
    _, cluster = a_cluster((0.7, 0.0, 0.7), (0.7, width, 0.7), (0.7, 2 * width, 0.7), (0.7, -0.09, 0.7))
    assert touching_group(cluster) == (0, 1, 2)


def test_what_stands_in_the_line_of_sight_covers():
    from punnet.robot import HOME, T_FLANGE_CAMERA, Panda

    eye = (Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA)[:3, 3]
    hidden = np.array([0.75, -0.05, 0.70])
    before = eye + 0.8 * (hidden - eye)
    _, cluster = a_cluster(hidden, before, hidden + np.array([0.0, 0.12, 0.0]))
    shares = covered_shares(cluster)
    assert shares[0] == 1.0
    assert shares[1] == shares[2] == 0.0
    assert covered_shares(cluster, by=np.array([True, False, True]))[0] == 0.0


def test_an_unknown_suite_is_named():
    with pytest.raises(ConfigurationError, match=r"no suite 'hard'.*easy, thesis"):
        suite_of("hard")
