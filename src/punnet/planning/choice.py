"""Ways of choosing a reach from what a planner offers, by name: what ``--choice`` takes."""

from __future__ import annotations

from collections.abc import Callable

from punnet.errors import ConfigurationError
from punnet.planning.clearest_approach import ClearestApproachPlanner
from punnet.planning.collision_aware import CollisionAwarePlanner
from punnet.planning.planner import Planner
from punnet.robot import Arm, Panda

__all__ = ["CHOICES", "DEFAULT_CHOICE", "with_choice"]


def _mean(planner: Planner, arm: Arm) -> Planner:
    return planner


def _clearest(planner: Planner, arm: Arm) -> Planner:
    return ClearestApproachPlanner(planner)


CHOICES: dict[str, Callable[[Planner, Arm], Planner]] = {
    "mean": _mean,
    "clearest": _clearest,
    "collision-aware": CollisionAwarePlanner,
}
"""``mean``: the planner's own; ``clearest``: along the approach with most room; ``collision-aware``: of many the one that
costs least in the observed scene."""

DEFAULT_CHOICE = "collision-aware"


def with_choice(planner: Planner, choice: str, arm: Arm | None = None) -> Planner:
    """A planner that chooses among the reaches of another one, for ``arm``, a Panda if None.

    Raises
    ------
    ConfigurationError
        If there is no such way of choosing.
    """
    if choice not in CHOICES:
        raise ConfigurationError(f"planner: no choice '{choice}'; there are {', '.join(CHOICES)}")
    return CHOICES[choice](planner, arm or Panda())
