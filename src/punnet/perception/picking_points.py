"""From key-points and depth to the point on the stem, in the robot's base frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import back_project, transform_points
from punnet.scene import KEYPOINTS, Frame, Strawberries
from punnet.scene.windows import mask_window

__all__ = ["PICKING_HEIGHT", "berry_axis_depth", "locate_picking_points"]

PICKING_HEIGHT = 0.014
"""Metres above the calyx, along the fruit's axis, at which the stem is gripped; the blade runs 6 mm higher."""

_PICKING_POINT, _TOP, _BOTTOM, _LEFT, _RIGHT = (
    KEYPOINTS.index(name) for name in ("picking_point", "top", "bottom", "left_grasp", "right_grasp")
)
_LEAST_READINGS = 20
_SURFACE_TO_AXIS = 0.87
"""Of half the width: how far the axis lies behind the median of what is seen of the surface.

0.71 for a ball that is all seen, 0.78 without its rim, where depth bleeds; the rest since outlines and key-points are read
a tenth too narrow. Fitted on 197 ripe berries of plants of seed 510 (suites occluded, clustered and thesis)."""
_LEAST_LEVEL = 0.5  # cosine of the steepest pitch at which upright planes are used
_LARGEST_HALF_DEPTH = 0.025  # metres; a mask that is wider than any berry must not push the point away


def locate_picking_points(frame: Frame, berries: Strawberries) -> Strawberries:
    """Fill in ``picking_points`` (N, 3), metres in the base frame; NaN where depth or the key-point is missing.

    The stem is too thin for the depth camera. The fruit's axis is taken to lie in the upright plane through its middle
    that faces the camera: top and bottom are where their lines of sight meet it, and the stem is gripped
    :data:`PICKING_HEIGHT` above the top along that axis. The calyx is located several times as closely as a point on a
    bare stem, so the picking point's own line of sight is used only where top or bottom is unknown.

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
            depth = berry_axis_depth(frame, mask, berries.keypoints[index])
            if np.isfinite(depth):
                window = mask_window(mask, 0)
                v, u = np.nonzero(mask[window])
                centre = u.mean() + window[1].start, v.mean() + window[0].start
                middle = back_project(frame.camera, centre, np.asarray(depth))
                sights = back_project(frame.camera, berries.keypoints[index], np.full(len(KEYPOINTS), depth))
                points[index] = _picking_point(frame.T_base_camera, sights, middle)
    return berries.with_fields(picking_points=points)


def _picking_point(
    T_base_camera: NDArray[np.float64], sights: NDArray[np.float64], middle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Point (3,) on the stem, from what lies on the key-points' lines of sight (5, 3) in the camera frame."""
    top, bottom = (_on_upright_plane(T_base_camera, sights[which], middle) for which in (_TOP, _BOTTOM))
    length = float(np.linalg.norm(top - bottom))
    if not length > 0.0:  # NaN where one of them is unknown
        return _on_upright_plane(T_base_camera, sights[_PICKING_POINT], middle)
    return np.asarray(top + PICKING_HEIGHT * (top - bottom) / length)


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


def berry_axis_depth(
    frame: Frame, mask: NDArray[np.bool_], keypoints: NDArray[np.float64] | None = None
) -> float:
    """Depth of a fruit's axis in metres: its surface plus a share of half its thickness; NaN with too few readings.

    A berry is about as thick as it is wide. The width is that of the mask (H, W), or the distance of the grasp points
    among the ``keypoints`` (5, 2) if that is larger: a mask is narrower where something hides the fruit. The surface is
    the median of the mask's readings: of those in front some are of what hides it.
    """
    if frame.depth is None or frame.camera is None:
        return float("nan")
    window = mask_window(mask, 2)
    mask, readings = mask[window], frame.depth[window]
    if not mask.size:
        return float("nan")
    core = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(np.bool_)
    readings = readings[core & (readings > 0)]
    if len(readings) < _LEAST_READINGS:
        return float("nan")
    surface = float(np.median(readings))
    # Of an ellipse, area / length · 4/π is the width across the longest extent, whatever way it points.
    _, (first, second), _ = cv2.minAreaRect(np.argwhere(mask)[:, ::-1].astype(np.float32))
    width_px = float(np.count_nonzero(mask)) / max(first, second, 1.0) * 4.0 / np.pi
    if keypoints is not None:
        width_px = float(np.fmax(width_px, np.linalg.norm(keypoints[_LEFT] - keypoints[_RIGHT])))
    half_width = width_px / 2.0 * surface / frame.camera.fx
    return surface + _SURFACE_TO_AXIS * min(half_width, _LARGEST_HALF_DEPTH)
