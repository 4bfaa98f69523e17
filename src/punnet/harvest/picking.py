"""The steps that touch: reach, separate, grip, cut, place, verify."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.harvest.attempts import Attempt, Outcome, Phase
from punnet.harvest.eyes import region_around
from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.situation import Parts, Situation, stem_is_hidden, weighed
from punnet.robot import NOTHING_HELD, TOO_THICK, GripResult, MotionResult

__all__ = ["CUTTING", "GRIPPING", "Cut", "Grip", "Place", "Reach", "Separate", "Verify"]

GRIPPING = "moves its neighbours aside and grips the stem"
"""What a listener is told when the fingers are at the stem."""

CUTTING = "cuts the stem"
"""What a listener is told when the blade starts."""

EMPTY_PUNNET_NOISE = 1.0
"""Grams; a gain below this means that nothing fell in."""
_LOOKS_DIFFER = 0.006  # metres between the points of two looks at a berry that hangs still
_HIGHER = 0.009  # metres up the stem, where a fruit was between the pads
_DEEPER = (
    0.016  # metres on, where the tool has pushed a stem ahead of itself; the pads reach 11 mm to both sides
)
_TIMES_DEEPER = 2
_IN_THE_WAY = np.array(
    [0.030, 0.015, 0.045]
)  # metres off the tool, within which going deeper might take another stem
_TIMES_HIGHER = 3  # if it is not sure where the berry hangs; else higher up there would be another's stem
_WIDER = 1.6  # times the opening, where the fingers missed the stem before
_TAKEN_AWAY = 5.0  # grams that a punnet can't lose by itself


class Reach:
    """To the stem, along the checked trajectory; on the way it looks where the berry is by then."""

    phase = Phase.REACH

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Follow the reach."""
        attempt = situation.in_hand
        x, y, z = attempt.picking_point
        self._parts.tell(f"reaches for berry at x {x:.2f}, y {y:+.2f}, z {z:.2f} m", attempt)
        if self._parts.config.look_on_the_way > 0:
            _require(self._parts.motions.to_the_plant())
            attempt.shift = self._shift(attempt, situation.memory.at(attempt.picking_point).tries)
        if situation.memory.at(attempt.picking_point).missed:
            self._parts.robot.release(_opening(self._parts, situation))
        result = self._parts.motions.go_in(attempt.shift)
        attempt.peak_force, attempt.touched = result.peak_force, result.touched
        _require(result)
        return Phase.SEPARATE

    def _shift(self, attempt: Attempt, tries: int) -> NDArray[np.float64]:
        """How far (3,) from the planned point the tool has to go, by a look on the way; 0 where it can't tell.

        Within what two looks differ by noise the first counts: nearer by, but from a slant, the second is no better. A
        look that shows the stem counts for more than one in which something hides it. A berry that is not seen again
        was mostly located badly: at the first try it is left, and seen from elsewhere later.
        """
        try:
            frame = self._parts.eyes.look()
            berries = self._parts.eyes.perceive(frame, region_around(frame, attempt.picking_point))
        except StepFailed as failure:
            self._parts.tell(f"goes on without a look on the way: {failure.reason}", attempt)
            return np.zeros(3)
        offsets = np.where(berries.pluckable[:, None], berries.picking_points - attempt.picking_point, np.inf)
        distances = np.nan_to_num(np.linalg.norm(offsets, axis=1), nan=np.inf)
        row = int(np.argmin(distances)) if len(distances) else 0
        guessed = stem_is_hidden(attempt.berries, attempt.row)
        if not len(distances) or distances[row] > self._parts.config.same_berry:
            attempt.confirmed = False
            if tries == 0 and not guessed:
                raise StepFailed(Failure.NOT_CONFIRMED)
            self._parts.tell("does not see the berry on the way, goes on as planned", attempt)
            return np.zeros(3)
        offset, distance = offsets[row], float(distances[row])
        if stem_is_hidden(berries, row) or (distance <= _LOOKS_DIFFER and not guessed):
            return np.zeros(3)
        self._parts.tell(f"the berry has moved by {1000 * distance:.0f} mm", attempt)
        return np.asarray(offset)


class Separate:
    """Fingers apart: what hangs beside the stem is moved aside."""

    phase = Phase.SEPARATE

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Open the separation fingers."""
        self._parts.tell(GRIPPING, situation.in_hand)
        self._parts.robot.separate(self._parts.config.separation)
        return Phase.GRIP


class Grip:
    """The stem between the pads."""

    phase = Phase.GRIP

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Close the pads."""
        grip = self._parts.robot.grip()
        for _ in range(1 if situation.in_hand.confirmed else _TIMES_HIGHER):
            if grip.reason != TOO_THICK:
                break
            self._parts.tell("has a fruit between the pads, grips higher", situation.in_hand)
            _require(self._parts.motions.raise_tool(_HIGHER))
            grip = self._parts.robot.grip()
        if grip.reason == NOTHING_HELD and _is_alone(self._parts, situation.in_hand):
            grip = _deeper(self._parts, situation)
        if not grip.holding:
            reason = grip.reason or ""
            raise StepFailed(Failure.from_reason(reason, Failure.NOT_GRIPPED), reason)
        return Phase.CUT


