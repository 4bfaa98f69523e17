"""The steps that see: look, perceive, weigh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.errors import KinematicsError
from punnet.harvest.attempts import Phase
from punnet.harvest.eyes import region_of
from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.memory import Place
from punnet.harvest.situation import Parts, Situation
from punnet.planning.approach import approach_rotation, comfortable_angles
from punnet.planning.clearance import approach_directions, obstacles_among
from punnet.scene import Frame, Strawberries

__all__ = ["Look", "Perceive", "Weigh", "middle_of_plant", "untried_directions"]


SIDE_VIEWS = np.deg2rad(((-30.0, 0.0), (30.0, 0.0), (0.0, 15.0)))
"""Yaw and pitch from the comfortable direction that the plant is looked at along, if nothing is left to be seen from home."""
_PLANT_RADIUS = 0.4  # metres
_USUAL_MIDDLE = np.array([0.74, -0.05, 0.74])


class Look:
    """A frame from home, of one berry from where the tool would come in next, or of the plant from its sides.

    From the sides it is looked at when from home no berry is left that may be tried: what leaves hide from there
    may show.
    """

    phase = Phase.LOOK

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Take a frame; the arm is home afterwards."""
        if situation.looks >= self._parts.config.most_looks:
            self._parts.tell(f"ends after {situation.looks} looks", None)
            return None
        situation.looks += 1
        situation.second_view_of = self._second_view(situation)
        if situation.second_view_of is None and not self._side_view(situation):
            return Phase.ORDER if situation.hidden else None
        try:
            situation.frame = self._parts.eyes.look()
        finally:
            if situation.second_view_of is not None or situation.side_view > 0:
                self._parts.motions.require_home()
        return Phase.PERCEIVE

    def _side_view(self, situation: Situation) -> bool:
        """Move to where the plant is to be seen from; False if there is no way to this view and those after it."""
        while 0 < situation.side_view <= self._parts.config.side_views:
            middle = middle_of_plant(situation)
            yaw, pitch = comfortable_angles(middle)
            turn, tilt = SIDE_VIEWS[situation.side_view - 1]
            direction = approach_rotation(yaw + turn, pitch + tilt)[:, 2]
            try:
                if self._parts.motions.look_along(middle, direction).reached:
                    self._parts.tell("looks at the plant from another side", None)
                    return True
            except KinematicsError:
                pass
            situation.side_view += 1
        return situation.side_view == 0

    def _second_view(self, situation: Situation) -> Place | None:
        """Move to where a berry that was tried is to be seen from; None if there is none, or no way there."""
        memory = situation.memory
        place = memory.next_second_view() or (memory.next_refused() if situation.only_refused else None)
        if place is None or situation.frame is None or situation.berries is None:
            return None
        directions = untried_directions(situation.frame, situation.berries, place)
        for direction in directions[:2]:
            try:
                if self._parts.motions.look_along(place.point, direction).reached:
                    self._parts.tell("looks from a second view", None)
                    return place
            except KinematicsError:
                continue
        return None


class Perceive:
    """The berries of the frame, located in space."""

    phase = Phase.PERCEIVE

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Detect and locate; from home, after the first pick, only where berries hung before it."""
        assert situation.frame is not None
        before = next((attempt for attempt in situation.run.attempts if not attempt.second_view), None)
        region = region_of(before.berries) if situation.from_home and before is not None else None
        situation.berries = self._parts.eyes.perceive(situation.frame, region)
        return Phase.WEIGH


class Weigh:
    """Grams by eye of what may be picked; a berry that can't be weighed is picked all the same."""

    phase = Phase.WEIGH

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Weigh what was found."""
        frame, berries = situation.seen
        rows = np.flatnonzero(berries.pluckable)
        weights, intervals = np.full(len(berries), np.nan), np.full((len(berries), 2), np.nan)
        try:
            if len(rows):
                estimates = self._parts.scale.estimate(frame, berries[rows])
                weights[rows], intervals[rows] = estimates.grams, estimates.intervals
            berries = berries.with_fields(weights=weights, weight_intervals=intervals)
        except Exception as error:  # a stranger's estimator may raise anything
            raise StepFailed(Failure.SCALE_FAULT, f"{type(error).__name__}: {error}") from error
        situation.berries = berries
        run = situation.run
        if run.first_frame is None:
            run.first_frame, run.first_berries = frame, berries
        if situation.from_home:
            run.last_frame, run.last_berries = frame, berries
        situation.in_vain = 0
        self._parts.tell(f"sees {len(berries)} berries, {int(berries.pluckable.sum())} pluckable", None)
        return Phase.ORDER


def middle_of_plant(situation: Situation) -> NDArray[np.float64]:
    """Middle (3,) of the berries seen so far and last, or of where plants are if there are none.

    What is far from most of them is another row, or a depth that is none.
    """
    seen = [
        berries.picking_points
        for berries in (situation.run.first_berries, situation.berries)
        if berries is not None
    ]
    points = np.concatenate(seen) if seen else np.zeros((0, 3))
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return _USUAL_MIDDLE
    points = points[np.linalg.norm(points - np.median(points, axis=0), axis=1) < _PLANT_RADIUS]
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0) if len(points) else _USUAL_MIDDLE


def untried_directions(frame: Frame, berries: Strawberries, place: Place) -> list[NDArray[np.float64]]:
    """Directions (3,) to come in along that were not tried at a place, that with most room first."""
    located = np.isfinite(berries.picking_points).all(axis=1)
    distance = np.where(located, np.linalg.norm(berries.picking_points - place.point, axis=1), np.inf)
    row = int(np.argmin(distance)) if len(berries) else -1
    around = obstacles_among(frame, berries, row)
    directions, _ = approach_directions(place.point, around)
    return [direction for direction in directions if not place.was_tried_along(direction)]
