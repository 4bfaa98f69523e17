"""One true pick, end to end, with the picker's real physics; then what must not work."""

import mujoco
import numpy as np
import pytest

from punnet.errors import RobotError
from punnet.geometry import invert_transform
from punnet.harvest.config import HarvestConfig
from punnet.harvest.motions import Motions
from punnet.harvest.punnets import slot_offset
from punnet.movement import JointTrajectory, retime
from punnet.planning import ProMPDepthPlanner
from punnet.robot import (
    GRIP_OPENING,
    HOME,
    NOT_ALONE,
    T_FLANGE_TOOL,
    TOO_THICK,
    GuardedRobot,
    MotionGuard,
    Panda,
    Robot,
    nearest_solution,
)
from punnet.robot.tool import T_FLANGE_CAMERA
from punnet.scene import Frame, Target
from punnet.sim.punnets import PUNNET_PLACES, inside_punnet
from punnet.sim.simulated_robot import WRIST_CAMERA, SimulatedRobot
from punnet.sim.truth import true_picking_points
from tests.sim.conftest import small_world

ARM = Panda()
NOTHING = Frame(np.zeros((8, 8, 3), dtype=np.uint8))


@pytest.fixture
def robot():
    with_noise = SimulatedRobot(small_world(5), np.random.default_rng(0))
    yield with_noise
    with_noise.close()


def reach(robot, point):
    plan = ProMPDepthPlanner.from_bundle().plan(NOTHING, Target(np.zeros(4), point), robot.joints())
    path = plan.mean(np.linspace(0, 1, 100))
    path[0] = robot.joints()
    return robot.follow(retime(path, ARM.limits, speed=0.6))


def in_front(robot):
    """The berry that hangs nearest to the robot: nothing is in the way to it."""
    return int(np.argmin(true_picking_points(robot.world)[:, 0]))


def test_it_is_a_robot(robot):
    assert isinstance(robot, Robot)


def test_reach_grip_cut_and_carry(robot):
    world, berry = robot.world, in_front(robot)
    point = true_picking_points(world)[berry]
    moved = reach(robot, point)
    assert moved.reached, moved.reason
    tool = ARM.forward_kinematics_tool(robot.joints())[:3, 3]
    assert np.linalg.norm(tool - point) < 0.003
    robot.separate(1.0)
    grip = robot.grip()
    assert grip.holding
    assert robot.gripped() == {berry}
    assert robot.cut().cut
    assert list(np.flatnonzero(~world.attached())) == [berry]
    pushed = world.model.body("grasp_left").id
    sideways = world.data.xmat[pushed].reshape(3, 3)[:, 1]
    world.data.xfrc_applied[pushed, :3] = -5.0 * sideways  # as a leaf between the fingers does
    for _ in range(100):
        world.step()
    world.data.xfrc_applied[pushed] = 0.0
    assert robot.gripped() == {berry}
    back = np.stack((robot.joints(), HOME))
    assert robot.follow(retime(back, ARM.limits, speed=0.6)).reached
    assert robot.gripped() == {berry}
    held = world.berry_poses()[berry][:3, 3]
    tool = ARM.forward_kinematics_tool(robot.joints())[:3, 3]
    assert np.linalg.norm(held - tool) < 0.03
    motions = Motions(GuardedRobot(robot, MotionGuard()), ARM, PUNNET_PLACES, HarvestConfig())
    assert motions.carry(1, 2).reached
    fruit = world.data.geom_xpos[world.model.geom(world.planted[berry].fruit).id]
    place = PUNNET_PLACES[1] + (*slot_offset(2), 0.0)
    assert np.linalg.norm((fruit - place)[:2]) < 0.006
    before = world.contacts.peak_on_berry[berry]
    assert motions.leave_punnet().reached
    assert inside_punnet(world.berry_poses()[berry][:3, 3]) == 1
    assert world.contacts.peak_on_berry[berry] < max(before, 6.0)


def test_cutting_air_says_so(robot):
    assert not robot.grip().holding
    result = robot.cut()
    assert not result.cut
    assert "no stem" in result.reason
    assert robot.world.attached().all()


def test_gripped_too_low_it_is_not_cut(robot):
    berry = in_front(robot)
    T = robot.world.berry_poses()[berry]
    assert reach(robot, T[:3, 3] + 0.029 * T[:3, 2]).reached
    robot.grip()
    result = robot.cut()
    assert not result.cut
    assert "mm above the calyx" in result.reason


def test_a_fruit_between_the_pads_is_let_go_of_unharmed(robot):
    berry = in_front(robot)
    T = robot.world.berry_poses()[berry]
    assert reach(robot, T[:3, 3] - 0.010 * T[:3, 2]).reached
    before = robot.world.contacts.peak_on_berry[berry]
    grip = robot.grip()
    assert (grip.holding, grip.reason) == (False, TOO_THICK)
    assert grip.opening > 0.010
    assert robot.world.contacts.peak_on_berry[berry] < max(before, 3.0)


def held_apart(robot, newtons):
    """From now on something pushes each pad outwards with so much where they are less than 5 mm apart."""

    def push(world):
        for name, side in (("grasp_left", -1.0), ("grasp_right", 1.0)):
            finger = world.model.body(name).id
            outwards = side * world.data.xmat[finger].reshape(3, 3)[:, 1]
            world.data.xfrc_applied[finger, :3] = newtons * outwards * (robot._pad_gap() < 0.005)

    robot.observers.append(push)


