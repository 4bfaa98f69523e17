"""Berries whose stem something hides: tried last, and where they showed best."""

from dataclasses import replace

import numpy as np

from punnet.errors import KinematicsError
from punnet.harvest.attempts import Outcome
from punnet.harvest.memory import Memory
from punnet.harvest.seeing import middle_of_plant
from punnet.harvest.situation import Situation, stem_is_hidden
from punnet.scene import KEYPOINTS, Strawberries, Visibility
from tests.harvest.kinematic import KinematicRobot, a_harvester

STEM = KEYPOINTS.index("picking_point")


def seen_as(berries, visibilities):
    visibility = berries.visibility.copy()
    visibility[:, STEM] = visibilities
    return berries.with_fields(visibility=visibility)


class Glances:
    """Eyes that see each berry's stem as the frame's number says, from the second look on as clearly as can be."""

    name = "glances"

    def __init__(self, robot, first, later):
        self._robot, self._first, self._later = robot, first, later
        self.looks = 0

    def detect(self, frame):
        self.looks += 1
        rows = sorted(self._robot.hanging)
        seen = self._first if self.looks == 1 else self._later
        return seen_as(self._robot.berries, seen)[rows]


def harvested(two_berries, first, later, **settings):
    frame, berries = two_berries
    robot = KinematicRobot(frame, berries)
    harvester = a_harvester(robot, **settings)
    harvester._parts.eyes._detector = Glances(robot, first, later)
    return robot, harvester.run()


def test_one_in_sight_comes_before_one_whose_stem_is_hidden(two_berries):
    _, berries = two_berries
    hidden, shown = Visibility.HIDDEN_BY_OTHER, Visibility.VISIBLE
    for first in ((hidden, shown), (shown, hidden)):
        _, run = harvested(two_berries, first, first)
        assert [attempt.outcome for attempt in run.attempts] == [Outcome.PICKED] * 2
        aimed = [attempt.picking_point for attempt in run.attempts]
        assert np.allclose(aimed[0], berries.picking_points[first.index(shown)])


def test_when_all_are_hidden_from_home_the_plant_is_looked_at_from_its_sides(two_berries):
    hidden, shown = (Visibility.HIDDEN_BY_OTHER,) * 2, (Visibility.VISIBLE,) * 2
    _, run = harvested(two_berries, hidden, shown)
    assert [attempt.second_view for attempt in run.attempts] == [True, False]
    assert len(run.picked) == 2


def test_what_stays_hidden_is_tried_all_the_same(two_berries):
    hidden = (Visibility.HIDDEN_BY_OTHER,) * 2
    _, run = harvested(two_berries, hidden, hidden)
    assert len(run.picked) == 2


def test_they_are_tried_where_the_plant_can_not_be_seen_from_its_sides(two_berries):
    frame, berries = two_berries
    robot = KinematicRobot(frame, berries)
    harvester = a_harvester(robot)
    hidden = (Visibility.HIDDEN_BY_OTHER,) * 2
    harvester._parts.eyes._detector = Glances(robot, hidden, hidden)

    def out_of_reach(point, direction):
        raise KinematicsError("no solution")

    harvester._parts.motions.look_along = out_of_reach
    run = harvester.run()
    assert len(run.picked) == 2
    assert not any(attempt.second_view for attempt in run.attempts)


def test_a_berry_of_another_row_does_not_move_the_middle_of_the_plant(two_berries):
    frame, berries = two_berries
    points = np.concatenate((berries.picking_points, [[2.9, 0.4, -0.5]]))
    boxes = np.tile((10.0, 10.0, 30.0, 40.0), (3, 1))
    three = Strawberries((480, 640), boxes, picking_points=points)
    situation = Situation(Memory(0.025, 3), frame=frame, berries=three)
    middle = berries.picking_points.mean(axis=0)
    assert np.allclose(middle_of_plant(situation), middle)
    situation.berries = three[[2]]
    assert np.allclose(middle_of_plant(situation), points[2])  # if it is all that was seen


def test_without_key_points_no_stem_counts_as_hidden(two_berries):
    _, berries = two_berries
    assert stem_is_hidden(seen_as(berries, Visibility.HIDDEN_BY_OTHER), 0)
    assert not stem_is_hidden(seen_as(berries, Visibility.HIDDEN_BY_ITSELF), 0)
    bare = Strawberries((480, 640), berries.boxes)
    assert not stem_is_hidden(bare, 0)


def test_a_look_on_the_way_that_hides_the_stem_moves_nothing(two_berries):
    frame, berries = two_berries
    shown, hidden = Visibility.VISIBLE, Visibility.HIDDEN_BY_OTHER
    robot = KinematicRobot(frame, berries[[0]])
    moved = replace(berries[[0]], picking_points=berries.picking_points[[0]] + (0.0, 0.012, 0.0))
    harvester = a_harvester(robot, attempts=1)

    class OnTheWay:
        name, looks = "on the way", 0

        def detect(self, frame):
            self.looks += 1
            if not robot.hanging:
                return berries[[]]
            return seen_as(berries[[0]], shown) if self.looks == 1 else seen_as(moved, hidden)

    harvester._parts.eyes._detector = OnTheWay()
    run = harvester.run()
    assert run.attempts[0].outcome is Outcome.PICKED
    assert not run.attempts[0].shift.any()
