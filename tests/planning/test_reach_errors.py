"""Errors of predicted movements."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from punnet.errors import ShapeError
from punnet.planning.reach_errors import join_errors, reach_errors
from punnet.planning.reaches import Movements, Reaches, reaches_from
from punnet.robot import Panda


@pytest.fixture(scope="module")
def reaches(reach_demonstrations) -> Reaches:
    return reaches_from(reach_demonstrations)


def of_photographs(reaches: Reaches, space: str) -> Movements:
    return reaches.movements(space)[reaches.targets]


def test_what_was_demonstrated_has_no_error(reaches: Reaches) -> None:
    errors = reach_errors(of_photographs(reaches, "task"), reaches, "task")
    assert len(errors) == len(reaches)
    for values in (errors.means, errors.covariances, errors.off, errors.orientation):
        np.testing.assert_allclose(values, 0.0, atol=1e-9)
    # The demonstrated joints end where the demonstrated poses do, but for the mean of repeats being another one.
    joints = reach_errors(of_photographs(reaches, "joint"), reaches, "joint")
    assert joints.position.max() < 0.02
    np.testing.assert_allclose(joints.means, 0.0, atol=1e-12)
    # A tool that stands at the flange's demonstrated pose is at the grip point.
    assert np.nanmax(errors.tip) < 0.01


def test_errors_at_the_end_are_those_of_equation_6_2(reaches: Reaches) -> None:
    true = of_photographs(reaches, "task")
    last = reaches.basis.phi([1.0])[0]
    direction = last / (last @ last)
    shift = np.array([0.03, -0.04, 0.12, 0.0, 0.0, 0.0, 0.0])
    found = Movements(true.mean + shift[None, :, None] * direction, true.covariance)
    errors = reach_errors(found, reaches, "task")
    np.testing.assert_allclose(errors.off, np.tile(shift[:3], (len(reaches), 1)), atol=1e-9)
    np.testing.assert_allclose(errors.position, 0.13, atol=1e-9)
    np.testing.assert_allclose(errors.across, np.hypot(0.04, 0.12), atol=1e-9)


def test_orientation_is_half_the_turn_for_small_ones(reaches: Reaches) -> None:
    """‖q − q̂‖ = 2 sin(θ/4), whatever the sign of q̂."""
    true = of_photographs(reaches, "task")
    last = reaches.basis.phi([1.0])[0]
    ends = true.mean @ last
    angle = 0.2
    turned = (Rotation.from_rotvec([0.0, 0.0, angle]) * Rotation.from_quat(ends[:, 3:])).as_quat()
    shift = -turned - ends[:, 3:]  # of the other sign
    mean = true.mean.copy()
    mean[:, 3:] += shift[:, :, None] * last / (last @ last)
    errors = reach_errors(Movements(mean, true.covariance), reaches, "task")
    np.testing.assert_allclose(errors.orientation, 2 * np.sin(angle / 4), atol=1e-9)


def test_equation_5_13_is_that_of_the_whole_matrices(reaches: Reaches) -> None:
    rng = np.random.default_rng(0)
    true = of_photographs(reaches, "task")
    rows = rng.normal(scale=0.1, size=true.covariance.shape)
    found = Movements(true.mean + rng.normal(scale=0.1, size=true.mean.shape), rows @ rows.transpose(0, 2, 1))
    errors = reach_errors(found, reaches, "task")
    phi = reaches.basis.phi(np.linspace(0.0, 1.0, 150))
    B = reaches.basis.count
    for degree in (0, 5):
        off = phi @ (found.mean - true.mean)[3, degree]
        block = slice(degree * B, (degree + 1) * B)
        apart = phi @ (found.covariance - true.covariance)[3, block, block] @ phi.T
        assert errors.means[3, degree] == pytest.approx(np.mean(off**2))
        assert errors.covariances[3, degree] == pytest.approx(np.mean(apart**2))


@pytest.mark.parametrize("space", ["task", "joint"])
def test_a_calibrated_prediction_covers_what_it_says(reaches: Reaches, space: str) -> None:
    """Truth drawn from the prediction itself lies in its 50% and 90% regions 50% and 90% of the time."""
    rng = np.random.default_rng(1)
    many = reaches.subset(range(len(reaches.target_ids)))
    rows = np.arange(1500) % len(many)
    true = many.movements(space)[many.targets][rows]
    spread = 1e-4 * np.eye(true.covariance.shape[1])
    found = Movements(true.mean, np.tile(spread, (len(rows), 1, 1)))
    drawn = true.mean + rng.normal(scale=1e-2, size=true.mean.shape)
    ends = drawn @ many.basis.phi([1.0])[0]
    if space == "joint":
        ends = np.concatenate(
            (Panda().forward_kinematics(ends)[:, :3, 3], np.tile([0.0, 0.0, 0.0, 1.0], (len(ends), 1))),
            axis=1,
        )
    repeated = replace(
        many,
        pictures=many.pictures[rows],
        boxes=many.boxes[rows],
        targets=many.targets[rows],
        ends=ends,
        lights=many.lights[rows],
    )
    summary = reach_errors(found, repeated, space).summary()
    assert summary["coverage"]["0.5"] == pytest.approx(0.5, abs=0.05)
    assert summary["coverage"]["0.9"] == pytest.approx(0.9, abs=0.03)
    for share in ("0.5", "0.9"):
        for held in summary["coverage_by_axis"][share].values():
            assert held == pytest.approx(float(share), abs=0.05)
    json.dumps(summary, allow_nan=False)


def test_two_sigma_is_further_off_and_a_point_has_no_region(reaches: Reaches) -> None:
    true = of_photographs(reaches, "task")
    wide = Movements(true.mean, np.tile(1e-3 * np.eye(true.covariance.shape[1]), (len(true), 1, 1)))
    errors = reach_errors(wide, reaches, "task")
    sigma = np.sqrt(1e-3 * np.square(reaches.basis.phi([1.0])).sum())
    np.testing.assert_allclose(errors.wide_position, 2 * sigma * np.sqrt(3), rtol=1e-6)
    assert not errors.exact
    point = reach_errors(Movements(true.mean, np.zeros_like(true.covariance)), reaches, "task")
    assert point.exact
    assert point.summary()["coverage"] is None


def test_folds_are_joined_and_shapes_checked(reaches: Reaches) -> None:
    found = of_photographs(reaches, "task")
    errors = reach_errors(found, reaches, "task")
    assert len(join_errors([errors, errors])) == 2 * len(errors)
    with pytest.raises(ShapeError, match="44 predictions of 45"):
        reach_errors(found[np.arange(44)], reaches, "task")
