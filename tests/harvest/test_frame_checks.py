"""Frames that must not be believed."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.harvest.failures import Failure, StepFailed
from punnet.harvest.frame_checks import FrameChecks
from punnet.scene import Frame


def a_frame(seed: int, time: float) -> Frame:
    rng = np.random.default_rng(seed)
    rgb = np.full((480, 640, 3), 90, dtype=np.uint8)  # a still scene: the colours are the same each time
    rgb[:, 100:200] = 40
    depth = (0.5 + 0.01 * rng.random((480, 640))).astype(np.float32)
    return Frame(rgb, depth, timestamp=time)


@pytest.fixture
def checks() -> FrameChecks:
    checks = FrameChecks()
    checks.check(a_frame(0, 1.0), 0.6)
    return checks


def test_good_frames_pass_though_nothing_moves(checks: FrameChecks) -> None:
    for number in range(1, 4):
        checks.check(a_frame(number, 1.0 + number), 0.6 + number)


def test_a_frame_of_one_colour_with_depth_passes(checks: FrameChecks) -> None:
    checks.check(replace(a_frame(1, 2.0), rgb=np.zeros((480, 640, 3), dtype=np.uint8)), 1.5)


def torn(frame: Frame, other: Frame) -> Frame:
    rgb, depth = frame.rgb.copy(), frame.depth.copy()
    rgb[300:], depth[300:] = other.rgb[300:], other.depth[300:]
    return replace(frame, rgb=rgb, depth=depth)


def half_arrived(frame: Frame) -> Frame:
    rgb, depth = frame.rgb.copy(), frame.depth.copy()
    rgb[400:], depth[400:] = 0, 0.0
    return replace(frame, rgb=rgb, depth=depth)


@pytest.mark.parametrize(
    ("bad", "failure", "words"),
    [
        (a_frame(0, 1.0), Failure.FROZEN_FRAME, "before the arm stood still"),
        (a_frame(0, 2.0), Failure.FROZEN_FRAME, "not a pixel"),
        (a_frame(1, 1.4), Failure.LATE_FRAME, "0.10 s"),
        (torn(a_frame(1, 2.0), a_frame(0, 1.0)), Failure.TORN_FRAME, "160 rows are of the frame before"),
        (half_arrived(a_frame(1, 2.0)), Failure.TORN_FRAME, "64 rows are blank"),
        (replace(a_frame(1, 2.0), depth=None), Failure.NO_DEPTH, "0.0%"),
        (replace(a_frame(1, 2.0), depth=np.zeros((480, 640), np.float32)), Failure.NO_DEPTH, "0.0%"),
    ],
    ids=lambda value: value.name if isinstance(value, Failure) else "",
)
def test_bad_frames_are_named(checks: FrameChecks, bad: Frame, failure: Failure, words: str) -> None:
    with pytest.raises(StepFailed, match=words) as failed:
        checks.check(bad, 1.5)
    assert failed.value.failure is failure
    checks.check(a_frame(9, 3.0), 2.5)  # and the next good one is believed again
