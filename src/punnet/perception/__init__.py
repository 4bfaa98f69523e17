"""Finding berries in a frame: the detectors, their scores and pictures of what they found."""

from punnet.perception.choosing import load_detector
from punnet.perception.colour import ColourConfig, ColourDetector
from punnet.perception.detector import Detector
from punnet.perception.learned import LearnedDetector

__all__ = ["ColourConfig", "ColourDetector", "Detector", "LearnedDetector", "load_detector"]
