"""What a guard lets pass, what it refuses, and that a refused motion moves nothing."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import JointTrajectory, retime
from punnet.robot import HOME, Boxes, GuardedRobot, MotionGuard, MotionResult, Panda, Robot
from punnet.robot.arm_shape import arm_spheres, self_clearance, structure_clearance

ARM = Panda()
TURNED = HOME + np.array([0.3, 0.1, -0.1, 0.2, 0.1, -0.2, 0.3])
TABLE = Boxes(np.array([[-1.0, -1.0, -0.1]]), np.array([[1.0, 1.0, 0.0]]))


def reach(goal=TURNED, **options) -> JointTrajectory:
    return retime(np.stack((HOME, goal)), ARM.limits, **options)


class Recording:
    """A robot that is at home and remembers what it was told to do."""

    time = 0.0

    def __init__(self):
        self.followed = []

    def joints(self):
        return HOME.copy()

    def follow(self, trajectory, force_limit=None):
        self.followed.append((trajectory, force_limit))
        return MotionResult(True)

    def look(self): ...
    def separate(self, opening): ...
    def grip(self): ...
    def cut(self): ...
    def release(self, opening=1.0): ...
    def weigh_punnet(self, punnet): ...


def test_what_retiming_gives_passes_at_full_speed():
    robot = Recording()
    guarded = GuardedRobot(robot, MotionGuard(structure=TABLE))
    assert isinstance(guarded, Robot)
    trajectory = reach()
    assert guarded.follow(trajectory, 6.0).reached
    assert robot.followed == [(trajectory, 6.0)]


def faster(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    return trajectory.stretched(1.0 / factor)


def hot(trajectory: JointTrajectory) -> JointTrajectory:
    """One sample's velocity is out of the row: between the samples the arm would be jerked."""
    velocities = trajectory.velocities.copy()
    velocities[len(trajectory) // 2, 2] += 0.3
    return replace(trajectory, velocities=velocities)


def bare(trajectory: JointTrajectory) -> JointTrajectory:
    return JointTrajectory(trajectory.times, trajectory.positions)


def moving_at_the_end(trajectory: JointTrajectory) -> JointTrajectory:
    half = len(trajectory) // 2
    return JointTrajectory(
        trajectory.times[:half],
        trajectory.positions[:half],
        trajectory.velocities[:half],
        trajectory.accelerations[:half],
    )


def beyond(trajectory: JointTrajectory) -> JointTrajectory:
    positions = trajectory.positions.copy()
    positions[:, 3] += np.linspace(0.0, 3.0, len(positions))
    return replace(trajectory, positions=positions)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (faster(reach(), 1.5), "% of its limit"),
        (faster(reach(speed=0.5), 3.0), "of joint"),
        (hot(reach()), "acceleration of joint 3"),
        (bare(reach()), "no velocities"),
        (moving_at_the_end(reach()), "at rest"),
        (beyond(reach()), "joint 4 would go"),
        (retime(np.stack((TURNED, HOME)), ARM.limits), "from where the arm is"),
        (JointTrajectory(np.array([0.0, 1.0]), np.zeros((2, 6))), "6 joints"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_breaks_a_limit_moves_nothing(bad, words):
    robot = Recording()
    result = GuardedRobot(robot, MotionGuard()).follow(bad)
    assert not result.reached
    assert result.reason.startswith("unsafe: ")
    assert words in result.reason
    assert robot.followed == []


def test_an_arm_that_does_not_know_where_it_is_is_not_moved():
    robot = Recording()
    robot.joints = lambda: np.full(7, np.nan)
    assert "does not know" in GuardedRobot(robot, MotionGuard()).follow(reach()).reason


def test_into_the_table_is_refused_and_out_of_it_is_not():
    down = HOME + np.array([0.0, 1.5, 0.0, 0.2, 0.0, 0.0, 0.0])
    assert structure_clearance(ARM, down, TABLE) < 0 < structure_clearance(ARM, HOME, TABLE)
    guard = MotionGuard(structure=TABLE)
    into = retime(np.stack((HOME, down)), ARM.limits)
    assert "structure" in guard.refusal(into, HOME)
    assert MotionGuard().refusal(into, HOME) is None
    assert guard.refusal(retime(np.stack((down, HOME)), ARM.limits), down) is None


def test_into_itself_is_refused():
    folded = np.array([0.0, -1.6, 0.0, -3.0, 0.0, 0.3, 0.0])
    assert self_clearance(ARM, folded) < 0 < self_clearance(ARM, HOME)
    assert "itself" in MotionGuard().refusal(retime(np.stack((HOME, folded)), ARM.limits), HOME)


def test_distance_to_a_box_is_the_distance():
    centres, radii = arm_spheres(ARM, HOME)
    front = float((centres[:, 0] + radii).max())
    wall = Boxes(np.array([[front + 0.1, -2.0, -2.0]]), np.array([[front + 0.2, 2.0, 2.0]]))
    assert structure_clearance(ARM, HOME, wall) == pytest.approx(0.1, abs=1e-9)
    assert structure_clearance(ARM, np.stack((HOME, HOME)), Boxes.none()).tolist() == [np.inf, np.inf]


def test_impossible_boxes_and_guards_are_refused():
    with pytest.raises(ShapeError, match="lowest corner"):
        Boxes(np.ones((1, 3)), np.zeros((1, 3)))
    with pytest.raises(ShapeError, match="need"):
        Boxes(np.zeros((1, 3)), np.zeros((2, 3)))
    with pytest.raises(ConfigurationError, match="clearance"):
        MotionGuard(clearance=-0.1)
