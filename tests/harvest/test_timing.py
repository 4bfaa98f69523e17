import time

import numpy as np
import pytest

from punnet.harvest.timing import TimedRobot
from punnet.robot import Robot
from punnet.sim.cluster import ClusterConfig
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import WorldConfig, build_world


class Slow:
    time = 3.5

    def cut(self):
        until = time.process_time() + 0.05
        while time.process_time() < until:
            pass
        return "cut"

    def grip(self):
        raise ValueError("no")


def test_what_goes_by_inside_the_robot_is_added_up():
    robot = TimedRobot(Slow())
    assert robot.time == 3.5
    assert robot.cut() == "cut"
    assert robot.seconds == pytest.approx(0.05, abs=0.03)
    with pytest.raises(ValueError, match="no"):
        robot.grip()
    with pytest.raises(AttributeError):
        robot.fly()


def test_it_is_a_robot():
    plant = ClusterConfig(trusses=(1, 1), berries=(1, 1), canopy_leaves=(0, 0), hanging_leaves=(0, 0))
    world = build_world(1, WorldConfig(plant, arm_visuals=False))
    robot = TimedRobot(SimulatedRobot(world, np.random.default_rng(0)))
    assert isinstance(robot, Robot)
    robot.release()
    assert robot.seconds > 0
