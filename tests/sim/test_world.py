import time

import numpy as np

from punnet.sim.cluster import ClusterConfig
from punnet.sim.world import TIME_STEP, WorldConfig, build_world
from tests.sim.conftest import small_world


def test_the_plant_hangs_as_it_was_grown(world):
    grown = np.array([berry.T_base_berry[:3, 3] for berry in world.cluster.berries])
    hanging = world.berry_poses()[:, :3, 3]
    assert np.linalg.norm(hanging - grown, axis=1).max() < 0.012


def test_the_same_seed_gives_the_same_world_after_a_second():
    first, again = small_world(3), small_world(3)
    for _ in range(200):
        first.step()
        again.step()
    assert np.array_equal(first.data.qpos, again.data.qpos)


def test_stems_sway_when_a_berry_is_pushed_and_come_to_rest(world):
    before = world.berry_poses()[0, :3, 3].copy()
    body = world.model.body(world.planted[0].body).id
    world.data.xfrc_applied[body, 1] = 0.05
    for _ in range(100):
        world.step()
    pushed = world.berry_poses()[0, :3, 3].copy()
    assert pushed[1] - before[1] > 0.002
    world.data.xfrc_applied[body] = 0.0
    for _ in range(4000):
        world.step()
    assert np.linalg.norm(world.berry_poses()[0, :3, 3] - before) < 0.004


def test_a_detached_berry_falls(world):
    before = world.berry_poses()[:, 2, 3].copy()
    world.detach(1)
    for _ in range(100):
        world.step()
    fallen = before - world.berry_poses()[:, 2, 3]
    assert fallen[1] > 0.1
    assert np.abs(np.delete(fallen, 1)).max() < 0.02
    assert list(np.flatnonzero(~world.attached())) == [1]


def test_physics_outruns_the_clock():
    """A full plant at eight times real time is the bar; half of it is asked for here, of the time the processor gives."""
    world = build_world(5, WorldConfig(cluster=ClusterConfig(), arm_visuals=False))
    best = 0.0
    for _ in range(4):
        start = time.process_time()
        for _ in range(150):
            world.step()
        best = max(best, 150 * TIME_STEP / (time.process_time() - start))
    assert best > 4.0
