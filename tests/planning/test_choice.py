import pytest

from punnet.errors import BundleError, ConfigurationError
from punnet.planning import ClearestApproachPlanner, Planner, ProMPDepthPlanner
from punnet.planning.choice import CHOICES, DEFAULT_CHOICE, DEFAULT_PLANNER, planner_by_name, with_choice


def test_every_choice_makes_a_planner():
    planner = ProMPDepthPlanner.from_bundle()
    assert all(isinstance(with_choice(planner, choice), Planner) for choice in CHOICES)
    assert with_choice(planner, "mean") is planner
    assert isinstance(with_choice(planner, "clearest"), ClearestApproachPlanner)
    assert DEFAULT_CHOICE in CHOICES


def test_an_unknown_choice_is_named():
    with pytest.raises(ConfigurationError, match=r"'best'.*mean"):
        with_choice(ProMPDepthPlanner.from_bundle(), "best")


def test_planners_by_name():
    assert isinstance(planner_by_name(DEFAULT_PLANNER), ProMPDepthPlanner)
    other = planner_by_name("promp-depth", "promp-reach-sim")
    assert other.name == "promp-depth"
    with pytest.raises(ConfigurationError, match=r"'rrt'.*promp-depth.*fused"):
        planner_by_name("rrt")
    with pytest.raises(BundleError, match="nowhere"):
        planner_by_name("deep-promp", "nowhere")
    with pytest.raises(BundleError, match="kind"):
        planner_by_name("fused", "promp-reach-sim")
