"""Finding berries in a frame: the detectors, their scores and pictures of what they found."""

from punnet.perception.colour import ColourConfig, ColourDetector
from punnet.perception.detector import Detector

__all__ = ["ColourConfig", "ColourDetector", "Detector"]
