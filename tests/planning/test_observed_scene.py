import numpy as np
import pytest

from punnet.geometry import CameraIntrinsics
from punnet.planning.observed_scene import STEM_LENGTH, observe
from punnet.robot import HOME, T_FLANGE_CAMERA, Panda
from punnet.scene import Frame, Strawberries, Target

CAMERA = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
T_BASE_CAMERA = Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA
POINT = np.array([0.75, -0.06, 0.72])
RED, GREEN, GREY = (190, 30, 40), (60, 120, 50), (90, 90, 95)


def pixel(point):
    x, y, z = np.linalg.solve(T_BASE_CAMERA, np.append(point, 1.0))[:3]
    return CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy, z


class Painter:
    """A frame with balls and slabs before an empty view, and the masks of the balls."""

    def __init__(self):
        self.rgb = np.zeros((480, 640, 3), np.uint8)
        self.depth = np.zeros((480, 640), np.float32)
        self.v, self.u = np.mgrid[:480, :640]

    def ball(self, centre, radius, colour=RED):
        u, v, z = pixel(centre)
        inside = np.hypot(self.u - u, self.v - v) < CAMERA.fx * radius / z
        self.rgb[inside] = colour
        self.depth[inside] = z - 0.8 * radius
        return inside

    def slab(self, centre, half, colour):
        u, v, z = pixel(centre)
        inside = np.maximum(np.abs(self.u - u), np.abs(self.v - v)) < CAMERA.fx * half / z
        self.rgb[inside] = colour
        self.depth[inside] = z

    def frame(self):
        return Frame(self.rgb, self.depth, CAMERA, T_BASE_CAMERA)


def berries(masks, points):
    boxes = []
    for mask in masks:
        v, u = np.nonzero(mask)
        boxes.append((u.min(), v.min(), u.max() + 1, v.max() + 1))
    return Strawberries((480, 640), np.array(boxes), masks=np.array(masks), picking_points=np.array(points))


def seen(neighbour=(0.0, 0.06, -0.02), located=True, slabs=(), ripe=False):
    painter = Painter()
    own = painter.ball(POINT - (0.0, 0.0, 0.035), 0.015)
    middle = POINT + np.array(neighbour)
    other = painter.ball(middle, 0.016)
    for centre, colour in slabs:
        painter.slab(POINT + np.array(centre), 0.02, colour)
    above = middle + np.array([0.0, 0.0, 0.016 + 0.015])
    among = berries([own, other], [POINT, above if located else np.full(3, np.nan)])
    among = among.with_fields(classes=np.array([0, 0 if ripe else 1]))
    return middle, observe(painter.frame(), Target(among.boxes[0], POINT, berry_id=0, among=among))


@pytest.mark.parametrize("located", [True, False])
def test_a_neighbour_is_where_it_hangs_and_as_big_as_it_is(located):
    middle, scene = seen(located=located)
    assert (len(scene.fruit), len(scene.stems)) == (1, 2)
    centre = (scene.fruit.starts[0] + scene.fruit.ends[0]) / 2.0 + scene.origin
    np.testing.assert_allclose(centre, middle, atol=0.006)
    assert scene.fruit.radii[0] == pytest.approx(0.016, abs=0.002)


def test_what_stays_on_the_plant_is_cared_for_most():
    assert seen()[1].care[0] == 1.0
    assert 0.0 < seen(ripe=True)[1].care[0] < 1.0


def test_a_stem_hangs_above_its_calyx():
    middle, scene = seen()
    root, end = scene.stems.starts[0] + scene.origin, scene.stems.ends[0] + scene.origin
    np.testing.assert_allclose(root, middle + np.array([0.0, 0.0, 0.016]), atol=0.005)
    np.testing.assert_allclose(scene.stems.starts[1] + scene.origin, end)
    np.testing.assert_allclose(scene.stems.ends[1] + scene.origin - root, (0.0, 0.0, STEM_LENGTH), atol=1e-9)
    assert scene.stems.radii[1] > 2.0 * scene.stems.radii[0]  # higher up nobody knows so well where it is


def test_the_target_itself_and_what_is_far_away_do_not_count():
    _, scene = seen(neighbour=(0.45, 0.05, 0.0))
    assert len(scene.fruit) == 0
    assert not scene.soft_at(np.array([0.0, 0.0, -0.035]))
    assert not scene.hard_at(np.array([0.0, 0.0, -0.035]))


def test_leaves_are_soft_and_pipes_are_hard():
    leaf, pipe = (0.05, -0.08, 0.05), (0.05, 0.10, 0.08)
    _, scene = seen(slabs=((leaf, GREEN), (pipe, GREY)))
    assert scene.soft_at(np.array(leaf))
    assert not scene.hard_at(np.array(leaf))
    assert scene.hard_at(np.array(pipe))
    assert not scene.soft_at(np.array(pipe))
    assert not scene.soft_at(np.array([-0.1, 0.0, 0.0]))
    assert not scene.hard_at(np.array([5.0, 0.0, 0.0]))


def test_below_the_table_is_hard():
    _, scene = seen()
    assert scene.hard_at(np.array([0.0, 0.0, -POINT[2] - 0.01]))
    assert not scene.hard_at(np.array([0.0, 0.0, -POINT[2] + 0.02]))


def test_without_depth_there_are_berries_by_their_picking_points():
    among = Strawberries(
        (480, 640),
        np.array([[0.0, 0.0, 9.0, 9.0]] * 3),
        picking_points=np.array([POINT, POINT + 0.05, [np.nan] * 3]),
    )
    frame = Frame(np.zeros((480, 640, 3), np.uint8))
    scene = observe(frame, Target(among.boxes[0], POINT, berry_id=0, among=among))
    assert len(scene.fruit) == 1
    assert len(scene.soft) == len(scene.hard) == 0
    alone = observe(frame, Target(among.boxes[0], POINT))
    assert len(alone.fruit) == len(alone.stems) == 0
