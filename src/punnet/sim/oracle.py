"""A detector and a scale that know the truth: they bound what perception costs."""

from __future__ import annotations

import numpy as np

from punnet.scene import Frame, Strawberries
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.truth import true_strawberries
from punnet.weight import WeightEstimates

__all__ = ["OracleDetector", "OracleScale"]


class OracleDetector:
    """Says what is in the frame that ``robot`` has just taken, picking points included."""

    name = "oracle"

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot

    def detect(self, frame: Frame) -> Strawberries:
        """The true berries of the robot's last frame."""
        return true_strawberries(self._robot.world, frame, self._robot.segment())


class OracleScale:
    """Passes on the true weights that :class:`OracleDetector` gives."""

    name = "oracle"

    def estimate(self, frame: Frame, berries: Strawberries) -> WeightEstimates:
        """The weights that ``berries`` carry."""
        reasons = tuple("no true weight" if np.isnan(grams) else None for grams in berries.weights)
        return WeightEstimates(berries.weights, berries.weight_intervals, reasons)
