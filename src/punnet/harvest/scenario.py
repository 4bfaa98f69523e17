"""A plant, a robot and the parts that pick from it, put together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import cast
from weakref import WeakMethod

import numpy as np

from punnet.errors import ConfigurationError
from punnet.harvest.attempts import Attempt, HarvestRun, History
from punnet.harvest.config import HarvestConfig
from punnet.harvest.judge import Fate, judge, reachable_berries
from punnet.harvest.loop import Harvester, Listener
from punnet.harvest.suites import suite_of
from punnet.harvest.timing import TimedRobot
from punnet.perception import load_detector
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.planning.choice import DEFAULT_CHOICE, with_choice
from punnet.planning.named import DEFAULT_PLANNER, planner_named
from punnet.robot import MotionGuard, Robot, load_arm
from punnet.scene import Frame
from punnet.sim.camera_effects import NIGHT_CAMERA
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.oracle import OracleDetector, OracleScale
from punnet.sim.punnets import PUNNET_PLACES
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.structure import structure_boxes
from punnet.sim.world import WorldConfig, build_world
from punnet.weight.choosing import load_weight_estimator

__all__ = ["LEAST_RIPENESS", "ORACLE", "Scenario", "Session"]

ORACLE = "oracle"
"""The truth in place of a detector and a scale."""


LEAST_RIPENESS = {SIMULATION_DETECTOR: 0.9}
"""From which ripeness a detector's berries are picked: what it calls pluckable and less ripe than that was mostly unripe,
partly hidden fruit on the plants that this was fitted on (suites ``clustered`` and ``occluded``, seed 501)."""


@dataclass(frozen=True)
class Scenario:
    """Everything that fixes a simulated harvest; the same scenario gives the same harvest.

    Parameters
    ----------
    seed
        Of the plant and of the sensors' noise.
    perception
        A detector as :func:`punnet.perception.load_detector` takes it, on the noisy camera; ``oracle``: the truth in the
        place of detector and scale.
    world
        What is grown.
    harvest
        How the loop moves.
    suite
        One of :data:`~punnet.harvest.suites.SUITES`: the plant and the light are those of its ``seed``, in place of
        what ``world`` says of them.
    choice
        How a reach is chosen; see :mod:`punnet.planning.choice`.
    planner, planner_bundle
        What plans, as :func:`punnet.planning.planner_named` takes it.
    arm
        What the picker is mounted on, as :func:`punnet.robot.load_arm` takes it, in place of what ``world`` says.
    """

    seed: int
    perception: str = SIMULATION_DETECTOR
    world: WorldConfig = field(default_factory=WorldConfig)
    harvest: HarvestConfig = field(default_factory=HarvestConfig)
    suite: str | None = None
    choice: str = DEFAULT_CHOICE
    planner: str = DEFAULT_PLANNER
    planner_bundle: str | None = None
    arm: str = "panda"

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ConfigurationError(f"seed must be ≥ 0, got {self.seed}")

    def plant(self) -> tuple[int, WorldConfig]:
        """Seed and config of the world to build."""
        world = replace(self.world, arm=self.arm)
        return (self.seed, world) if self.suite is None else suite_of(self.suite).plant(self.seed, world)


class Session:
    """A scenario that has been built; a context manager, since it holds a renderer.

    Parameters
    ----------
    scenario
        What to build.
    listener
        Told of each step.
    stand_in
        Makes of the simulated camera the robot that is told what to do, in place of the simulated one.
    """

    def __init__(
        self,
        scenario: Scenario,
        listener: Listener | None = None,
        stand_in: Callable[[Callable[[], Frame]], Robot] | None = None,
    ) -> None:
        self.scenario = scenario
        self._listener = listener
        self.truth_of: dict[int, float] = {}
        """True grams of what each attempt brought off the plant, by its number."""
        # First of all: a detector or planner that can't be had is found out before a plant is grown.
        detector = None if scenario.perception == ORACLE else load_detector(scenario.perception)
        scale = OracleScale() if detector is None else load_weight_estimator()
        self.scale_name = scale.name
        arm = load_arm(scenario.arm)
        base = planner_named(scenario.planner, arm=arm, bundle=scenario.planner_bundle)
        planner = with_choice(base, scenario.choice, arm)
        self.planner_name = planner.name
        world_seed, config = scenario.plant()
        self.world = build_world(world_seed, config)
        self.reachable = reachable_berries(self.world)
        noise = np.random.default_rng((scenario.seed, 1))
        camera = NIGHT_CAMERA if config.light == "lamp" else None
        self.robot = SimulatedRobot(self.world, noise, StereoDepthModel(), camera)
        self.timed = TimedRobot(self.robot)
        """The robot as the harvester has it."""
        settings = scenario.harvest
        if settings.least_ripeness is None:
            settings = replace(settings, least_ripeness=LEAST_RIPENESS.get(scenario.perception))
        self.harvester = Harvester(
            cast(Robot, self.timed) if stand_in is None else stand_in(self.robot.look),
            OracleDetector(self.robot) if detector is None else detector,
            scale,
            planner,
            PUNNET_PLACES,
            settings,
            _weakly(self._listen),
            MotionGuard(arm, structure_boxes(self.world)),
        )
        self._hanging = self.world.attached()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.robot.close()

    def _listen(self, line: str, attempt: Attempt | None) -> None:
        """Note what came off the plant during an attempt, and pass the line on."""
        came_off = np.flatnonzero(self._hanging & ~self.world.attached())
        if attempt is not None and len(came_off):
            masses = [self.world.cluster.berries[index].berry.mass for index in came_off]
            self.truth_of[attempt.number] = self.truth_of.get(attempt.number, 0.0) + float(sum(masses))
            self._hanging = self.world.attached()
        if self._listener is not None:
            self._listener(line, attempt)

    def resume(self, history: History) -> None:
        """Go on from what an earlier run did; its world and its ``truth_of`` have been restored already."""
        self._hanging = self.world.attached()
        self.harvester.restore(history)
        self.harvester.is_home = bool(history.attempts)

    def run(self) -> HarvestRun:
        """Harvest."""
        return self.harvester.run()

    def fates(self) -> list[Fate]:
        """What became of each berry until now."""
        return judge(self.world, self.reachable)


def _weakly(listen: Listener) -> Listener:
    """A method of an object that this does not keep: a session would else hold itself, and its world's memory with it."""
    found = WeakMethod(listen)

    def told(line: str, attempt: Attempt | None) -> None:
        method = found()
        if method is not None:
            method(line, attempt)

    return told
