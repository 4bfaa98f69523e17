import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.movement import JointTrajectory


def drawn(seed: int, count: int, known: int) -> JointTrajectory:
    rng = np.random.default_rng(seed)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.01, 0.3, count - 1))))
    arrays = [rng.normal(size=(count, 3)) for _ in range(known)]
    return JointTrajectory(times, *arrays)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(2, 12), st.integers(1, 3))
def test_peaks_are_never_below_what_is_sampled_and_hardly_above(seed: int, count: int, known: int) -> None:
    trajectory = drawn(seed, count, known)
    bounds = trajectory.peak_rates()
    # Each piece by itself, up to both of its ends.
    inside = np.linspace(1e-9, 1.0 - 1e-9, 2001)
    times = (trajectory.times[:-1, None] + inside * np.diff(trajectory.times)[:, None]).ravel()
    for order in (1, 2, 3):
        found = np.abs(trajectory.sample(times, derivative=order)).max(axis=0)
        assert (found <= bounds[order - 1] * (1 + 1e-9) + 1e-9).all()
        assert (bounds[order - 1] <= 1.15 * found + 1e-9).all()


def test_a_jerk_that_peaks_just_before_a_sample_is_seen() -> None:
    """From rest to an acceleration of 1 in 1 s: the jerk of the quintic piece grows to its end, and is none after it."""
    trajectory = JointTrajectory(
        np.array([0.0, 1.0, 2.0]),
        np.array([[0.0], [0.0], [1.0]]),
        np.array([[0.0], [0.0], [1.0]]),
        np.array([[0.0], [1.0], [1.0]]),
    )
    # Of the first piece q = t³ (1/2 − t + t²/2): jerk 3 − 24 t + 30 t², 9 at its end.
    assert trajectory.sample(1.0 - 1e-9, derivative=3)[0] == pytest.approx(9.0, abs=1e-6)
    assert trajectory.peak_rates()[2, 0] >= 9.0
