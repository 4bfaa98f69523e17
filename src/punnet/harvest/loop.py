"""The harvest as a state machine: which step follows which, and what is done when one fails.

look → perceive → weigh → order → plan → check → reach → separate → grip → cut → place → verify → look …

Each step is an object with one job (:mod:`punnet.harvest.seeing`, :mod:`~punnet.harvest.deciding`,
:mod:`~punnet.harvest.picking`). It gives the phase that comes next, or raises
:class:`~punnet.harvest.failures.StepFailed` with a failure, which has a recovery.
"""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from punnet.errors import KinematicsError, OutputError, RobotError
from punnet.harvest.attempts import Attempt, HarvestRun, History, Journal, Outcome, Phase
from punnet.harvest.config import HarvestConfig
from punnet.harvest.deciding import Check, Order, Plan
from punnet.harvest.eyes import Eyes
from punnet.harvest.failures import Failure, Recovery, StepFailed
from punnet.harvest.memory import Memory
from punnet.harvest.motions import Motions
from punnet.harvest.picking import CUTTING, EMPTY_PUNNET_NOISE, Cut, Grip, Place, Reach, Separate, Verify
from punnet.harvest.seeing import Look, Perceive, Weigh
from punnet.harvest.situation import Listener, Parts, Situation, Step, weighed
from punnet.perception.detector import Detector
from punnet.planning import Planner
from punnet.robot import GuardedRobot, MotionGuard, Robot
from punnet.weight import WeightEstimator
from punnet.weight.packing import LookAhead, Packer, PackingConfig

__all__ = ["CUTTING", "Harvester", "Listener", "summary"]

