"""Planners by name, and ways of choosing among the reaches that one offers: what ``--planner`` and ``--choice`` take."""

from __future__ import annotations

from collections.abc import Callable

from punnet.errors import ConfigurationError
from punnet.planning.clearest_approach import ClearestApproachPlanner
from punnet.planning.collision_aware import CollisionAwarePlanner
from punnet.planning.deep_promp import DeepProMPPlanner, FusedPlanner
from punnet.planning.planner import Planner
from punnet.planning.promp_depth import ProMPDepthPlanner

__all__ = ["CHOICES", "DEFAULT_CHOICE", "DEFAULT_PLANNER", "PLANNERS", "planner_by_name", "with_choice"]

PLANNERS: dict[str, Callable[..., Planner]] = {
    "promp-depth": ProMPDepthPlanner.from_bundle,
    "deep-promp": DeepProMPPlanner.from_bundle,
    "fused": FusedPlanner.from_bundle,
}
"""How each is made from a bundle, or from the one that comes along if none is given. ``promp-depth``: what all
demonstrations have in common, conditioned on the point that depth gives; ``deep-promp``: told from the photograph;
``fused``: told from the photograph, then conditioned on the point."""

DEFAULT_PLANNER = "promp-depth"


def _mean(planner: Planner) -> Planner:
    return planner


CHOICES: dict[str, Callable[[Planner], Planner]] = {
    "mean": _mean,
    "clearest": ClearestApproachPlanner,
    "collision-aware": CollisionAwarePlanner,
}
"""``mean``: the planner's own; ``clearest``: along the approach with most room; ``collision-aware``: of many the one that
costs least in the observed scene."""

DEFAULT_CHOICE = "clearest"


def planner_by_name(name: str, bundle: str | None = None) -> Planner:
    """Make a planner ready.

    Parameters
    ----------
    name
        One of :data:`PLANNERS`.
    bundle
        What it learnt: the name of a bundle that comes with the package, or a folder; None takes the planner's own.

    Raises
    ------
    ConfigurationError
        If there is no such planner.
    BundleError
        If the bundle is not there, damaged, or of another kind.
    """
    if name not in PLANNERS:
        raise ConfigurationError(f"planner: there is no '{name}'; there are {', '.join(PLANNERS)}")
    make = PLANNERS[name]
    return make() if bundle is None else make(bundle)


def with_choice(planner: Planner, choice: str) -> Planner:
    """A planner that chooses among the reaches of another one.

    Raises
    ------
    ConfigurationError
        If there is no such way of choosing.
    """
    if choice not in CHOICES:
        raise ConfigurationError(f"planner: no choice '{choice}'; there are {', '.join(CHOICES)}")
    return CHOICES[choice](planner)
