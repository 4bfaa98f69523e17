"""The steps that decide: order, plan, check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.errors import KinematicsError, PlanningError, ShapeError
from punnet.harvest.attempts import Attempt, Phase
from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.order import order_of
from punnet.harvest.seeing import untried_directions
from punnet.harvest.situation import Parts, Sighting, Situation, stem_is_hidden, weighed
from punnet.movement import TrajectoryDistribution
from punnet.scene import KEYPOINTS, Frame, Strawberries, Target, Visibility

__all__ = ["Check", "Order", "Plan"]

_TOP = KEYPOINTS.index("top")
_SURE, _LENIENT = 0.65, 0.10  # from which score a berry may be how much less ripe


class Order:
    """Which berry next, and for which punnet.

    A berry that has no free approach waits for the others: picking them may free it. When there is no other, it is looked at
    from a second view. A berry whose stem something hides waits too: after the picks before it, or from a side, it may
    be seen better. When none is left that can be seen, it is tried as it showed best.
    """

    phase = Phase.ORDER

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Choose, and begin an attempt; None when no berry is left that may be tried."""
        frame, berries = situation.seen
        rows = self._candidates(situation, frame, berries)
        if not rows and situation.second_view_of is not None:
            self._parts.tell("does not find the berry again from there", None)
            return Phase.LOOK
        most = self._parts.config.most_attempts
        if most is not None and len(situation.run.attempts) >= most:
            return None
        if situation.second_view_of is None:
            waiting = [row for row in rows if situation.memory.waits(berries.picking_points[row])]
            rows = [row for row in rows if row not in waiting]
            situation.only_refused = bool(waiting) and not rows
            if situation.only_refused:
                return Phase.LOOK
            hidden = [row for row in rows if stem_is_hidden(berries, row)]
            situation.hidden += [Sighting(frame, berries, row, situation.from_home) for row in hidden]
            rows = [row for row in rows if row not in hidden]
        if rows:
            self._begin(situation, [Sighting(frame, berries, row, situation.from_home) for row in rows])
            return Phase.PLAN
        situation.side_view += 1
        if situation.side_view <= self._parts.config.side_views:
            return Phase.LOOK
        if not situation.hidden:
            return None
        self._begin(situation, [max(situation.hidden, key=_shown)])
        return Phase.PLAN

    def _begin(self, situation: Situation, sightings: list[Sighting]) -> None:
        """An attempt at one of them."""
        number = len(situation.run.attempts) + 1
        sighting, punnet = self._choose(sightings, number)
        berries, row = sighting.berries, sighting.row
        situation.frame, situation.berries = sighting.frame, berries
        low, high = berries.weight_intervals[row]
        situation.attempt = Attempt(
            number=number,
            frame=sighting.frame,
            berries=berries,
            row=row,
            picking_point=berries.picking_points[row],
            estimate=float(berries.weights[row]),
            interval=(float(low), float(high)),
            meant_for=punnet,
            second_view=not sighting.from_home,
        )
        situation.side_view = 0
        situation.hidden = []

    def _candidates(self, situation: Situation, frame: Frame, berries: Strawberries) -> list[int]:
        """Rows in the order to pick them; from a second view only the berry that it was turned to."""
        rows = [int(row) for row in order_of(self._parts.config.order)(frame, berries)]
        rows = [row for row in rows if situation.memory.may_try(berries.picking_points[row])]
        least = (self._parts.config.least_ripeness or 0.0) - np.where(berries.scores >= _SURE, _LENIENT, 0.0)
        rows = [row for row in rows if not berries.ripeness[row] < least[row]]
        place = situation.second_view_of
        if place is None:
            return rows
        return [row for row in rows if situation.memory.at(berries.picking_points[row]) is place][:1]

    def _choose(self, sightings: list[Sighting], number: int) -> tuple[Sighting, int | None]:
        """The first that fits a punnet, and that punnet.

        A berry that fits none waits on the plant; when there are only such, the one that fits best. No punnet:
        all are full.
        """
        packer = self._parts.packer
        offers = []
        for sighting in sightings:
            best = packer.best(weighed(sighting.berries, sighting.row, number))
            if best is None:
                return sighting, None
            punnet, cost = best
            if cost <= packer.policy.price_aside:
                return sighting, punnet
            offers.append((cost, sighting, punnet))
        _, sighting, punnet = min(offers, key=lambda offer: offer[0])
        return sighting, punnet


def _shown(sighting: Sighting) -> tuple[bool, int]:
    """By how much of a berry, whose stem is hidden, is known: its top, and its outline in pixels."""
    berries, row = sighting.berries, sighting.row
    top = berries.visibility is not None and bool(berries.visibility[row, _TOP] == Visibility.VISIBLE)
    return top, 0 if berries.masks is None else int(np.count_nonzero(berries.masks[row]))


class Plan:
    """A distribution of reaches; on a second try along another direction than before."""

    phase = Phase.PLAN

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Plan for the attempt in hand."""
        attempt = situation.in_hand
        if attempt.meant_for is None:
            raise StepFailed(Failure.PUNNETS_FULL)
        refusal: StepFailed | None = None
        for direction in self._directions(situation):
            try:
                attempt.distribution = self._plan(attempt, direction)
            except StepFailed as failure:
                refusal = refusal or failure
            else:
                return Phase.CHECK
        assert refusal is not None  # there is always a direction, or None
        raise refusal

    def _directions(self, situation: Situation) -> list[NDArray[np.float64] | None]:
        """None: as the planner likes."""
        attempt = situation.in_hand
        place = situation.memory.at(attempt.picking_point)
        if not place.other_side:
            return [None]
        return [*untried_directions(attempt.frame, attempt.berries, place), None]

    def _plan(self, attempt: Attempt, direction: NDArray[np.float64] | None) -> TrajectoryDistribution:
        berries, row = attempt.berries, attempt.row
        try:
            target = Target(
                berries.boxes[row], attempt.picking_point, direction, int(berries.ids[row]), among=berries
            )
            distribution = self._parts.planner.plan(attempt.frame, target, self._parts.robot.joints())
            finite = bool(np.isfinite(distribution.mean(np.linspace(0.0, 1.0, 11))).all())
        except PlanningError as error:
            raise StepFailed(Failure.from_reason(str(error), Failure.NO_APPROACH), str(error)) from error
        except Exception as error:  # a stranger's planner may raise anything
            raise StepFailed(Failure.PLANNER_FAULT, f"{type(error).__name__}: {error}") from error
        if not finite:
            raise StepFailed(Failure.PLAN_NOT_FINITE, "its mean has NaN or infinity")
        return distribution


class Check:
    """The mean reach as it would be executed: timed, within every limit, clear of the arm itself and of structure."""

    phase = Phase.CHECK

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Time the reach, and check it."""
        attempt = situation.in_hand
        assert attempt.distribution is not None
        try:
            attempt.approach = self._parts.motions.prepare(attempt.distribution)
        except (KinematicsError, ShapeError) as error:
            raise StepFailed(Failure.NO_KINEMATICS, str(error)) from error
        return Phase.REACH
