"""What is remembered of places, and what follows from it."""

import json

import numpy as np
import pytest

from punnet.errors import FileFormatError
from punnet.harvest.attempts import Attempt, Outcome
from punnet.harvest.failures import Failure, Recovery, StepFailed
from punnet.harvest.memory import Memory
from punnet.scene import Frame, Strawberries

POINT = np.array([0.7, 0.0, 0.7])
AHEAD = np.array([1.0, 0.0, 0.0])


def an_attempt(failure: Failure | None, point=POINT, approach=AHEAD) -> Attempt:
    frame = Frame(np.zeros((8, 8, 3), dtype=np.uint8))
    outcome = Outcome.PICKED if failure is None else Outcome.FAILED
    berries = Strawberries.empty((8, 8))
    return Attempt(
        1, frame, berries, 0, point, 20.0, (15.0, 25.0), 0, outcome, failure=failure, approach=approach
    )


def test_a_failed_grip_is_tried_from_another_side_after_a_second_view() -> None:
    memory = Memory(0.025, 2)
    memory.learn(an_attempt(Failure.NOT_GRIPPED))
    near = POINT + np.array([0.0, 0.01, 0.0])
    place = memory.next_second_view()
    assert place is memory.at(near)
    assert place.other_side
    assert place.was_tried_along(AHEAD)
    turned = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    assert not place.was_tried_along(turned)
    assert memory.next_second_view() is None  # asked for once
    assert memory.may_try(near)
    memory.learn(an_attempt(Failure.NOT_CUT, near, turned))
    assert not memory.may_try(POINT)
    assert memory.next_second_view() is None


def test_what_is_out_of_reach_is_set_aside_at_once() -> None:
    memory = Memory(0.025, 5)
    memory.learn(an_attempt(Failure.OUT_OF_REACH, approach=None))
    assert not memory.may_try(POINT)
    assert memory.may_try(POINT + 0.03)


def test_a_place_where_one_was_picked_may_be_tried_again() -> None:
    memory = Memory(0.025, 2)
    memory.learn(an_attempt(None))
    assert memory.may_try(POINT)
    assert memory.next_second_view() is None


def test_what_was_refused_may_be_tried_anew_when_another_is_gone() -> None:
    memory = Memory(0.025, 2)
    elsewhere = POINT + np.array([0.0, 0.1, 0.0])
    for _ in range(2):
        memory.learn(an_attempt(Failure.NOT_FREE, approach=None))
        memory.learn(an_attempt(Failure.NOT_GRIPPED, elsewhere))
    assert not memory.may_try(POINT)
    memory.learn(an_attempt(None, POINT - np.array([0.0, 0.1, 0.0])))
    assert memory.may_try(POINT)
    assert not memory.may_try(elsewhere)
    for _ in range(2):
        memory.learn(an_attempt(Failure.NOT_FREE, approach=None))
    assert not memory.may_try(POINT)
    assert len(memory.to_json()) == 3


def test_what_was_refused_waits_for_the_others() -> None:
    memory = Memory(0.025, 3)
    elsewhere = POINT + np.array([0.0, 0.1, 0.0])
    memory.learn(an_attempt(Failure.NOT_FREE, approach=None))
    memory.learn(an_attempt(Failure.NOT_GRIPPED, elsewhere))
    assert memory.waits(POINT)
    assert not memory.waits(elsewhere)
    assert memory.next_second_view() is memory.at(elsewhere)
    assert memory.next_second_view() is None
    assert memory.next_refused() is memory.at(POINT)
    assert memory.next_refused() is None  # asked for once
    assert not memory.waits(POINT)
    memory.learn(an_attempt(Failure.NOT_FREE, approach=None))
    memory.learn(an_attempt(None, elsewhere))
    assert not memory.waits(POINT)  # a berry is gone: it is planned for from home again
    assert memory.next_refused() is None


def test_memory_survives_being_written_down() -> None:
    memory = Memory(0.025, 3)
    memory.learn(an_attempt(Failure.NOT_GRIPPED))
    memory.learn(an_attempt(Failure.OUT_OF_REACH, POINT + 0.1, None))
    memory.next_second_view()
    other = Memory(0.025, 3)
    other.restore(json.loads(json.dumps(memory.to_json())))
    assert other.next_second_view() is None
    assert other.at(POINT).was_tried_along(AHEAD)
    assert other.may_try(POINT)
    assert not other.may_try(POINT + 0.1)
    assert other.to_json() == memory.to_json()
    with pytest.raises(FileFormatError, match="memory of places"):
        other.restore([{"point": [0, 0, 0]}])


def test_reasons_name_their_kind_once() -> None:
    assert StepFailed(Failure.NOT_GRIPPED, "nothing between the pads").reason == "nothing between the pads"
    assert StepFailed(Failure.PRESSED, "pressed on structure: with 44 N").reason.count("pressed") == 1
    assert StepFailed(Failure.NOT_CUT, "blade off the stem: by 12 mm").reason.startswith(
        "the stem was not cut: "
    )
    assert Failure.from_reason("out of reach: no posture", Failure.NO_APPROACH) is Failure.OUT_OF_REACH
    assert Failure.from_reason("anything", Failure.NO_APPROACH) is Failure.NO_APPROACH


def test_every_failure_has_a_text_of_its_own_and_a_recovery() -> None:
    assert len({failure.text for failure in Failure}) == len(Failure)
    assert {failure.recovery for failure in Failure} == set(Recovery)
