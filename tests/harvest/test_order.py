import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.geometry import CameraIntrinsics
from punnet.harvest.config import HarvestConfig
from punnet.harvest.order import (
    ORDERS,
    cheapest_first,
    expected_seconds,
    front_first,
    hidden_shares,
    left_to_right,
    nearest_first,
    order_of,
)
from punnet.robot import HOME, T_FLANGE_CAMERA, Panda
from punnet.scene import Frame, Strawberries

CAMERA = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
POSE = Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA
FRAME = Frame(np.zeros((480, 640, 3), np.uint8), camera=CAMERA, T_base_camera=POSE)
MIDDLE = np.array([0.75, -0.06, 0.72])


def berries(*offsets, classes=None):
    """Berries of 30 by 40 mm whose picking points are offset from the middle, with the boxes the camera has of them."""
    points = MIDDLE + np.array(offsets, dtype=np.float64).reshape(-1, 3)
    local = (points - POSE[:3, 3]) @ POSE[:3, :3]
    u = CAMERA.fx * local[:, 0] / local[:, 2] + CAMERA.cx
    v = CAMERA.fy * local[:, 1] / local[:, 2] + CAMERA.cy
    half, length = CAMERA.fx * 0.015 / local[:, 2], CAMERA.fx * 0.055 / local[:, 2]
    boxes = np.column_stack((u - half, v, u + half, v + length))
    return Strawberries((480, 640), boxes, classes=classes, picking_points=points)


@pytest.mark.parametrize("name", ORDERS)
def test_every_ripe_berry_that_is_located_comes_once(name):
    scene = berries((0, 0.1, 0), (0, 0, 0), (0, -0.1, 0), (0.05, 0.05, 0), classes=np.array([0, 1, 0, 0]))
    points = scene.picking_points.copy()
    points[2] = np.nan
    rows = order_of(name)(FRAME, scene.with_fields(picking_points=points))
    assert sorted(rows) == [0, 3]
    assert len(order_of(name)(FRAME, Strawberries.empty((480, 640)))) == 0


def test_simple_orders_are_what_they_are_called():
    scene = berries((0.03, 0.1, 0.0), (0.0, -0.1, 0.0), (-0.03, 0.0, 0.0))
    assert list(left_to_right(FRAME, scene)) == [0, 2, 1]
    assert list(nearest_first(FRAME, scene)) == [2, 1, 0]
    sized = Strawberries(
        (480, 640), [[0, 0, 9, 9], [20, 0, 40, 30]], picking_points=MIDDLE + np.zeros((2, 3))
    )
    assert list(nearest_first(Frame(FRAME.rgb), sized)) == [1, 0]


@pytest.mark.parametrize("order", [cheapest_first, front_first])
def test_free_before_hemmed_in(order):
    # the second has a neighbour just in front of it and one on each side, both unripe
    scene = berries(
        (0, 0.15, 0),
        (0, -0.05, 0),
        (-0.03, -0.05, 0.0),
        (0, -0.03, 0.0),
        (0, -0.07, 0.0),
        classes=np.array([0, 0, 1, 1, 1]),
    )
    assert list(order(FRAME, scene)) == [0, 1]


@pytest.mark.parametrize("order", [cheapest_first, front_first])
def test_front_before_behind(order):
    assert list(order(FRAME, berries((0.05, -0.10, 0), (-0.03, 0.08, 0)))) == [1, 0]


def test_what_the_arm_cannot_get_to_comes_last():
    scene = berries((0.0, 0.03, 0.0), (0.0, 0.75, 0.0))
    seconds = expected_seconds(FRAME, scene, np.arange(2))
    assert seconds[1] > seconds[0]


def test_hidden_is_what_nearer_boxes_cover():
    boxes = [[0, 0, 10, 10], [5, 0, 15, 10], [100, 0, 110, 10]]
    depth = np.array([[0.8, 0, 0.7], [0.7, 0, 0.7], [0.6, 0, 0.7]])
    shares = hidden_shares(Strawberries((480, 640), boxes, picking_points=depth))
    np.testing.assert_allclose(shares, [0.5, 0.0, 0.0])


@settings(deadline=None, max_examples=25)
@given(st.lists(st.tuples(*[st.floats(-0.12, 0.12)] * 3), min_size=1, max_size=6))
def test_expected_seconds_are_positive_and_order_by_themselves(offsets):
    scene = berries(*offsets)
    rows = np.arange(len(scene))
    seconds = expected_seconds(FRAME, scene, rows)
    assert np.isfinite(seconds).all()
    assert (seconds >= 0).all()
    assert (np.diff(seconds[cheapest_first(FRAME, scene)]) >= 0).all()


def test_unknown_orders_are_named():
    with pytest.raises(ConfigurationError, match=r"'random'.*cheapest"):
        order_of("random")
    with pytest.raises(ConfigurationError, match="random"):
        HarvestConfig(order="random")


def test_what_hangs_behind_another_that_is_picked_waits_for_it():
    behind, before = (0.0, 0.0, 0.0), (-0.025, 0.004, 0.02)
    around = [
        (0.0, y, 0.0) for y in (-0.02, 0.02)
    ]  # unripe, on both sides: whichever side it comes from, it touches
    scene = berries(behind, before, *around, classes=np.array([0, 0, 1, 1]))
    assert list(front_first(FRAME, scene)) == [1, 0]
