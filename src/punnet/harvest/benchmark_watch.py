"""What a benchmark notes while a plant is harvested: how far the robot was off, and when it ran into something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.harvest.attempts import Attempt
from punnet.harvest.judge import TOUCH_FORCE
from punnet.harvest.loop import CUTTING
from punnet.harvest.scenario import Session
from punnet.sim.truth import true_picking_points

__all__ = ["AttemptTruth", "Collision", "Watch"]


@dataclass
class AttemptTruth:
    """One attempt by the simulator's truth.

    Parameters
    ----------
    aimed
        Index of the berry whose picking point is nearest to the one that the robot aims at; None if none hangs.
    located_error
        Metres between the two when the attempt begins.
    cut_error
        Metres between the tool and the berry's picking point when the blade starts; NaN if it did not.
    """

    aimed: int | None
    located_error: float
    cut_error: float = float("nan")


@dataclass(frozen=True)
class Collision:
    """The tool pressed a berry with more than :data:`~punnet.harvest.judge.TOUCH_FORCE` for the first time."""

    berry: int
    attempt: int
    during: str


class Watch:
    """A listener of a session; give it the session before that runs.

    Attributes
    ----------
    attempts
        By number.
    collisions
        In the order in which they happened, of any berry, picked ones too.
    """

    def __init__(self) -> None:
        self.session: Session | None = None
        self.attempts: dict[int, AttemptTruth] = {}
        self.collisions: list[Collision] = []
        self._last = (0, "home")

    def listen(self, line: str, attempt: Attempt | None) -> None:
        """Take a step of the loop in."""
        session = self.session
        if session is None:
            return
        self._find_collisions(session.world.contacts.tool_peak_on_berry)
        if attempt is None:
            self._last = (self._last[0], "home")
            return
        self._last = (attempt.number, str(attempt.phase))
        if attempt.number not in self.attempts:
            self.attempts[attempt.number] = self._aim(session, attempt)
        truth = self.attempts[attempt.number]
        if line == CUTTING and truth.aimed is not None:
            tool = session.world.arm.forward_kinematics_tool(session.robot.joints())[:3, 3]
            truth.cut_error = float(np.linalg.norm(tool - true_picking_points(session.world)[truth.aimed]))

    def finish(self) -> None:
        """Look once more, when the run has ended, and let go of the session."""
        if self.session is not None:
            self._find_collisions(self.session.world.contacts.tool_peak_on_berry)
            self.session = None

    def _aim(self, session: Session, attempt: Attempt) -> AttemptTruth:
        hanging = np.flatnonzero(session.world.attached())
        if not len(hanging):
            return AttemptTruth(None, float("nan"))
        offsets = true_picking_points(session.world)[hanging] - attempt.picking_point
        distances = np.linalg.norm(offsets, axis=1)
        nearest = int(np.argmin(distances))
        return AttemptTruth(int(hanging[nearest]), float(distances[nearest]))

    def _find_collisions(self, peaks: NDArray[np.float64]) -> None:
        known = {collision.berry for collision in self.collisions}
        for berry in np.flatnonzero(peaks > TOUCH_FORCE):
            if int(berry) not in known:
                self.collisions.append(Collision(int(berry), *self._last))
