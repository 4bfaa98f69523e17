"""Frames that can be believed, and the berries in them."""

from __future__ import annotations

import numpy as np

from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.frame_checks import FrameChecks
from punnet.perception.detector import Detector
from punnet.perception.picking_points import locate_picking_points
from punnet.robot import Robot
from punnet.scene import Frame, Strawberries

__all__ = ["Eyes"]


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

    def perceive(self, frame: Frame) -> Strawberries:
        """The berries of a frame, located in space.

        Raises
        ------
        StepFailed
            If the detector fails.
        """
        try:
            berries = self._detector.detect(frame)
            if np.isnan(berries.picking_points).all():
                berries = locate_picking_points(frame, berries)
        except Exception as error:  # a stranger's detector may raise anything
            raise StepFailed(Failure.DETECTOR_FAULT, f"{type(error).__name__}: {error}") from error
        return berries
