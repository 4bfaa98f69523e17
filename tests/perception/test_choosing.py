"""Detectors by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from punnet.bundle import list_bundles
from punnet.errors import BundleError
from punnet.perception import ColourConfig, ColourDetector, LearnedDetector, load_detector
from punnet.perception.choosing import COLOUR, PHOTOGRAPH_DETECTOR, SIMULATION_DETECTOR
from tests.perception.toy_detector import write_toy_bundle


def test_colour_is_the_baseline_with_its_settings() -> None:
    detector = load_detector("colour", score_threshold=0.4, colour=ColourConfig(ripe=0.8))
    assert isinstance(detector, ColourDetector)
    assert detector.config == ColourConfig(ripe=0.8, score=0.4)
    plain = load_detector("colour")
    assert isinstance(plain, ColourDetector)
    assert plain.config == ColourConfig()


def test_a_folder_is_a_learned_detector(tmp_path: Path) -> None:
    folder = write_toy_bundle(tmp_path / "mine", name="mine")
    for source in (folder, str(folder)):
        detector = load_detector(source, score_threshold=0.7)
        assert isinstance(detector, LearnedDetector)
        assert (detector.name, detector.score_threshold) == ("mine", 0.7)


def test_an_unknown_name_says_what_there_is() -> None:
    with pytest.raises(BundleError, match=r"sim-slow: neither a folder nor a bundle.*promp-reach-sim"):
        load_detector("sim-slow")


@pytest.mark.parametrize("name", [SIMULATION_DETECTOR, PHOTOGRAPH_DETECTOR])
def test_the_defaults_can_be_had(name: str) -> None:
    assert load_detector(name).name == name


def test_every_shipped_detector_loads() -> None:
    for manifest in list_bundles():
        if manifest.kind == "detector":
            assert load_detector(manifest.name).name == manifest.name
            assert manifest.name != COLOUR
