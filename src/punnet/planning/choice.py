"""Ways of choosing a reach from what a planner offers, by name: what ``--choice`` takes."""

from __future__ import annotations

from collections.abc import Callable

from punnet.errors import ConfigurationError
from punnet.planning.clearest_approach import ClearestApproachPlanner
from punnet.planning.collision_aware import CollisionAwarePlanner
from punnet.planning.planner import Planner

__all__ = ["CHOICES", "DEFAULT_CHOICE", "with_choice"]


def _mean(planner: Planner) -> Planner:
    return planner


CHOICES: dict[str, Callable[[Planner], Planner]] = {
    "mean": _mean,
    "clearest": ClearestApproachPlanner,
    "collision-aware": CollisionAwarePlanner,
}
"""``mean``: the planner's own; ``clearest``: along the approach with most room; ``collision-aware``: of many the one that
costs least in the observed scene."""

DEFAULT_CHOICE = "collision-aware"


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
