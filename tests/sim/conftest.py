import pytest

from punnet.sim.cluster import ClusterConfig
from punnet.sim.world import World, WorldConfig, build_world

SMALL = ClusterConfig(trusses=(2, 2), berries=(2, 2), canopy_leaves=(2, 2), hanging_leaves=(1, 1))


def small_world(seed: int = 4) -> World:
    return build_world(seed, WorldConfig(cluster=SMALL, arm_visuals=False))


@pytest.fixture
def world() -> World:
    """A plant of two trusses, built anew for each test that moves it."""
    return small_world()
