"""Night: the world under a lamp, and leaves that hang before the fruit."""

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.sim.camera_effects import NIGHT_CAMERA
from punnet.sim.cluster import ClusterConfig
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import WorldConfig, build_world

PLANT = ClusterConfig(trusses=(1, 1), berries=(1, 2), canopy_leaves=(0, 0), hanging_leaves=(0, 0))


def first_look(light="day", camera=None):
    world = build_world(4, WorldConfig(PLANT, arm_visuals=False, light=light))
    robot = SimulatedRobot(world, np.random.default_rng(0), camera=camera)
    try:
        return world, robot.look()
    finally:
        robot.close()


def test_a_lamp_lights_the_plant_and_not_what_lies_behind():
    day_world, day = first_look()
    night_world, night = first_look("lamp")
    np.testing.assert_allclose(day_world.berry_poses(), night_world.berry_poses(), atol=1e-9)
    near, far = (day.depth > 0.2) & (day.depth < 0.6), day.depth > 1.0
    assert near.sum() > 300
    assert far.sum() > 10_000
    assert night.rgb[near].mean() > 0.4 * day.rgb[near].mean()
    assert night.rgb[far].mean() < 0.1 * day.rgb[far].mean()


def test_the_camera_at_night_is_noisy():
    _, clean = first_look("lamp")
    _, noisy = first_look("lamp", NIGHT_CAMERA)
    dark = clean.rgb.max(axis=2) < 8
    assert noisy.rgb[dark].std() > clean.rgb[dark].std() + 1.0
    np.testing.assert_array_equal(noisy.depth, clean.depth)


def test_a_light_that_there_is_not():
    with pytest.raises(ConfigurationError, match="moon"):
        WorldConfig(light="moon")


def test_veils_hang_between_ripe_berries_and_the_robot():
    config = ClusterConfig(trusses=(2, 2), berries=(2, 2), hanging_leaves=(0, 0), veils=(2, 2))
    world = build_world(4, WorldConfig(config, arm_visuals=False))
    bare = build_world(4, WorldConfig(ClusterConfig(trusses=(2, 2), berries=(2, 2)), arm_visuals=False))
    assert world.berries == bare.berries
    fruit = np.array([berry.centre for berry in world.cluster.berries])
    for number in range(2):
        tip = world.data.body(f"veil{number}").xpos
        nearest = fruit[np.argmin(np.linalg.norm(fruit[:, 1:] - tip[1:], axis=1))]
        assert tip[0] < nearest[0]
        assert world.model.geom(f"veil{number}_touch").conaffinity[0] > 0
