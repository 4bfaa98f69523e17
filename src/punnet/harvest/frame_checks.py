"""Whether a frame is what the camera sees now: not late, frozen, torn or without depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.harvest.failures import Failure, StepFailed
from punnet.scene import Frame

__all__ = ["FrameChecks"]

LEAST_DEPTH = 0.05
"""Share of pixels that must have a reading."""
BAND = 32
"""Rows of a picture that can't all be blank, or all be as they were in the frame before."""


class FrameChecks:
    """Checks each frame, also against the one before.

    A sensor's noise never repeats: where a band of rows has the same colours *and* the same depth as in the frame before, it is
    the same band. A blank band is one in which neither colour nor depth varies.
    """

    def __init__(self) -> None:
        self._last: Frame | None = None

    def check(self, frame: Frame, asked: float) -> None:
        """Check a frame that was asked for at ``asked`` seconds on the robot's clock.

        Raises
        ------
        StepFailed
            With the failure's name.
        """
        last, self._last = self._last, frame
        if frame.timestamp < asked - 1e-6:
            detail = f"taken {asked - frame.timestamp:.2f} s before the arm stood still"
            if last is not None and frame.timestamp == last.timestamp:
                raise StepFailed(Failure.FROZEN_FRAME, detail)
            raise StepFailed(Failure.LATE_FRAME, detail)
        blank = _bands(_uniform(frame))
        if blank.any():
            raise StepFailed(Failure.TORN_FRAME, f"{int(blank.mean() * frame.height)} rows are blank")
        if last is not None and last.rgb.shape == frame.rgb.shape:
            old = _bands(_same_rows(frame, last))
            if old.all():
                raise StepFailed(Failure.FROZEN_FRAME, "not a pixel has changed")
            if old.any():
                raise StepFailed(
                    Failure.TORN_FRAME, f"{int(old.mean() * frame.height)} rows are of the frame before"
                )
        share = 0.0 if frame.depth is None else float((frame.depth > 0).mean())
        if share < LEAST_DEPTH:
            raise StepFailed(Failure.NO_DEPTH, f"{share:.1%} of the pixels have a reading")


def _uniform(frame: Frame) -> NDArray[np.bool_]:
    """(H,) rows of one colour and one depth."""
    rows = (frame.rgb == frame.rgb[:, :1]).all(axis=(1, 2))
    if frame.depth is not None:
        rows &= (frame.depth == frame.depth[:, :1]).all(axis=1)
    return np.asarray(rows)


def _same_rows(frame: Frame, last: Frame) -> NDArray[np.bool_]:
    """(H,) rows that are the same in both; without depth there is nothing that could not repeat."""
    if frame.depth is None or last.depth is None:
        return np.zeros(frame.height, dtype=np.bool_)
    rows = (frame.rgb == last.rgb).all(axis=(1, 2)) & (frame.depth == last.depth).all(axis=1)
    return np.asarray(rows & (frame.depth > 0).any(axis=1))


def _bands(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each whole band of :data:`BAND` rows, from the top, has all of ``rows`` (H,)."""
    count = max(1, len(rows) // BAND)
    return np.array([part.all() for part in np.array_split(rows, count)])
