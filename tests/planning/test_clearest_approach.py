import numpy as np
import pytest

from punnet.errors import PlanningError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.planning import ClearestApproachPlanner, Planner
from punnet.planning.approach import comfortable_angles
from punnet.robot import HOME, T_FLANGE_CAMERA, Panda
from punnet.scene import Frame, Strawberries, Target

POINT = np.array([0.75, -0.06, 0.70])
FRAME = Frame(
    np.zeros((480, 640, 3), np.uint8),
    camera=CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5),
    T_base_camera=Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA,
)


class Listening:
    """Notes what it is asked and refuses the first few."""

    name = "listening"

    def __init__(self, refusals=0):
        self.asked = []
        self.refusals = refusals

    def plan(self, frame, target, start):
        self.asked.append(target.approach)
        if len(self.asked) <= self.refusals:
            raise PlanningError(f"refusal {len(self.asked)}")
        return "a reach"


def target(*neighbours):
    points = np.array([POINT, *(POINT + np.array(offset) for offset in neighbours)])
    boxes = np.tile([300.0, 200.0, 320.0, 230.0], (len(points), 1))
    return Target(boxes[0], POINT, among=Strawberries((480, 640), boxes, picking_points=points))


def yaw_of(direction):
    return np.arctan2(direction[1], direction[0])


def test_it_comes_in_past_the_neighbour():
    inner = Listening()
    assert isinstance(ClearestApproachPlanner(inner), Planner)
    comfortable = float(comfortable_angles(POINT)[0])
    # in front and to the left at the height of the fingers: from the right is better, that is with a larger yaw
    in_front = target((-0.05, 0.018, 0.0))
    assert ClearestApproachPlanner(inner).plan(FRAME, in_front, HOME) == "a reach"
    assert yaw_of(inner.asked[0]) > comfortable + 0.1


def test_the_next_clearest_is_tried_and_the_first_reason_given():
    inner = Listening(refusals=2)
    ClearestApproachPlanner(inner).plan(FRAME, target(), HOME)
    assert len({round(yaw_of(direction), 3) for direction in inner.asked}) == 3
    with pytest.raises(PlanningError, match="refusal 1"):
        ClearestApproachPlanner(Listening(refusals=99)).plan(FRAME, target(), HOME)


def test_an_approach_that_is_asked_for_is_kept():
    inner = Listening()
    asked = Target(np.array([0.0, 0.0, 5.0, 5.0]), POINT, np.array([1.0, 0.0, 0.0]), among=target().among)
    ClearestApproachPlanner(inner).plan(FRAME, asked, HOME)
    ClearestApproachPlanner(inner).plan(FRAME, Target(asked.box, POINT), HOME)
    assert inner.asked[0] is asked.approach
    assert inner.asked[1] is None


def test_a_target_is_one_of_the_berries_it_is_among():
    with pytest.raises(ShapeError, match="none of id 7"):
        Target(np.array([0.0, 0.0, 5.0, 5.0]), POINT, berry_id=7, among=target().among)
