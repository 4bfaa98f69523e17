"""The strip of pictures of one pick: the berry before, the reach as planned, and what the arm did."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import invert_transform, project, transform_points
from punnet.harvest.attempts import Attempt
from punnet.movement import TrajectoryDistribution
from punnet.robot import Arm
from punnet.scene import Frame
from punnet.scene.overlay import draw_overlay

__all__ = ["close_up", "encoded", "strip"]

SIZE = 240
"""Pixels of a picture's side."""
_CROP_MARGIN = 0.6  # of the box's longer side, on each side
_REACH_MARGIN = 1.7
_SAMPLES = 24
_PHASES = np.linspace(0.0, 1.0, 60)
_MEAN, _SAMPLE = (255, 255, 255), (255, 170, 60)
_QUALITY = 88


def strip(attempt: Attempt, close_ups: Mapping[str, NDArray[np.uint8]], arm: Arm) -> dict[str, bytes]:
    """JPEG pictures by caption, in the order in which things happened.

    Parameters
    ----------
    close_ups
        Pictures (H, W, 3) of what went on, by caption.
    arm
        That reaches.
    """
    box = attempt.berry.boxes[0]
    pictures = {"before": close_up(draw_overlay(attempt.frame.rgb, attempt.berry), box)}
    if attempt.distribution is not None and attempt.distribution.space == "joint":
        drawn = _with_reaches(attempt.frame, attempt.distribution, attempt.number, arm)
        if drawn is not None:
            pictures["planned: mean and samples"] = close_up(drawn, box, _REACH_MARGIN)
    return pictures | {caption: encoded(_resized(picture)) for caption, picture in close_ups.items()}


def close_up(picture: NDArray[np.uint8], box: NDArray[np.float64], margin: float = _CROP_MARGIN) -> bytes:
    """JPEG of a square around a box (4,), with ``margin`` of its longer side on each side; less where the picture ends."""
    size = np.array([picture.shape[1], picture.shape[0]])
    half = min((0.5 + margin) * float(np.max(box[2:] - box[:2])), float(size.min()) / 2.0)
    middle = np.clip((box[:2] + box[2:]) / 2.0, half, size - half)
    crop = cv2.getRectSubPix(
        picture, (round(2 * half), round(2 * half)), (float(middle[0]), float(middle[1]))
    )
    return encoded(_resized(crop.astype(np.uint8, copy=False)))


def encoded(rgb: NDArray[np.uint8]) -> bytes:
    """JPEG bytes of a picture (H, W, 3)."""
    return bytes(cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes())


def _with_reaches(
    frame: Frame, distribution: TrajectoryDistribution, seed: int, arm: Arm
) -> NDArray[np.uint8] | None:
    """The frame with the ways of the tool: samples of the distribution, and over them its mean; None without a camera."""
    if frame.camera is None or frame.T_base_camera is None:
        return None
    joints = distribution.sample(np.random.default_rng(seed), _SAMPLES, _PHASES)
    ways = arm.forward_kinematics_tool(np.concatenate((joints, distribution.mean(_PHASES)[None])))
    picture = frame.rgb.copy()
    T_camera_base = invert_transform(frame.T_base_camera)
    for number, way in enumerate(ways[..., :3, 3]):
        points = transform_points(T_camera_base, way)
        pixels = project(frame.camera, points[points[:, 2] > 0.05])
        line = np.rint(np.clip(pixels, -2000, 4000) * 16).astype(np.int32)[:, None]
        last = number == len(ways) - 1
        colour, width = (_MEAN, 2) if last else (_SAMPLE, 1)
        cv2.polylines(picture, [line], False, colour, width, cv2.LINE_AA, 4)
        if last and len(pixels):
            end = (round(float(pixels[-1, 0])), round(float(pixels[-1, 1])))
            cv2.circle(picture, end, 4, _MEAN, 2, cv2.LINE_AA)
    return picture


def _resized(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return cv2.resize(picture, (SIZE, SIZE), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
