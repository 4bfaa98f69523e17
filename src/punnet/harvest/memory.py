"""What the harvest remembers of each place where it tried to pick."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.harvest.attempts import Attempt
from punnet.harvest.failures import Failure, Recovery

__all__ = ["Memory", "Place"]

_SAME_SIDE = np.cos(np.deg2rad(8.0))


@dataclass(eq=False)
class Place:
    """A point (3,) where picking was tried: how often, along which directions (3,), and what is to be done next time.

    ``missed`` is whether the fingers closed beside the stem, ``refused`` whether the last try was not begun for what hung in
    the way.
    """

    point: NDArray[np.float64]
    tries: int = 0
    approaches: list[NDArray[np.float64]] = field(default_factory=list)
    other_side: bool = False
    second_view: bool = False
    aside: bool = False
    missed: bool = False
    refused: bool = False

    def was_tried_along(self, direction: NDArray[np.float64]) -> bool:
        """Whether the tool has come in along this direction, or nearly so."""
        return any(float(direction @ other) > _SAME_SIDE for other in self.approaches)


class Memory:
    """Places by where they are: picking points of two looks that are near each other are the same berry.

    Parameters
    ----------
    same_berry
        Metres within which they are.
    attempts
        Tries at one berry before it is left.
    """

    def __init__(self, same_berry: float, attempts: int) -> None:
        self._same_berry = same_berry
        self._attempts = attempts
        self._places: list[Place] = []

    def at(self, point: NDArray[np.float64]) -> Place:
        """The place at a point (3,); a new one if nothing was tried there."""
        for place in self._places:
            if np.linalg.norm(place.point - point) < self._same_berry:
                return place
        return Place(point)

    def may_try(self, point: NDArray[np.float64]) -> bool:
        """Whether a berry at a point (3,) has tries left and was not set aside."""
        place = self.at(point)
        return place.tries < self._attempts and not place.aside

    def learn(self, attempt: Attempt) -> None:
        """Take in an attempt that ended."""
        place = self.at(attempt.picking_point)
        if all(known is not place for known in self._places):
            self._places.append(place)
        place.tries += 1
        place.point = attempt.picking_point
        if attempt.approach is not None:
            place.approaches.append(attempt.approach)
        place.refused = attempt.refused
        if attempt.failure is None:
            self._something_is_gone()
            return
        recovery = attempt.failure.recovery
        place.missed |= attempt.failure is Failure.NOT_GRIPPED
        place.aside |= recovery is Recovery.SET_ASIDE
        place.other_side |= recovery is Recovery.OTHER_SIDE
        place.second_view |= recovery in (Recovery.OTHER_SIDE, Recovery.SECOND_VIEW)

    def _something_is_gone(self) -> None:
        """What was refused may be free now: its tries count anew, and from home."""
        for place in self._places:
            if place.refused:
                place.tries, place.refused, place.second_view = 0, False, False

    def to_json(self) -> list[dict[str, Any]]:
        """Plain values, from which :meth:`restore` makes the same memory."""
        return [
            {
                "point": place.point.tolist(),
                "tries": place.tries,
                "approaches": [approach.tolist() for approach in place.approaches],
                "other_side": place.other_side,
                "second_view": place.second_view,
                "aside": place.aside,
                "missed": place.missed,
                "refused": place.refused,
            }
            for place in self._places
        ]

    def restore(self, places: list[dict[str, Any]]) -> None:
        """Remember what :meth:`to_json` wrote down, and nothing else.

        Raises
        ------
        FileFormatError
            If a value is missing or of the wrong kind.
        """
        try:
            self._places = [
                Place(
                    np.array(place["point"], dtype=np.float64),
                    int(place["tries"]),
                    [np.array(approach, dtype=np.float64) for approach in place["approaches"]],
                    bool(place["other_side"]),
                    bool(place["second_view"]),
                    bool(place["aside"]),
                    bool(place["missed"]),
                    bool(place["refused"]),
                )
                for place in places
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"memory of places: not as it was written ({error!r})") from error

    def next_second_view(self) -> Place | None:
        """A place where a try failed, which is to be looked at from a second view now; asked for once."""
        return self._asked_once([place for place in self._places if not place.refused])

    def next_refused(self) -> Place | None:
        """A place where the last try was not begun, to be looked at from a second view now; asked for once."""
        return self._asked_once([place for place in self._places if place.refused])

    def _asked_once(self, places: list[Place]) -> Place | None:
        for place in places:
            if place.second_view and place.tries < self._attempts and not place.aside:
                place.second_view = False
                return place
        return None

    def waits(self, point: NDArray[np.float64]) -> bool:
        """Whether a berry at a point (3,) is left till there is no other: what hangs in its way may be picked first."""
        place = self.at(point)
        return place.refused and place.second_view
