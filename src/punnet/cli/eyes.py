"""What ``--detector`` stands for, in every command that has it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from punnet.cli.console import note
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.perception import Detector

__all__ = ["detector_for_photographs", "perception_in_simulation"]


def detector_for_photographs(name: str | None, *, score: float | None = None) -> Detector:
    """The detector of that name, the one for photographs if None; what must not be done with it is said."""
    from punnet.perception import LearnedDetector, load_detector
    from punnet.perception.choosing import PHOTOGRAPH_DETECTOR

    detector = load_detector(name or PHOTOGRAPH_DETECTOR, score_threshold=score)
    if isinstance(detector, LearnedDetector) and detector.manifest.restriction:
        note(
            f"detector {detector.name}: {detector.manifest.restriction}; punnet models says what to cite. "
            "Others: --detector"
        )
    return detector


def perception_in_simulation(name: str | None, *, oracle: bool = False) -> str:
    """What a simulated harvest sees with: the truth, the detector of that name, or the one for the simulator.

    Raises
    ------
    ConfigurationError
        If both are asked for.
    """
    from punnet.harvest.scenario import ORACLE
    from punnet.perception.choosing import SIMULATION_DETECTOR

    if oracle and name is not None:
        raise ConfigurationError("--oracle takes the place of the detector; leave --detector out")
    return ORACLE if oracle else name or SIMULATION_DETECTOR
