"""Detectors by name: what ``--detector`` takes, and what is used without it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from punnet.perception.colour import ColourConfig, ColourDetector
from punnet.perception.detector import Detector
from punnet.perception.learned import LearnedDetector

__all__ = ["COLOUR", "PHOTOGRAPH_DETECTOR", "SIMULATION_DETECTOR", "load_detector"]

COLOUR = "colour"

SIMULATION_DETECTOR = "sim-fast"
"""What the simulator's harvests use unless told otherwise."""

PHOTOGRAPH_DETECTOR = "field-fast"
"""What photographs are searched with unless told otherwise."""


def load_detector(
    source: str | Path,
    *,
    score_threshold: float | None = None,
    colour: ColourConfig | None = None,
    threads: int | None = None,
) -> Detector:
    """Make a detector ready.

    Parameters
    ----------
    source
        ``colour`` for the classical baseline, the name of a bundle that comes with the package, or a bundle's folder.
    score_threshold
        Score from which detections are given; the detector's own if None.
    colour
        Settings of the baseline; not used by learned detectors.
    threads
        Cores for a learned detector; None takes ``OMP_NUM_THREADS``, or all cores if that is not set.

    Raises
    ------
    BundleError
        If there is no such bundle, or it is damaged or no detector.
    ConfigurationError
        If a setting is out of range.
    """
    if source != COLOUR:
        return LearnedDetector.from_bundle(source, threads=threads, score_threshold=score_threshold)
    config = colour or ColourConfig()
    if score_threshold is not None:
        config = replace(config, score=score_threshold)
    return ColourDetector(config)
