"""Where the loop looks: the whole frame, or the part of it that matters."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.geometry import project, transform_points
from punnet.harvest.eyes import Eyes, region_around, region_of
from punnet.harvest.picking import Reach
from punnet.scene import Strawberries
from tests.harvest.kinematic import KinematicRobot, a_harvester


class Attentive:
    """Notes where it was told to look, and sees what hangs."""

    name = "attentive"

    def __init__(self, robot):
        self._robot = robot
        self.regions = []

    def detect(self, frame):
        self.regions.append(None)
        return self._robot.berries[sorted(self._robot.hanging)]

    def detect_in(self, frame, region):
        berries = self.detect(frame)
        self.regions[-1] = region
        return berries


def test_the_region_around_a_point_holds_the_berry_that_hangs_from_it(two_berries):
    frame, berries = two_berries
    for row, point in enumerate(berries.picking_points):
        left, top, right, bottom = region_around(frame, point)
        x0, y0, x1, y1 = berries.boxes[row]
        assert left < x0 < x1 < right
        assert top < y0 < y1 < bottom
        in_camera = transform_points(np.linalg.inv(frame.T_base_camera), point)
        u, v = project(frame.camera, in_camera)
        pixel = frame.camera.fx / in_camera[2]
        assert [u - left, right - u, v - top, bottom - v] == pytest.approx(
            [0.05 * pixel, 0.05 * pixel, 0.04 * pixel, 0.08 * pixel]
        )


def test_a_frame_that_can_not_tell_has_no_region(two_berries):
    frame, berries = two_berries
    point = berries.picking_points[0]
    assert region_around(replace(frame, camera=None), point) is None
    assert region_around(replace(frame, T_base_camera=None), point) is None
    behind = transform_points(frame.T_base_camera, np.array([0.0, 0.0, -0.2]))
    assert region_around(frame, behind) is None


def test_the_region_of_berries_is_a_tenth_of_the_image_larger():
    berries = Strawberries((480, 640), np.array([[100.0, 50, 130, 90], [300, 70, 340, 130]]))
    assert region_of(berries).tolist() == [36, -14, 404, 194]


def test_a_detector_that_knows_no_regions_sees_the_whole_frame(two_berries):
    frame, berries = two_berries
    robot = KinematicRobot(frame, berries)
    detector = Attentive(robot)

    class Plain:
        name = "plain"
        detect = detector.detect

    region = np.array([0.0, 0.0, 5.0, 5.0])
    assert len(Eyes(robot, Plain()).perceive(frame, region)) == 2
    assert detector.regions == [None]
    Eyes(robot, detector).perceive(frame, region)
    Eyes(robot, detector).perceive(frame)
    assert detector.regions[1] is region
    assert detector.regions[2] is None


def test_after_the_first_look_only_where_berries_hang_is_looked_at(two_berries, monkeypatch):
    frame, berries = two_berries
    robot = KinematicRobot(frame, berries)
    harvester = a_harvester(robot)
    detector = Attentive(robot)
    harvester._parts.eyes._detector = detector
    on_the_way, shift = [], Reach._shift

    def noted(reach, attempt, tries):
        on_the_way.append((len(detector.regions), attempt.picking_point))
        return shift(reach, attempt, tries)

    monkeypatch.setattr(Reach, "_shift", noted)
    run = harvester.run()
    assert len(run.picked) == len(on_the_way) == 2
    assert detector.regions[0] is None
    for look, point in on_the_way:
        assert np.allclose(detector.regions[look], region_around(frame, point))
    # Looks from home come after an attempt; those from the sides, at the end, are of the whole frame again.
    assert np.array_equal(detector.regions[2], region_of(run.attempts[0].berries))
    assert detector.regions[-1] is None
