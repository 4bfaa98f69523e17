"""From key-points and depth to the point on the stem, in the robot's base frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import back_project, transform_points
from punnet.scene import KEYPOINTS, Frame, Strawberries

__all__ = ["berry_axis_depth", "locate_picking_points"]

_PICKING_POINT = KEYPOINTS.index("picking_point")
_LEAST_READINGS = 20
_FRONT_PERCENTILE = 10.0
_LEAST_LEVEL = 0.5  # cosine of the steepest pitch at which upright planes are used
_LARGEST_HALF_DEPTH = 0.025  # metres; a mask that is wider than any berry must not push the point away


def locate_picking_points(frame: Frame, berries: Strawberries) -> Strawberries:
    """Fill in ``picking_points`` (N, 3), metres in the base frame; NaN where depth or the key-point is missing.

    The stem is too thin for the depth camera. It is taken to rise plumb from the middle of the fruit: the picking
    point is where the key-point's line of sight meets the upright plane through that middle which faces the camera.

    Parameters
    ----------
    frame
        With depth, camera and ``T_base_camera``; without any of them all points stay unknown.
    berries
        With masks and key-points.
    """
    points = np.full((len(berries), 3), np.nan)
    if (
        frame.depth is not None
        and frame.camera is not None
        and frame.T_base_camera is not None
        and berries.masks is not None
        and berries.keypoints is not None
    ):
        for index in range(len(berries)):
            mask = berries.masks[index]
            pixel = berries.keypoints[index, _PICKING_POINT]
            depth = berry_axis_depth(frame, mask)
            if np.isfinite(depth) and np.isfinite(pixel).all():
                v, u = np.nonzero(mask)
                middle = back_project(frame.camera, (u.mean(), v.mean()), np.asarray(depth))
                sight = back_project(frame.camera, pixel, np.asarray(depth))
                points[index] = _on_upright_plane(frame.T_base_camera, sight, middle)
    return berries.with_fields(picking_points=points)


def _on_upright_plane(
    T_base_camera: NDArray[np.float64], sight: NDArray[np.float64], middle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Point (3,) in the base frame where the line of sight meets the upright plane through ``middle``.

    ``sight`` and ``middle`` are (3,) in the camera frame. A camera that looks steeply up or down sees no upright plane:
    then it is the point at the middle's depth, which ``sight`` already is.
    """
    camera = T_base_camera[:3, 3]
    facing = T_base_camera[:2, 2]
    ray = transform_points(T_base_camera, sight) - camera
    if np.linalg.norm(facing) < _LEAST_LEVEL:
        return np.asarray(camera + ray)
    offset = transform_points(T_base_camera, middle) - camera
    return np.asarray(camera + ray * float(facing @ offset[:2]) / float(facing @ ray[:2]))


def berry_axis_depth(frame: Frame, mask: NDArray[np.bool_]) -> float:
    """Depth of a fruit's axis in metres: its nearest surface plus half its thickness; NaN with too few readings.

    A berry is about as thick as it is wide, so half the thickness is half the metric width of the mask.
    """
    if frame.depth is None or frame.camera is None:
        return float("nan")
    core = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(np.bool_)
    readings = frame.depth[core & (frame.depth > 0)]
    if len(readings) < _LEAST_READINGS:
        return float("nan")
    front = float(np.percentile(readings, _FRONT_PERCENTILE))
    # Of an ellipse, area / length · 4/π is the width across the longest extent, whatever way it points.
    _, (first, second), _ = cv2.minAreaRect(np.argwhere(mask)[:, ::-1].astype(np.float32))
    width_px = float(np.count_nonzero(mask)) / max(first, second, 1.0) * 4.0 / np.pi
    half_width = width_px / 2.0 * front / frame.camera.fx
    return front + min(half_width, _LARGEST_HALF_DEPTH)