STEPS = (Look, Perceive, Weigh, Order, Plan, Check, Reach, Separate, Grip, Cut, Place, Verify)
IN_THE_PLANT = (Phase.REACH, Phase.SEPARATE, Phase.GRIP, Phase.CUT)
"""Phases in which the tool is among the berries: after a failure it is backed out first."""
NOT_TRIED = (Phase.ORDER, Phase.PLAN, Phase.CHECK)
"""Phases in which nothing has moved yet: a failure there is a berry skipped."""


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
    guard
        What every motion has to pass; the Panda's limits and its own body if None, but no structure.
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
        guard: MotionGuard | None = None,
    ) -> None:
        self.config = config = config or HarvestConfig()
        packing = PackingConfig(config.nominal_punnet, config.punnet_berries)
        self._places = len(punnet_places)
        guarded = GuardedRobot(robot, guard or MotionGuard())
        self._parts = Parts(
            guarded,
            Eyes(guarded, detector),
            scale,
            planner,
            Motions(guarded, guarded.guard.arm, punnet_places, config),
            Packer(LookAhead(packing), self._places),
            config,
            listener or (lambda line, attempt: None),
        )
        self._situation = Situation(Memory(config.same_berry, config.attempts))
        self._steps: dict[Phase, Step] = {step.phase: step(self._parts) for step in STEPS}
        self.journal: Journal | None = None
        """Told of each attempt; set before :meth:`run`."""
        self._first_phase = Phase.LOOK
        self.is_home = False
        """Whether the arm is known to be home, the tool open and empty; :meth:`run` goes there first if not."""
        self._before = (0.0, 0.0)
        self._began = (0.0, 0.0)
        self._attempt_began = (0.0, 0.0)

    @property
    def run_so_far(self) -> HarvestRun:
        """What has been done until now."""
        return self._situation.run

    @property
    def memory(self) -> Memory:
        """What is remembered of the places where picking was tried."""
        return self._situation.memory

    def run(self) -> HarvestRun:
        """Harvest until no pluckable berry is left that has not been tried often enough.

        An interrupt (Ctrl-C) or a failure that only a stop is safe after ends the run where it is; what was done is
        in the result, with the reason in ``stopped``.
        """
        run = self.run_so_far
        self._began = self._now()
        try:
            if not self.is_home:
                self._parts.motions.require_home()
            phase: Phase | None = self._first_phase
            while phase is not None:
                phase = self._do(phase)
        except KeyboardInterrupt:
            run.interrupted = True
            self._broken_off("interrupted")
        except StepFailed as failure:
            self._stop(failure.reason)
        except (RobotError, KinematicsError, OutputError) as error:
            self._stop(str(error))
        punnets = self._parts.packer.punnets
        run.punnet_weights = [punnets[n].grams if n in punnets else 0.0 for n in range(self._places)]
        run.punnets_full = [n in self._parts.packer.due() for n in range(self._places)]
        self._take_time()
        return run

    def _do(self, phase: Phase) -> Phase | None:
        """One step; the phase to go on with."""
        situation = self._situation
        try:
            if situation.attempt is not None:
                situation.attempt.phase = phase
            following = self._steps[phase].do(situation)
        except StepFailed as failure:
            return self._recover(phase, failure)
        except KinematicsError as error:
            return self._recover(phase, StepFailed(Failure.NO_KINEMATICS, str(error)))
        except RobotError as error:
            return self._recover(phase, StepFailed(Failure.ROBOT_FAULT, str(error)))
        if phase is Phase.ORDER and situation.attempt is not None:
            self._begin(situation.attempt)
        elif phase is Phase.VERIFY:
            self._end(situation.in_hand)
        return following

    def _recover(self, phase: Phase, failed: StepFailed) -> Phase:
        """After a failure: arm out of the plant and home, the attempt ended, and back to looking; or a stop."""
        situation, attempt = self._situation, self._situation.attempt
        recovery = failed.failure.recovery
        if recovery is Recovery.LOOK_AGAIN:
            situation.in_vain += 1
            if situation.in_vain >= self.config.patience:
                recovery = Recovery.STOP
        if attempt is not None:
            attempt.phase, attempt.failure, attempt.reason = phase, failed.failure, failed.reason
            attempt.outcome = Outcome.SKIPPED if phase in NOT_TRIED else Outcome.FAILED
        else:
            self._parts.tell(f"{phase}: {failed.reason}; {recovery}", None)
        self._note(phase, failed, recovery)
        if recovery is Recovery.STOP:
            raise failed
        if attempt is not None:
            if phase in IN_THE_PLANT:
                self._parts.motions.back_off()
            if phase not in NOT_TRIED:
                try:
                    self._parts.motions.require_home()
                except StepFailed as stuck:
                    self._note(phase, stuck, Recovery.STOP)
                    raise
            self._end(attempt)
            return _after(attempt)
        return Phase.LOOK

    def _note(self, phase: Phase, failed: StepFailed, recovery: Recovery) -> None:
        """Write a failure down."""
        if self.journal is not None:
            self.journal.failed(phase, failed.failure, failed.reason, recovery)

    def _begin(self, attempt: Attempt) -> None:
        """Write down that an attempt begins, before anything moves."""
        self.run_so_far.attempts.append(attempt)
        self._attempt_began = self._now()
        if self.journal is not None:
            self.journal.begin(attempt)

    def _end(self, attempt: Attempt) -> None:
        """Learn from an attempt, and write it down."""
        self._situation.attempt = None
        self._situation.only_refused = attempt.refused and attempt.second_view
        self._situation.memory.learn(attempt)
        self._time(attempt)
        self._parts.tell(summary(attempt), attempt)
        self._take_time()
        if self.journal is not None:
            self.journal.end(attempt)

    def _stop(self, reason: str) -> None:
        """End the run safely: the tool open and out of the plant and the arm home, or still where it is if it can't."""
        run, attempt = self.run_so_far, self._situation.attempt
        run.stopped = reason
        self._broken_off(reason)
        try:
            if attempt is not None and attempt.phase in IN_THE_PLANT:
                self._parts.motions.back_off()
            run.home = self._parts.motions.go_home().reached
        except (RobotError, KinematicsError):
            run.home = False
        where = "the arm is home" if run.home else "the arm stays where it is"
        self._parts.tell(f"stopped: {reason}; {where}", None)

    def _broken_off(self, reason: str) -> None:
        """The attempt in hand, if there is one, ends here."""
        attempt = self._situation.attempt
        if attempt is not None and attempt in self.run_so_far.attempts:
            attempt.reason = attempt.reason or reason
            self._time(attempt)

    def restore(self, history: History) -> None:
        """Take over what an earlier run had done: its attempts count, and their berries' tries and punnets are known."""
        run, packer = self.run_so_far, self._parts.packer
        run.attempts.extend(history.attempts)
        self._before = history.seconds
        self.memory.restore(history.places)
        for attempt in history.attempts:
            if attempt.meant_for is None:
                continue
            if attempt.outcome is Outcome.PICKED:
                packer.place(attempt.meant_for, weighed(attempt.berries, attempt.row, attempt.number))
            if not math.isnan(attempt.reading):
                packer.observe(attempt.meant_for, attempt.reading)
        if history.attempts:
            first, last = history.attempts[0], history.attempts[-1]
            run.first_frame, run.first_berries = first.frame, first.berries
            self._situation.frame, self._situation.berries = last.frame, last.berries
            self._situation.only_refused = last.refused and last.second_view
            self._first_phase = _after(last)

    def reconcile(self) -> list[float]:
        """Grams that each punnet holds beyond what the attempts account for, as the berry of a pick that was cut short.

        For a robot whose world went on while the program was dead, after :meth:`restore`: the berry is in the
        punnet's weight from then on, and counted as no pick.
        """
        self._first_phase = Phase.LOOK
        gained = []
        for number in self._parts.packer.punnets:
            reading = self._parts.robot.weigh_punnet(number)
            grams = 0.0 if reading is None else self._parts.packer.observe(number, reading)
            gained.append(grams)
            if grams > EMPTY_PUNNET_NOISE:
                self._parts.tell(f"punnet {number + 1} holds {grams:.1f} g that no pick accounts for", None)
        return gained

    def _now(self) -> tuple[float, float]:
        """Seconds on the robot's clock, and on ours."""
        return self._parts.robot.time, time.perf_counter()

    def _time(self, attempt: Attempt) -> None:
        robot, ours = self._now()
        attempt.seconds_simulated = robot - self._attempt_began[0]
        attempt.seconds_computing = ours - self._attempt_began[1]

    def _take_time(self) -> None:
        """How long the run has taken until now."""
        robot, ours = self._now()
        self.run_so_far.seconds_simulated = self._before[0] + robot - self._began[0]
        self.run_so_far.seconds_computing = self._before[1] + ours - self._began[1]


def _after(attempt: Attempt) -> Phase:
    """What follows an attempt that was not a pick: a look, unless nothing has moved since the last one from home."""
    return Phase.ORDER if attempt.refused and not attempt.second_view else Phase.LOOK


def summary(attempt: Attempt) -> str:
    """How an attempt ended, as a listener is told."""
    if attempt.outcome is Outcome.PICKED:
        weight = "not weighed" if math.isnan(attempt.weighed) else f"{attempt.weighed:.1f} g"
        return (
            f"picked: {weight} (estimated {attempt.estimate:.1f} g) into punnet "
            f"{(attempt.punnet or 0) + 1}, {attempt.seconds_simulated:.1f} s"
        )
    return f"{attempt.outcome} while trying to {attempt.phase}: {attempt.reason}"
