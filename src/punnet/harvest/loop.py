"""The harvest loop: look, perceive, weigh, choose berry and punnet, plan, reach, separate, grip, cut, retreat, place."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import KinematicsError, OutputError, PlanningError, RobotError
from punnet.harvest.attempts import Attempt, HarvestRun, History, Journal, Outcome, Phase
from punnet.harvest.config import HarvestConfig
from punnet.harvest.motions import Motions
from punnet.harvest.order import picking_order
from punnet.perception.detector import Detector
from punnet.perception.picking_points import locate_picking_points
from punnet.planning import Planner
from punnet.robot import Panda, Robot
from punnet.scene import Frame, Strawberries, Target
from punnet.weight import WeightEstimator
from punnet.weight.packing import LookAhead, Packer, PackingConfig, WeighedBerry

__all__ = ["CUTTING", "Harvester", "Listener"]

Listener = Callable[[str, Attempt | None], None]
"""Told of each step: a line for a person, and the attempt it belongs to."""

CUTTING = "cuts the stem"
"""What a listener is told when the blade starts."""

_EMPTY_PUNNET_NOISE = 1.0  # grams; a gain below this means that nothing fell in


class _StepError(Exception):
    """A step did not work out; carries the reason for the log. Never leaves this module."""


@dataclass
class _Remembered:
    """A place where picking was tried, and how often."""

    point: NDArray[np.float64]
    tries: int


class Harvester:
    """Picks every pluckable berry that it can see and reach, one after another.

    Parameters
    ----------
    robot, detector, scale, planner
        The parts; any implementation of the protocols will do.
    punnet_places
        (P, 3) centre of each punnet's floor in the base frame, metres.
    config
        Settings.
    listener
        Told of each step.
    """

    def __init__(
        self,
        robot: Robot,
        detector: Detector,
        scale: WeightEstimator,
        planner: Planner,
        punnet_places: NDArray[np.float64],
        config: HarvestConfig | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.config = config or HarvestConfig()
        self._robot = robot
        self._detector = detector
        self._scale = scale
        self._planner = planner
        self._tell = listener or (lambda line, attempt: None)
        self._motions = Motions(robot, Panda(), punnet_places, self.config)
        packing = PackingConfig(self.config.nominal_punnet, self.config.punnet_berries)
        self._packer = Packer(LookAhead(packing), len(punnet_places))
        self._tried: list[_Remembered] = []
        self.run_so_far = HarvestRun()
        self.journal: Journal | None = None
        """Told of each attempt; set before :meth:`run`."""
        self.is_home = False
        """Whether the arm is known to be home, the tool open and empty; :meth:`run` goes there first if not."""
        self._before = (0.0, 0.0)
        self._began = (0.0, 0.0)

    def restore(self, history: History) -> None:
        """Take over what an earlier run had done: its attempts count, and their berries' tries and punnets are known."""
        run = self.run_so_far
        run.attempts.extend(history.attempts)
        self._before = history.seconds
        for attempt in history.attempts:
            self._remember_try(attempt.picking_point)
            if attempt.meant_for is None or math.isnan(attempt.reading):
                continue
            if attempt.outcome is Outcome.PICKED:
                self._packer.place(attempt.meant_for, _weighed(attempt.berries, attempt.row, attempt.number))
            self._packer.observe(attempt.meant_for, attempt.reading)
        if history.attempts:
            run.first_frame, run.first_berries = history.attempts[0].frame, history.attempts[0].berries

    def reconcile(self) -> list[float]:
        """Grams that each punnet holds beyond what the attempts account for, as the berry of a pick that was cut short.

        For a robot whose world went on while the program was dead, after :meth:`restore`: the berry is in the
        punnet's weight from then on, and counted as no pick.
        """
        gained = [
            self._packer.observe(punnet, self._robot.weigh_punnet(punnet)) for punnet in self._packer.punnets
        ]
        for punnet, grams in enumerate(gained):
            if grams > _EMPTY_PUNNET_NOISE:
                self._tell(f"punnet {punnet + 1} holds {grams:.1f} g that no pick accounts for", None)
        return gained

    def run(self) -> HarvestRun:
        """Harvest until no pluckable berry is left that has not been tried often enough.

        An interrupt (Ctrl-C) or an arm that does not get home ends the run where it is; what was done is in the
        result, with the reason in ``stopped``.
        """
        run = self.run_so_far
        self._began = (self._robot.time, time.perf_counter())
        try:
            if not self.is_home:
                self._go_home()
            for _ in range(self.config.most_looks):
                frame, berries = self._look(run)
                chosen = self._choose(run, frame, berries)
                if chosen is None:
                    break
                self._attempt(run, frame, berries, *chosen)
        except KeyboardInterrupt:
            run.interrupted = True
        except (RobotError, KinematicsError, OutputError) as error:
            run.stopped = str(error)
            self._tell(f"stopped: {error}", None)
        run.punnet_weights = [punnet.grams for punnet in self._packer.punnets.values()]
        run.punnets_full = [number in self._packer.due() for number in self._packer.punnets]
        self._take_time()
        return run

    def _take_time(self) -> None:
        """How long the run has taken until now."""
        run = self.run_so_far
        run.seconds_simulated = self._before[0] + self._robot.time - self._began[0]
        run.seconds_computing = self._before[1] + time.perf_counter() - self._began[1]

    def _go_home(self) -> None:
        """Home, or the end of the run: from anywhere else the plant is not seen as it should be."""
        home = self._motions.go_home()
        if not home.reached:
            raise RobotError(f"the arm does not get home: {home.reason}")

    def _look(self, run: HarvestRun) -> tuple[Frame, Strawberries]:
        """A frame and its berries, weighed and located."""
        frame = self._robot.look()
        berries = self._detector.detect(frame)
        if np.isnan(berries.picking_points).all():
            berries = locate_picking_points(frame, berries)
        estimates = self._scale.estimate(frame, berries)
        berries = berries.with_fields(weights=estimates.grams, weight_intervals=estimates.intervals)
        if run.first_frame is None:
            run.first_frame, run.first_berries = frame, berries
        run.last_berries = berries
        self._tell(f"sees {len(berries)} berries, {int(berries.pluckable.sum())} pluckable", None)
        return frame, berries

    def _choose(self, run: HarvestRun, frame: Frame, berries: Strawberries) -> tuple[int, int | None] | None:
        """The next berry that has tries left and fits a punnet, and that punnet.

        A berry that fits none waits on the plant; when there are only such, the one that fits best. No punnet:
        all are full.
        """
        rows = [
            int(row)
            for row in picking_order(frame, berries)
            if self._memory(berries.picking_points[row]).tries < self.config.attempts
        ]
        if not rows:
            return None
        number = len(run.attempts) + 1
        offers = []
        for row in rows:
            best = self._packer.best(_weighed(berries, row, number))
            if best is None:
                return row, None
            punnet, cost = best
            if cost <= self._packer.policy.price_aside:
                return row, punnet
            offers.append((cost, row, punnet))
        _, row, punnet = min(offers)
        return row, punnet

    def _memory(self, point: NDArray[np.float64]) -> _Remembered:
        for place in self._tried:
            if np.linalg.norm(place.point - point) < self.config.same_berry:
                return place
        return _Remembered(point, 0)

    def _remember_try(self, point: NDArray[np.float64]) -> None:
        place = self._memory(point)
        if place.tries == 0:
            self._tried.append(place)
        place.tries += 1

    def _attempt(
        self, run: HarvestRun, frame: Frame, berries: Strawberries, row: int, punnet: int | None
    ) -> None:
        low, high = berries.weight_intervals[row]
        attempt = Attempt(
            number=len(run.attempts) + 1,
            frame=frame,
            berries=berries,
            row=row,
            picking_point=berries.picking_points[row],
            estimate=float(berries.weights[row]),
            interval=(float(low), float(high)),
            meant_for=punnet,
        )
        run.attempts.append(attempt)
        if self.journal is not None:
            self.journal.begin(attempt)
        self._remember_try(attempt.picking_point)
        began, clock = self._robot.time, time.perf_counter()
        try:
            self._pick(attempt)
            attempt.outcome = Outcome.PICKED
        except _StepError as failure:
            attempt.reason = str(failure)
            if attempt.phase is Phase.PLAN:
                attempt.outcome = Outcome.SKIPPED
        finally:
            attempt.seconds_simulated = self._robot.time - began
            attempt.seconds_computing = time.perf_counter() - clock
        self._tell(_summary(attempt), attempt)
        self._take_time()
        if self.journal is not None:
            self.journal.end(attempt)

    def _pick(self, attempt: Attempt) -> None:
        """All the steps of one pick; whatever fails, the tool ends empty, open and out of the plant."""
        self._plan(attempt)
        try:
            self._reach(attempt)
            self._separate_and_grip(attempt)
            self._cut(attempt)
        except _StepError:
            self._motions.back_off()
            self._go_home()
            raise
        self._retreat_and_place(attempt)

    def _plan(self, attempt: Attempt) -> None:
        attempt.phase = Phase.PLAN
        if attempt.meant_for is None:
            raise _StepError("all punnets are full")
        berries, row = attempt.berries, attempt.row
        target = Target(
            berries.boxes[row], attempt.picking_point, berry_id=int(berries.ids[row]), among=berries
        )
        try:
            attempt.distribution = self._planner.plan(attempt.frame, target, self._robot.joints())
            self._motions.prepare(attempt.distribution)
        except (PlanningError, KinematicsError) as error:
            raise _StepError(str(error)) from error

    def _reach(self, attempt: Attempt) -> None:
        attempt.phase = Phase.REACH
        self._tell(f"reaches for berry at {_place(attempt.picking_point)}", attempt)
        result = self._motions.reach()
        attempt.peak_force, attempt.touched = result.peak_force, result.touched
        if not result.reached:
            raise _StepError(result.reason or "did not arrive")

    def _separate_and_grip(self, attempt: Attempt) -> None:
        attempt.phase = Phase.SEPARATE
        self._tell("moves its neighbours aside and grips the stem", attempt)
        self._robot.separate(self.config.separation)
        attempt.phase = Phase.GRIP
        grip = self._robot.grip()
        if not grip.holding:
            raise _StepError(grip.reason or "nothing between the pads")

    def _cut(self, attempt: Attempt) -> None:
        attempt.phase = Phase.CUT
        self._tell(CUTTING, attempt)
        cut = self._robot.cut()
        if not cut.cut:
            raise _StepError(cut.reason or "the stem was not cut")

    def _retreat_and_place(self, attempt: Attempt) -> None:
        attempt.phase = Phase.RETREAT
        punnet = attempt.meant_for
        assert punnet is not None  # without one there was no plan
        self._tell(f"carries it to punnet {punnet + 1}", attempt)
        moved = self._motions.retreat()
        self._robot.separate(0.0)
        attempt.phase = Phase.PLACE
        if moved.reached:
            moved = self._motions.carry(punnet, len(self._packer.punnets[punnet].berries))
        if moved.reached:
            self._motions.leave_punnet()
        berry = _weighed(attempt.berries, attempt.row, attempt.number)
        self._packer.place(punnet, berry)
        self._go_home()
        attempt.reading = self._robot.weigh_punnet(punnet)
        gained = self._packer.observe(punnet, attempt.reading)
        if gained < _EMPTY_PUNNET_NOISE:
            self._packer.lost(punnet, berry)
            raise _StepError(moved.reason or "the berry was lost on the way to the punnet")
        attempt.weighed, attempt.punnet = gained, punnet


def _weighed(berries: Strawberries, row: int, number: int) -> WeighedBerry:
    """One of ``berries`` as the packer takes it."""
    low, high = berries.weight_intervals[row]
    return WeighedBerry(number, float(berries.weights[row]), float(low), float(high))


def _place(point: NDArray[np.float64]) -> str:
    return f"x {point[0]:.2f}, y {point[1]:+.2f}, z {point[2]:.2f} m"


def _summary(attempt: Attempt) -> str:
    if attempt.outcome is Outcome.PICKED:
        return (
            f"picked: {attempt.weighed:.1f} g (estimated {attempt.estimate:.1f} g) into punnet "
            f"{(attempt.punnet or 0) + 1}, {attempt.seconds_simulated:.1f} s"
        )
    return f"{attempt.outcome} while trying to {attempt.phase}: {attempt.reason}"
