import pytest

from punnet.errors import ConfigurationError
from punnet.planning import ClearestApproachPlanner, Planner, ProMPDepthPlanner
from punnet.planning.choice import CHOICES, DEFAULT_CHOICE, with_choice


def test_every_choice_makes_a_planner():
    planner = ProMPDepthPlanner.from_bundle()
    assert all(isinstance(with_choice(planner, choice), Planner) for choice in CHOICES)
    assert with_choice(planner, "mean") is planner
    assert isinstance(with_choice(planner, "clearest"), ClearestApproachPlanner)
    assert DEFAULT_CHOICE in CHOICES


def test_an_unknown_choice_is_named():
    with pytest.raises(ConfigurationError, match=r"'best'.*mean"):
        with_choice(ProMPDepthPlanner.from_bundle(), "best")
