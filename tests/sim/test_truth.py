import numpy as np
import pytest

from punnet.scene import KEYPOINTS, Visibility
from punnet.sim.oracle import OracleDetector, OracleScale
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.truth import PICKING_HEIGHT, true_picking_points, true_strawberries
from tests.sim.conftest import small_world


@pytest.fixture(scope="module")
def seen():
    robot = SimulatedRobot(small_world(), np.random.default_rng(0))
    frame = robot.look()
    yield robot, frame, true_strawberries(robot.world, frame, robot.segment())
    robot.close()


def test_masks_show_the_berries_and_nothing_twice(seen):
    robot, frame, berries = seen
    assert 1 <= len(berries) <= robot.world.berries
    assert berries.masks.sum(axis=0).max() == 1
    for berry in berries:
        red, green, blue = (frame.rgb[berry.masks[0], channel].mean() for channel in range(3))
        if berry.ripeness[0] >= 0.95:
            assert red > 1.5 * green
            assert red > 1.5 * blue


def test_boxes_hold_masks_and_keypoints(seen):
    _, _, berries = seen
    for berry in berries:
        x0, y0, x1, y1 = berry.boxes[0]
        v, u = np.nonzero(berry.masks[0])
        assert x0 <= u.min()
        assert u.max() <= x1
        assert y0 <= v.min()
        assert v.max() <= y1
        points = berry.keypoints[0][np.isfinite(berry.keypoints[0]).all(axis=1)]
        assert (points >= (x0, y0)).all()
        assert (points <= (x1, y1)).all()


def test_keypoints_stand_in_their_order(seen):
    _, _, berries = seen
    name = KEYPOINTS.index
    for points in berries.keypoints:
        assert points[name("picking_point"), 1] < points[name("top"), 1] < points[name("bottom"), 1]
        assert points[name("left_grasp"), 0] < points[name("right_grasp"), 0]


def test_grasp_points_of_a_berry_in_the_open_are_visible(seen):
    _, _, berries = seen
    grasp = [KEYPOINTS.index("left_grasp"), KEYPOINTS.index("right_grasp")]
    assert (berries.visibility[:, grasp] == Visibility.VISIBLE).mean() > 0.7


def test_weights_ripeness_and_points_are_the_worlds(seen):
    robot, _, berries = seen
    world = robot.world
    for row, index in enumerate(berries.ids):
        fruit = world.cluster.berries[index].berry
        assert berries.weights[row] == fruit.mass
        assert berries.pluckable[row] == fruit.stage.pluckable
    above = true_picking_points(world) - world.berry_poses()[:, :3, 3]
    assert np.allclose(np.linalg.norm(above, axis=1), PICKING_HEIGHT)


def test_the_oracle_says_the_truth(seen):
    robot, frame, berries = seen
    told = OracleDetector(robot).detect(frame)
    assert np.array_equal(told.ids, berries.ids)
    estimates = OracleScale().estimate(frame, told)
    assert np.array_equal(estimates.grams, berries.weights)
    assert estimates.reasons == (None,) * len(berries)
