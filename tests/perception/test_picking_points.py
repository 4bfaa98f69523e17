"""Against the simulator, which knows where the stems are."""

import numpy as np
import pytest

from punnet.geometry import CameraIntrinsics
from punnet.perception.picking_points import berry_axis_depth, locate_picking_points
from punnet.scene import Frame, Strawberries
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.truth import true_strawberries
from punnet.sim.world import WorldConfig, build_world

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)


def test_true_masks_and_keypoints_give_the_point_within_millimetres():
    robot = SimulatedRobot(build_world(11, WorldConfig(arm_visuals=False)), np.random.default_rng(0))
    frame = robot.look()
    truth = true_strawberries(robot.world, frame, robot.segment())
    robot.close()
    whole = truth[truth.masks.sum(axis=(1, 2)) > 1200]
    found = locate_picking_points(frame, whole).picking_points
    error = np.linalg.norm(found - whole.picking_points, axis=1)
    assert len(error) >= 3
    assert np.median(error) < 0.004
    assert error.max() < 0.012


def a_ball(depth, radius=0.018, pitch=0.0):
    """A ball straight ahead of a camera that is pitched down by ``pitch``."""
    v, u = np.mgrid[:160, :200]
    rays = np.stack(
        ((u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones_like(u, dtype=float)), -1
    )
    a, b, c = (rays**2).sum(-1), -2 * rays[..., 2] * depth, depth**2 - radius**2
    inside = b**2 - 4 * a * c
    image = np.where(inside > 0, (-b - np.sqrt(np.maximum(inside, 0))) / (2 * a), 0.0)
    T = np.eye(4)
    T[:3, :3] = [
        [0, -np.sin(pitch), np.cos(pitch)],
        [-1, 0, 0],
        [0, -np.cos(pitch), -np.sin(pitch)],
    ]
    return Frame(np.zeros((160, 200, 3), np.uint8), image.astype(np.float32), CAMERA, T), image > 0


@pytest.mark.parametrize("depth", [0.25, 0.4, 0.6])
def test_the_axis_of_a_ball_runs_through_its_middle(depth):
    frame, mask = a_ball(depth)
    assert berry_axis_depth(frame, mask) == pytest.approx(depth, abs=0.002)


def test_what_hides_half_of_a_ball_does_not_bring_its_axis_nearer():
    frame, mask = a_ball(0.4)
    radius = 0.018 / 0.4 * CAMERA.fx
    middle = np.array((CAMERA.cx, CAMERA.cy))
    keypoints = np.tile(middle, (5, 1))
    keypoints[3:, 0] += (-radius, radius)
    shown = mask & (np.arange(200) > CAMERA.cx)
    shown[:, 100:104] = mask[:, 100:104]
    frame.depth[:, 100:104] = 0.34  # a leaf's edge bleeds into the outline
    assert berry_axis_depth(frame, shown, keypoints) == pytest.approx(0.4, abs=0.003)
    assert berry_axis_depth(frame, shown) < 0.396


@pytest.mark.parametrize("pitch", [0.0, 0.25, 0.5])
def test_the_stem_rises_plumb_whatever_the_pitch(pitch):
    frame, mask = a_ball(0.4, pitch=pitch)
    above = np.array([0.0, 0.0, 0.035])
    middle = frame.T_base_camera[:3, :3] @ (0, 0, 0.4)
    seen = frame.T_base_camera[:3, :3].T @ (middle + above)
    pixel = seen[:2] / seen[2] * CAMERA.fx + (CAMERA.cx, CAMERA.cy)
    keypoints = np.full((1, 5, 2), np.nan)
    keypoints[0, 0] = pixel
    berry = Strawberries(
        (160, 200), [[0, 0, 10, 10]], masks=mask[None], keypoints=keypoints, visibility=np.full((1, 5), 2)
    )
    point = locate_picking_points(frame, berry).picking_points[0]
    assert np.linalg.norm(point - (middle + above)) < 0.003


def test_without_depth_camera_or_enough_readings_the_point_is_unknown():
    frame, mask = a_ball(0.4)
    keypoints = np.full((1, 5, 2), 50.0)
    berry = Strawberries(
        (160, 200), [[0, 0, 10, 10]], masks=mask[None], keypoints=keypoints, visibility=np.full((1, 5), 2)
    )
    blind = Frame(frame.rgb, np.zeros_like(frame.depth), CAMERA, frame.T_base_camera)
    for poor in (Frame(frame.rgb), blind, Frame(frame.rgb, frame.depth, CAMERA)):
        assert np.isnan(locate_picking_points(poor, berry).picking_points).all()
    bare = Strawberries((160, 200), [[0, 0, 10, 10]])
    assert np.isnan(locate_picking_points(frame, bare).picking_points).all()
