"""Everything that can go wrong in a harvest by its name, and what is done about it."""

from __future__ import annotations

from enum import Enum, StrEnum

from punnet.robot import NOT_ALONE, NOTHING_HELD, TOO_THICK

__all__ = ["Failure", "Recovery", "StepFailed"]


class Recovery(StrEnum):
    """What the harvest does after a failure."""

    LOOK_AGAIN = "look again"
    SECOND_VIEW = "look from a second view, try again"
    OTHER_SIDE = "look from a second view, try from another side"
    SET_ASIDE = "set the berry aside"
    STOP = "stop, arm home if it gets there"


class Failure(Enum):
    """A reason with its text and its recovery; looking in vain too often ends in a stop, trying too often in setting aside."""

    # Camera and eyes
    NO_FRAME = ("the camera gives no frame", Recovery.LOOK_AGAIN)
    LATE_FRAME = ("the frame is older than the look", Recovery.LOOK_AGAIN)
    FROZEN_FRAME = ("the camera repeats an old frame", Recovery.LOOK_AGAIN)
    TORN_FRAME = ("part of the frame is missing or old", Recovery.LOOK_AGAIN)
    NO_DEPTH = ("depth is gone", Recovery.LOOK_AGAIN)
    DETECTOR_FAULT = ("the detector failed", Recovery.LOOK_AGAIN)
    SCALE_FAULT = ("the weights could not be estimated", Recovery.LOOK_AGAIN)
    # Choosing and planning
    PUNNETS_FULL = ("all punnets are full", Recovery.SET_ASIDE)
    NOT_LOCATED = ("no depth", Recovery.SECOND_VIEW)
    OUT_OF_REACH = ("out of reach", Recovery.SET_ASIDE)
    NO_APPROACH = ("no straight approach", Recovery.SECOND_VIEW)
    NOT_FREE = ("no free approach", Recovery.SECOND_VIEW)
    PLANNER_FAULT = ("the planner failed", Recovery.SECOND_VIEW)
    PLAN_NOT_FINITE = ("the plan is not finite", Recovery.SECOND_VIEW)
    NO_KINEMATICS = ("the arm can't follow", Recovery.OTHER_SIDE)
    UNSAFE = ("unsafe", Recovery.OTHER_SIDE)
    # Arm and tool
    NOT_CONFIRMED = ("the berry is not seen again on the way", Recovery.SECOND_VIEW)
    HELD_UP = ("arm held up", Recovery.OTHER_SIDE)
    PRESSED = ("pressed on structure", Recovery.OTHER_SIDE)
    PUSHED_FRUIT = ("pushed a fruit", Recovery.OTHER_SIDE)
    NOT_ARRIVED = ("did not arrive", Recovery.OTHER_SIDE)
    FRUIT_GRIPPED = (TOO_THICK, Recovery.OTHER_SIDE)
    STEMS_GRIPPED = (NOT_ALONE, Recovery.OTHER_SIDE)
    NOT_GRIPPED = (NOTHING_HELD, Recovery.OTHER_SIDE)
    NOT_CUT = ("the stem was not cut", Recovery.OTHER_SIDE)
    ROBOT_FAULT = ("the robot failed", Recovery.STOP)
    NOT_HOME = ("the arm does not get home", Recovery.STOP)
    # Punnets
    LOST = ("the berry was lost on the way to the punnet", Recovery.SECOND_VIEW)
    PUNNET_MISSING = ("the punnet is not there", Recovery.SET_ASIDE)
    CELL_FAULT = ("the weigh cell reads nonsense", Recovery.STOP)
    # The rest
    LOG_FAULT = ("the log can't be written", Recovery.STOP)
    BLIND = ("nothing to be seen for too long", Recovery.STOP)

    def __init__(self, text: str, recovery: Recovery) -> None:
        self.text = text
        self.recovery = recovery

    @classmethod
    def from_reason(cls, reason: str, otherwise: Failure) -> Failure:
        """The failure whose text ``reason`` begins with, as the messages of planners and robots do."""
        return next((failure for failure in cls if reason.startswith(failure.text)), otherwise)


class StepFailed(Exception):  # noqa: N818 - it says what happened, and never leaves the harvest
    """A step did not work out. ``reason`` begins with what kind of reason it is, up to a colon."""

    def __init__(self, failure: Failure, detail: str = "") -> None:
        detail = detail.strip()
        if not detail or detail == failure.text:
            self.reason = failure.text
        elif detail.startswith(failure.text):
            self.reason = detail
        else:
            self.reason = f"{failure.text}: {detail}"
        super().__init__(self.reason)
        self.failure = failure
