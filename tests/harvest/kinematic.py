"""A robot without physics: it is where it was told to go, and its berries hang where one simulated look saw them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from punnet.harvest.config import HarvestConfig
from punnet.harvest.loop import Harvester
from punnet.planning import ProMPDepthPlanner
from punnet.robot import HOME, CutResult, GripResult, MotionResult, Panda
from punnet.scene import Frame, Strawberries
from punnet.sim.punnets import PUNNET_PLACES, inside_punnet
from punnet.weight import WeightEstimates

ARM = Panda()


class KinematicRobot:
    """Grips what is within 12 mm of the tool, and drops it where it lets go."""

    def __init__(self, frame: Frame, berries: Strawberries) -> None:
        self.frame, self.berries = frame, berries
        self.hanging = set(range(len(berries)))
        self.time = 0.0
        self.punnets = [0.0] * len(PUNNET_PLACES)
        self.held: int | None = None
        self._joints = HOME.copy()
        self._rng = np.random.default_rng(0)

    def joints(self):
        return self._joints.copy()

    def tool(self):
        return ARM.forward_kinematics_tool(self._joints)[:3, 3]

    def look(self):
        self.time += 0.4
        noise = 0.001 * self._rng.standard_normal(self.frame.depth.shape)
        depth = np.where(self.frame.depth > 0, self.frame.depth + noise, 0.0).astype(np.float32)
        return replace(self.frame, depth=depth, timestamp=self.time)

    def follow(self, trajectory, force_limit=None):
        self._joints = trajectory.end.copy()
        self.time += trajectory.duration
        return MotionResult(True)

    def separate(self, opening):
        self.time += 0.4

    def grip(self):
        self.time += 0.4
        distance = np.linalg.norm(self.berries.picking_points - self.tool(), axis=1)
        near = [row for row in self.hanging if distance[row] < 0.012]
        self.held = near[0] if near else None
        return GripResult(bool(near), 0.002 * bool(near), None if near else "nothing between the pads")

    def cut(self):
        self.time += 0.5
        self.hanging.discard(self.held)
        return CutResult(True)

    def release(self, opening=1.0):
        self.time += 0.4
        if self.held is not None and self.held not in self.hanging:
            punnet = inside_punnet(self.tool() - np.array([0.0, 0.0, 0.03]))
            if punnet is not None:
                self.punnets[punnet] += float(self.berries.weights[self.held])
        self.held = None

    def weigh_punnet(self, punnet):
        return self.punnets[punnet]


class Eyes:
    """Sees what hangs, exactly."""

    name = "eyes"

    def __init__(self, robot: KinematicRobot) -> None:
        self._robot = robot

    def detect(self, frame):
        return self._robot.berries[sorted(self._robot.hanging)]


class Scale:
    """Says what the berries weigh."""

    name = "scale"

    def estimate(self, frame, berries):
        return WeightEstimates(berries.weights, berries.weight_intervals, (None,) * len(berries))


def a_harvester(robot: KinematicRobot, **settings) -> Harvester:
    """A harvester of the robot's berries."""
    planner = ProMPDepthPlanner.from_bundle()
    return Harvester(robot, Eyes(robot), Scale(), planner, PUNNET_PLACES, HarvestConfig(**settings))
