"""Frames that can be believed, and the berries in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import invert_transform, project, transform_points
from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.frame_checks import FrameChecks
from punnet.perception.detector import Detector, RegionDetector
from punnet.perception.picking_points import locate_picking_points
from punnet.robot import Robot
from punnet.scene import Frame, Strawberries

__all__ = ["Eyes", "region_around", "region_of"]

_AROUND_BERRY = np.array([[-0.05, -0.04], [0.05, 0.08]])
"""Metres right and down from the picking point: what is looked at of a berry that hangs there, and its neighbours."""
_MARGIN = 0.1  # of the image's longest side: what may be about to be seen beside the berries seen before


class Eyes:
    """Camera and detector of a harvest; whatever they raise is a failure with a name."""

    def __init__(self, robot: Robot, detector: Detector) -> None:
        self._robot = robot
        self._detector = detector
        self._checks = FrameChecks()

    def look(self) -> Frame:
        """A frame of what the camera sees now.

        Raises
        ------
        StepFailed
            If there is none, or it is late, frozen, torn or without depth.
        """
        asked = self._robot.time
        try:
            frame = self._robot.look()
        except Exception as error:  # whatever a camera's driver raises
            raise StepFailed(Failure.NO_FRAME, f"{type(error).__name__}: {error}") from error
        self._checks.check(frame, asked)
        return frame

    def perceive(self, frame: Frame, region: NDArray[np.float64] | None = None) -> Strawberries:
        """The berries of a frame, located in space; where that saves time, only those in ``region`` (4,), xyxy pixels.

        Raises
        ------
        StepFailed
            If the detector fails.
        """
        try:
            if region is not None and isinstance(self._detector, RegionDetector):
                berries = self._detector.detect_in(frame, region)
            else:
                berries = self._detector.detect(frame)
            if np.isnan(berries.picking_points).all():
                berries = locate_picking_points(frame, berries)
        except Exception as error:  # a stranger's detector may raise anything
            raise StepFailed(Failure.DETECTOR_FAULT, f"{type(error).__name__}: {error}") from error
        return berries


def region_around(frame: Frame, point: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Region (4,), xyxy pixels, in which a berry shows that hangs from ``point`` (3,); None if the frame can't tell."""
    if frame.camera is None or frame.T_base_camera is None:
        return None
    seen = transform_points(invert_transform(frame.T_base_camera), point)
    corner = project(frame.camera, seen)
    if not np.isfinite(corner).all():
        return None
    focal = np.array([frame.camera.fx, frame.camera.fy])
    return np.asarray((corner + _AROUND_BERRY * focal / seen[2]).ravel())


def region_of(berries: Strawberries) -> NDArray[np.float64]:
    """Region (4,), xyxy pixels, of all berries, and a tenth of the image around."""
    margin = _MARGIN * max(berries.image_size)
    return np.concatenate(
        (berries.boxes[:, :2].min(axis=0) - margin, berries.boxes[:, 2:].max(axis=0) + margin)
    )
