"""Regions that hold what they say."""

import numpy as np
import pytest
from scipy.stats import chi2

from punnet.planning.reaches import Reaches, reaches_from
from punnet.train.planner.calibration import doubt_of_ends, places
from punnet.train.planner.regression import LeftOut


@pytest.fixture(scope="module")
def reaches(reach_demonstrations) -> Reaches:
    return reaches_from(reach_demonstrations)


def test_regions_hold_what_was_left_out(reaches: Reaches, rng) -> None:
    M = len(reaches.target_ids)
    within = np.kron(np.eye(7), reaches.basis.phi([1.0]))
    within = within @ reaches.pose.covariance.mean(axis=0) @ within.T
    for scale in (0.003, 0.03):
        leverage = rng.uniform(0.0, 0.5, M)
        off = scale * np.sqrt(1.0 + leverage)[:, None] * rng.normal(size=(M, 7))
        doubt = doubt_of_ends("task", reaches, LeftOut(np.ones(7), off, leverage, 2.5), within)
        assert np.linalg.eigvalsh(doubt).min() > 0
        told = (off - (reaches.pose.mean @ reaches.basis.phi([1.0])[0]))[reaches.targets] + reaches.ends
        region = ((1.0 + leverage)[:, None, None] * doubt)[reaches.targets][:, :3, :3]
        distance = np.einsum("pk,pkl,pl->p", told[:, :3], np.linalg.inv(region), told[:, :3])
        assert (distance < chi2.ppf(0.5, 3)).mean() == pytest.approx(0.5, abs=0.2)
        assert (distance < chi2.ppf(0.9, 3)).mean() == pytest.approx(0.9, abs=0.1)


def test_joints_count_by_where_they_take_the_flange(reaches: Reaches) -> None:
    joint, task = places("joint", reaches), places("task", reaches)
    assert joint.shape == task.shape == (15, 3, 7)
    np.testing.assert_array_equal(task[0] @ np.arange(7.0), [0.0, 1.0, 2.0])
    assert np.abs(joint[:, :, 6]).max() < 1e-9  # the last joint turns the flange on the spot
