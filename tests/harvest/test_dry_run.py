"""A harvest that moves nothing: what it would have done, in files that a robot could follow."""

import json
from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import OutputExistsError, RobotError, ShapeError
from punnet.harvest.config import HarvestConfig
from punnet.harvest.loop import Harvester
from punnet.harvest.rehearsal import rehearse
from punnet.harvest.scenario import Scenario, Session
from punnet.movement import JointTrajectory
from punnet.planning import ProMPDepthPlanner
from punnet.robot import HOME, DryRunRobot, MotionGuard, Robot
from punnet.sim.punnets import PUNNET_PLACES
from punnet.sim.structure import structure_boxes
from punnet.sim.world import WorldConfig


def no_camera():
    raise AssertionError("nobody should look")


def test_every_berry_gets_trajectories_that_fit_together(tmp_path):
    with Session(Scenario(6, "oracle", WorldConfig(arm_visuals=False))) as session:
        frame = session.robot.look()
        eyes = session.harvester._parts.eyes
        berries = eyes.perceive(frame)
        guard = MotionGuard(structure=structure_boxes(session.world))
    rng = np.random.default_rng(0)

    def camera():
        noise = 1.0 + 0.001 * rng.standard_normal(frame.depth.shape)
        return replace(frame, depth=(frame.depth * noise).astype(np.float32))

    class Seen:
        name = "seen"

        def detect(self, frame):
            return berries

    robot = DryRunRobot(tmp_path / "dry", camera)
    assert isinstance(robot, Robot)
    scale, planner = session.harvester._parts.scale, ProMPDepthPlanner.from_bundle()
    config = HarvestConfig(attempts=1)
    run = Harvester(robot, Seen(), scale, planner, PUNNET_PLACES, config, guard=guard).run()
    assert run.stopped is None
    assert len(run.picked) == len(run.attempts) == int(berries.pluckable.sum()) >= 2
    at = HOME
    for path in robot.trajectories:
        trajectory = JointTrajectory.from_json(json.loads(path.read_text()), where=str(path))
        assert guard.refusal(trajectory, at) is None
        assert trajectory.joint_names[0] == "panda_joint1"
        at = trajectory.end
    assert np.allclose(at, HOME, atol=1e-6)
    actions = [json.loads(line) for line in (tmp_path / "dry" / "actions.jsonl").read_text().splitlines()]
    assert [action["file"] for action in actions if action["action"] == "follow"] == [
        path.name for path in robot.trajectories
    ]
    assert sum(action["action"] == "cut" for action in actions) == len(run.picked)
    times = [action["time"] for action in actions]
    assert times == sorted(times)


def test_a_dry_run_overwrites_nothing(tmp_path):
    DryRunRobot(tmp_path / "dry", no_camera)
    with pytest.raises(OutputExistsError, match="exists"):
        DryRunRobot(tmp_path / "dry", no_camera)


def test_bad_joints_are_named(tmp_path):
    with pytest.raises(ShapeError, match="finite joint angles"):
        DryRunRobot(tmp_path / "a", no_camera, [0.0, np.nan])
    with pytest.raises(RobotError, match="7 joints"):
        DryRunRobot(tmp_path / "b", no_camera).follow(JointTrajectory(np.array([0.0, 1.0]), np.zeros((2, 6))))


def test_a_harvest_is_rehearsed_into_a_folder(tmp_path):
    rehearsal = rehearse(Scenario(6, "oracle", WorldConfig(arm_visuals=False)), tmp_path)
    assert rehearsal.run.stopped is None
    assert len(rehearsal.run.attempts) >= 2
    assert sorted(path.name for path in tmp_path.glob("*-trajectory.json")) == list(rehearsal.trajectories)
    told = json.loads(json.dumps(rehearsal.to_json()))
    assert all(berry["punnet"] in (1, 2) for berry in told["berries"])
    assert rehearsal.seconds > 5.0