class Cut:
    """The stem cut above the pads; a second time where it had slipped from them."""

    phase = Phase.CUT

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Drive the blade.

        What the pads still hold and the blade has not parted is left: it hangs so far from where it was seen that it is
        another berry's, as a rule.
        """
        parts, attempt = self._parts, situation.in_hand
        parts.tell(CUTTING, attempt)
        cut = parts.robot.cut()
        slipped = not cut.cut and parts.robot.grip().reason == NOTHING_HELD
        if slipped and _is_alone(parts, attempt) and _deeper(parts, situation).holding:
            parts.tell(CUTTING, attempt)
            cut = parts.robot.cut()
        if not cut.cut:
            raise StepFailed(Failure.NOT_CUT, cut.reason or "")
        return Phase.PLACE


def _deeper(parts: Parts, situation: Situation) -> GripResult:
    """Grip farther on: coming in, the tool may have pushed the berry and its stem ahead of itself."""
    for _ in range(_TIMES_DEEPER):
        parts.tell("has nothing between the pads, grips deeper", situation.in_hand)
        parts.robot.release(_opening(parts, situation))
        _require(parts.motions.go_deeper(_DEEPER))
        grip = parts.robot.grip()
        if grip.reason != NOTHING_HELD:
            break
    return grip


def _is_alone(parts: Parts, attempt: Attempt) -> bool:
    """Whether no other stem was seen where the tool stands or ahead of it."""
    others = np.delete(attempt.berries.picking_points, attempt.row, axis=0)
    x, y, z = _IN_THE_WAY[:, None] > np.abs(parts.motions.from_tool(others)).T
    return not bool((x & y & z).any())


class Place:
    """Out of the plant, and into the punnet; into another one if that is gone."""

    phase = Phase.PLACE

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Carry the berry; the arm is home afterwards, the tool empty."""
        attempt, motions, packer = situation.in_hand, self._parts.motions, self._parts.packer
        self._parts.robot.separate(0.0)
        moved = motions.retreat()
        punnet = attempt.meant_for = self._punnet(situation)
        self._parts.tell(f"carries it to punnet {punnet + 1}", attempt)
        if moved.reached:
            moved = motions.carry(punnet, len(packer.punnets[punnet].berries))
        if moved.reached:
            motions.leave_punnet()
        motions.require_home()
        packer.place(punnet, weighed(attempt.berries, attempt.row, attempt.number))
        attempt.carried = moved.reason
        return Phase.VERIFY

    def _punnet(self, situation: Situation) -> int:
        """The punnet that it was meant for if it is still there, else the next best."""
        attempt, packer = situation.in_hand, self._parts.packer
        punnet = attempt.meant_for
        while punnet is not None:
            if not is_missing(self._parts, punnet):
                return punnet
            packer.missing(punnet)
            self._parts.tell(f"punnet {punnet + 1} is not there any more", attempt)
            best = packer.best(weighed(attempt.berries, attempt.row, attempt.number))
            punnet = None if best is None else best[0]
        raise StepFailed(Failure.PUNNET_MISSING, "and no other has room")


class Verify:
    """Whether the punnet has gained a berry, by its weigh cell; without a cell it is believed."""

    phase = Phase.VERIFY

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def do(self, situation: Situation) -> Phase | None:
        """Weigh the punnet."""
        attempt, packer = situation.in_hand, self._parts.packer
        punnet = attempt.meant_for
        assert punnet is not None
        reading = self._parts.robot.weigh_punnet(punnet)
        if reading is not None:
            berry = weighed(attempt.berries, attempt.row, attempt.number)
            if not np.isfinite(reading):
                packer.lost(punnet, berry)
                raise StepFailed(Failure.CELL_FAULT, f"punnet {punnet + 1} reads {reading} g")
            attempt.reading = reading
            attempt.weighed = reading - packer.punnets[punnet].reading
            if attempt.weighed < -_TAKEN_AWAY:
                packer.missing(punnet)
                raise StepFailed(Failure.PUNNET_MISSING, f"punnet {punnet + 1} was taken away with the berry")
            packer.observe(punnet, reading)
            if attempt.weighed < EMPTY_PUNNET_NOISE:
                attempt.weighed = float("nan")
                packer.lost(punnet, berry)
                raise StepFailed(Failure.LOST, attempt.carried or "")
        attempt.punnet = punnet
        attempt.outcome = Outcome.PICKED
        return Phase.LOOK


def is_missing(parts: Parts, punnet: int) -> bool:
    """Whether a punnet weighs less than it did: somebody has taken it, or from it."""
    reading = parts.robot.weigh_punnet(punnet)
    return reading is not None and reading < parts.packer.punnets[punnet].reading - _TAKEN_AWAY


def _opening(parts: Parts, situation: Situation) -> float:
    """How wide the grasping fingers go into the plant, in (0, 1]."""
    missed = situation.memory.at(situation.in_hand.picking_point).missed
    return min(1.0, _WIDER * parts.config.opening) if missed else parts.config.opening


def _require(result: MotionResult) -> None:
    """Nothing, or the failure of a motion that did not arrive."""
    if not result.reached:
        reason = result.reason or ""
        raise StepFailed(Failure.from_reason(reason, Failure.NOT_ARRIVED), reason)
