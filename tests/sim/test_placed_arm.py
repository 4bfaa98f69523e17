"""Arms that are data in the simulator: they stand, look, move and pick as the Panda does."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.harvest.scenario import ORACLE, Scenario, Session
from punnet.movement import retime
from punnet.robot import Panda, load_arm, nearest_solution
from punnet.sim.placed_arm import place_arm
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import WorldConfig, build_world


@pytest.fixture(scope="module", params=["ur5", "xarm7"])
def robot(request):
    robot = SimulatedRobot(
        build_world(3, WorldConfig(arm=request.param, arm_visuals=False)), np.random.default_rng(0)
    )
    yield robot
    robot.close()


def test_it_stands_at_home_and_holds_the_picker_there(robot):
    arm = robot.world.arm
    assert np.abs(robot.joints() - arm.home).max() < 1e-3
    T = arm.forward_kinematics(robot.joints())
    picker = robot.world.data.body("picker")
    assert np.abs(picker.xpos - T[:3, 3]).max() < 1e-6
    assert np.abs(picker.xmat.reshape(3, 3) - T[:3, :3]).max() < 1e-6
    assert np.abs(T - Panda().forward_kinematics(Panda().home)).max() < 0.01


def test_it_follows_a_trajectory_within_a_millimetre(robot):
    arm = robot.world.arm
    start = robot.joints()
    pose = arm.forward_kinematics(start)
    pose[:3, 3] += (0.12, 0.05, -0.05)
    end = nearest_solution(pose, start, arm=arm)
    result = robot.follow(retime(np.linspace(start, end, 60), arm.limits, speed=0.5))
    assert result.reached, result.reason
    assert np.abs(robot.world.data.body("picker").xpos - pose[:3, 3]).max() < 1e-3


def test_what_hangs_on_it_counts_as_the_tool(robot):
    contacts = robot.world.contacts
    model = robot.world.model
    tool = [model.body(model.geom_bodyid[i]).name for i in np.flatnonzero(contacts._is_tool)]
    assert "picker" in tool
    assert not any(name.startswith("berry") for name in tool)


def test_a_ur5_picks_both_ripe_berries():
    with Session(Scenario(3, ORACLE, WorldConfig(arm_visuals=False), suite="easy", arm="ur5")) as session:
        assert session.world.arm.joint_count == 6
        assert session.run().stopped is None
        fates = session.fates()
    assert [fate.pluckable for fate in fates] == [fate.punnet is not None for fate in fates]
    assert sum(fate.punnet is not None for fate in fates) == 2


def test_arm_without_a_model_file_is_refused():
    with pytest.raises(ConfigurationError, match="no model file"):
        place_arm(replace(load_arm("ur5"), source=None))