@pytest.mark.parametrize(("newtons", "reason"), [(1.5, None), (6.0, NOT_ALONE)])
def test_a_leaf_beside_the_stem_is_pressed_aside_if_it_gives_way(robot, newtons, reason):
    berry = in_front(robot)
    assert reach(robot, true_picking_points(robot.world)[berry]).reached
    held_apart(robot, newtons)
    grip = robot.grip()
    assert (grip.holding, grip.reason) == (reason is None, reason)
    assert (berry in robot.gripped()) == grip.holding


def test_what_is_thicker_than_a_stem_is_let_go_of(robot):
    world, berry = robot.world, in_front(robot)
    for name in world.planted[berry].stub:  # as thick as a stem with a leaf beside it
        world.model.geom(name).size[0] = 0.0025
    robot.release(0.6)
    assert reach(robot, true_picking_points(world)[berry]).reached
    grip = robot.grip()
    assert (grip.holding, grip.reason) == (False, NOT_ALONE)
    assert grip.opening > 0.0025
    assert not robot.gripped()
    assert robot._pad_gap() == pytest.approx(2 * 0.6 * GRIP_OPENING, abs=0.001)  # as wide as before


def test_the_fingers_open_as_far_as_they_are_told(robot):
    for opening in (1.0, 0.5, 0.0, 0.5):
        robot.release(opening)
        assert robot._pad_gap() == pytest.approx(2 * opening * GRIP_OPENING, abs=0.001)


def test_the_camera_sits_where_kinematics_says(robot):
    data = robot.world.data
    camera = robot.world.model.camera("wrist").id
    assert np.allclose(robot.camera_pose()[:3, 3], data.cam_xpos[camera], atol=1e-3)
    assert np.allclose(robot.camera_pose(), ARM.forward_kinematics(robot.joints()) @ T_FLANGE_CAMERA)
    frame = robot.look()
    assert (frame.width, frame.height) == (WRIST_CAMERA.width, WRIST_CAMERA.height)
    assert np.median(frame.depth[frame.depth > 0]) > 0.2


def test_the_arm_follows_what_it_is_given(robot):
    goal = HOME + np.array([0.2, 0.1, -0.1, 0.2, 0.1, -0.2, 0.3])
    result = robot.follow(retime(np.stack((robot.joints(), goal)), ARM.limits))
    assert result.reached
    assert np.abs(robot.joints() - goal).max() < 0.005


def test_a_trajectory_from_elsewhere_is_refused(robot):
    elsewhere = JointTrajectory(np.array([0.0, 1.0]), np.stack((HOME + 0.2, HOME)))
    with pytest.raises(RobotError, match="starts more than"):
        robot.follow(elsewhere)


def test_an_arm_that_runs_into_the_table_stops(robot):
    T = ARM.forward_kinematics(robot.joints())
    down = T.copy()
    down[2, 3] = -0.05
    down[:3, :3] = T[:3, :3]
    down[:3, 3] = (0.35, 0.0, 0.02)
    goal = nearest_solution(down, HOME, arm=ARM)
    result = robot.follow(retime(np.stack((robot.joints(), goal)), ARM.limits, speed=0.5))
    assert not result.reached
    assert "structure" in result.reason or "held up" in result.reason


def test_a_reach_that_pushes_a_fruit_stops_before_it_bruises(robot):
    world, berry = robot.world, in_front(robot)
    T = world.berry_poses()[berry]
    middle = T[:3, 3] - 0.02 * T[:3, 2] + np.array([0.03, 0.0, 0.0])  # straight through the fruit
    plan = ProMPDepthPlanner.from_bundle().plan(NOTHING, Target(np.zeros(4), middle), robot.joints())
    path = plan.mean(np.linspace(0, 1, 100))
    path[0] = robot.joints()
    result = robot.follow(retime(path, ARM.limits, speed=0.5), force_limit=0.5)
    assert not result.reached
    assert result.reason.startswith("pushed a fruit: with ")
    assert result.peak_force < 10.0
    assert np.abs(robot.world.data.qvel[:7]).max() < 0.1


def test_an_arm_that_is_too_fast_is_stopped(robot):
    robot._arm = Panda(limits=ARM.limits.slowed(0.3))
    result = robot.follow(retime(np.stack((robot.joints(), HOME + 0.3)), ARM.limits))
    assert result.reason.startswith("too fast: joint ")


def test_the_weigh_cell_weighs_what_lies_in_the_punnet(robot):
    world, berry = robot.world, in_front(robot)
    assert abs(robot.weigh_punnet(0)) < 1.0
    world.detach(berry)
    address = int(world.model.joint(world.planted[berry].body).qposadr[0])
    world.data.qpos[address : address + 3] = PUNNET_PLACES[0] + (0.0, 0.0, 0.06)
    mujoco.mj_forward(world.model, world.data)
    mass = world.cluster.berries[berry].berry.mass
    assert robot.weigh_punnet(0) == pytest.approx(mass, abs=1.0)
    with pytest.raises(RobotError, match="punnets 0"):
        robot.weigh_punnet(9)


def test_flange_and_tool_agree():
    T = ARM.forward_kinematics(HOME)
    assert np.allclose(ARM.forward_kinematics_tool(HOME) @ invert_transform(T_FLANGE_TOOL), T)
