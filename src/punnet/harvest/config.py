"""Settings of the harvest loop."""

from __future__ import annotations

from dataclasses import dataclass

from punnet.errors import ConfigurationError
from punnet.harvest.order import DEFAULT_ORDER, order_of
from punnet.robot import COMING_IN

__all__ = ["MOST_SIDE_VIEWS", "HarvestConfig"]

MOST_SIDE_VIEWS = 3


@dataclass(frozen=True)
class HarvestConfig:
    """How the loop moves and when it gives up.

    Parameters
    ----------
    speed
        Share of the arm's velocity limits for free motions, in (0, 1].
    careful_speed
        The same while the tool is among the berries or carries one.
    retreat
        Metres the tool backs out along its approach before it turns to the punnet.
    attempts
        Tries at one berry before it is set aside.
    patience
        Looks in a row that may give nothing before the harvest stops.
    same_berry
        Metres within which picking points of two looks are the same berry.
    side_views
        Views of the plant from its sides, 0 to 3, when from home no berry is left that may be tried.
    least_ripeness
        Of a berry that is picked, 0 to 1, whatever class the detector gives it; 0.05 less where its score says that it is
        sure, and one of unknown ripeness is picked. Every detector has its own scale. None: the class alone counts.
    most_looks
        Looks after which the loop ends whatever it sees; a guard against endless loops.
    look_on_the_way
        Metres before the end of a reach at which the berry is looked at once more; nearer than 0.2 m the camera, which sits
        above the tool, does not see the fruit. 0: not at all.
    reach_force
        Newtons of the tool on a fruit at which a reach, or carrying what was picked, is broken off; None: never.
    most_attempts
        Attempts after which the harvest ends; None: when no berry is left.
    opening
        Share of their full opening with which the grasping fingers go into the plant, in (0, 1]: the wider, the worse may a
        stem be located, and the more of its neighbours are between the fingers when they close.
    separation
        Opening of the separation fingers once the stem is between the pads, in [0, 1].
    nominal_punnet
        Grams that a punnet should hold.
    punnet_berries
        Berries at which a punnet is full whatever it weighs.
    order
        Which berry is picked next: one of :data:`punnet.harvest.order.ORDERS`.
    """

    speed: float = 0.9
    careful_speed: float = 0.5
    retreat: float = 0.18
    attempts: int = 3
    patience: int = 3
    same_berry: float = 0.025
    side_views: int = 2
    least_ripeness: float | None = None
    most_looks: int = 60
    look_on_the_way: float = 0.21
    reach_force: float | None = 6.5
    most_attempts: int | None = None
    opening: float = COMING_IN
    separation: float = 1.0
    nominal_punnet: float = 250.0
    punnet_berries: int = 18
    order: str = DEFAULT_ORDER

    def __post_init__(self) -> None:
        order_of(self.order)
        if not (0 < self.speed <= 1 and 0 < self.careful_speed <= 1):
            raise ConfigurationError(
                f"harvest: speeds must lie in (0, 1], got {self.speed} and {self.careful_speed}"
            )
        if (
            min(self.attempts, self.patience, self.most_looks) < 1
            or self.retreat <= 0
            or self.same_berry <= 0
        ):
            raise ConfigurationError(
                "harvest: attempts, patience and most_looks must be ≥ 1, retreat and same_berry > 0"
            )
        if not 0 < self.opening <= 1:
            raise ConfigurationError(f"harvest: opening must lie in (0, 1], got {self.opening}")
        if not (0 <= self.side_views <= MOST_SIDE_VIEWS and 0 <= (self.least_ripeness or 0) <= 1):
            raise ConfigurationError(
                f"harvest: side_views must lie in 0…{MOST_SIDE_VIEWS} and least_ripeness in 0…1, got "
                f"{self.side_views} and {self.least_ripeness}"
            )
