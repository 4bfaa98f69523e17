"""Berries with no free approach: they wait for those that may hang in their way, and are looked at again last."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import PlanningError
from punnet.harvest.attempts import History, Outcome, Phase
from punnet.harvest.deciding import Plan
from punnet.harvest.failures import Failure
from tests.harvest.kinematic import KinematicRobot, a_harvester


class Blocked:
    """A planner to which one berry has no free approach while ``blocked`` says so."""

    def __init__(self, planner, point, blocked):
        self._planner, self._point, self._blocked = planner, point, blocked
        self.name = "blocked"

    def plan(self, frame, target, start):
        if np.allclose(target.picking_point, self._point) and self._blocked():
            raise PlanningError("no free approach: whichever way the tool comes in")
        return self._planner.plan(frame, target, start)


def a_blocked_harvest(two_berries, blocked, refused=0, **settings):
    """A harvester whose planner refuses berry number ``refused`` while ``blocked`` of the robot is true.

    With it a list that gets, at each look, the number of berries that hang.
    """
    frame, berries = two_berries
    robot = KinematicRobot(frame, berries)
    harvester = a_harvester(robot, look_on_the_way=0.0, **settings)
    parts = harvester._parts
    planner = Blocked(parts.planner, berries.picking_points[refused], lambda: blocked(robot))
    harvester._parts = replace(parts, planner=planner)
    harvester._steps[Phase.PLAN] = Plan(harvester._parts)
    looks = []
    look = robot.look
    robot.look = lambda: looks.append(len(robot.hanging)) or look()
    return harvester, looks


def harvested(two_berries, blocked, refused=0):
    """Run of such a harvester, and its looks."""
    harvester, looks = a_blocked_harvest(two_berries, blocked, refused)
    return harvester.run(), looks


def test_it_is_picked_after_the_other_without_a_second_view(two_berries):
    run, looks = harvested(two_berries, lambda robot: len(robot.hanging) == 2)
    outcomes = [attempt.outcome for attempt in run.attempts]
    assert outcomes == [Outcome.SKIPPED, Outcome.PICKED, Outcome.PICKED]
    assert not any(attempt.second_view for attempt in run.attempts)
    assert looks.count(2) == 1  # the refusal and the first pick are of one look


def test_the_only_one_left_is_looked_at_from_a_second_view(two_berries):
    refusals = iter((True, False))
    run, _ = harvested(
        two_berries, lambda robot: len(robot.hanging) == 1 and next(refusals, False), refused=1
    )
    outcomes = [attempt.outcome for attempt in run.attempts]
    assert outcomes == [Outcome.PICKED, Outcome.SKIPPED, Outcome.PICKED]
    assert [attempt.second_view for attempt in run.attempts] == [False, False, True]


def test_one_that_stays_blocked_is_given_up(two_berries):
    run, looks = harvested(two_berries, lambda robot: True)
    assert [attempt.outcome for attempt in run.attempts].count(Outcome.PICKED) == 1
    skipped = [attempt for attempt in run.attempts if attempt.outcome is Outcome.SKIPPED]
    assert {attempt.failure for attempt in skipped} == {Failure.NOT_FREE}
    assert len(skipped) == 1 + 3  # once before the other was picked, three times after it
    assert len(looks) < 10


class Killed(BaseException):
    """Stands for a kill: nothing catches it."""


class KilledAfter:
    """A journal whose process is killed when attempt ``number`` has been written down."""

    def __init__(self, harvester, number):
        self._harvester, self._number = harvester, number
        self.history = None

    def begin(self, attempt): ...

    def failed(self, phase, failure, reason, recovery): ...

    def end(self, attempt):
        if attempt.number == self._number:
            attempts = list(self._harvester.run_so_far.attempts)
            self.history = History(attempts, self._harvester.memory.to_json())
            raise Killed


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("refused", [0, 1])
def test_resumed_it_goes_on_as_without_a_break(two_berries, refused, number):
    whole, looks = a_blocked_harvest(two_berries, lambda robot: True, refused)
    run = whole.run()
    begun, seen = a_blocked_harvest(two_berries, lambda robot: True, refused)
    begun.journal = KilledAfter(begun, number)
    with pytest.raises(Killed):
        begun.run()
    resumed, later = a_blocked_harvest(two_berries, lambda robot: True, refused)
    resumed._parts.robot._robot.hanging = set(begun._parts.robot._robot.hanging)
    resumed.restore(begun.journal.history)
    after = resumed.run()
    assert [a.outcome for a in after.attempts] == [a.outcome for a in run.attempts]
    assert [a.second_view for a in after.attempts] == [a.second_view for a in run.attempts]
    assert seen + later == looks
