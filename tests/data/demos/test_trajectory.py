from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.data.demos import Trajectory, WeightDistribution, as_poses
from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import GaussianBasis

TIMES = np.array([0.0, 0.5, 1.5])


def test_names_duration_and_values_in_between() -> None:
    trajectory = Trajectory(TIMES, np.array([[0.0, 1.0], [1.0, 1.0], [3.0, 0.0]]))
    assert trajectory.names == ("q1", "q2")
    assert trajectory.duration == 1.5
    np.testing.assert_allclose(trajectory.at([0.25, 1.0, 9.0]), [[0.5, 1.0], [2.0, 0.5], [3.0, 0.0]])
    np.testing.assert_allclose(trajectory.resampled(4)[:, 0], [0.0, 1.0, 2.0, 3.0])
    assert trajectory.lasting(3.0).times.tolist() == [0.0, 1.0, 3.0]
    with pytest.raises(ValueError, match="read-only"):
        trajectory.values[0, 0] = 3.0


@pytest.mark.parametrize(
    ("times", "values", "words"),
    [
        ([0.0], [[1.0]], "T ≥ 2"),
        ([0.0, 1.0], [[1.0], [2.0], [3.0]], r"must be \(2, D\)"),
        ([0.0, np.nan], [[1.0], [2.0]], "finite"),
        ([0.0, 1.0], [[1.0], [np.inf]], "finite"),
        ([0.0, 0.0], [[1.0], [2.0]], "increase"),
        ([1.0, 0.0], [[1.0], [2.0]], "increase"),
        ([0.0, 1.0], [[], []], r"must be \(2, D\)"),
        ([0.0, 1.0], [["a"], ["b"]], "numbers"),
    ],
)
def test_what_is_no_trajectory(times: list[float], values: list[list[float]], words: str) -> None:
    with pytest.raises(ShapeError, match=words):
        Trajectory(times, values)  # type: ignore[arg-type]


def test_settings_out_of_range() -> None:
    trajectory = Trajectory(TIMES, np.zeros((3, 1)))
    with pytest.raises(ConfigurationError, match="at least 2"):
        trajectory.resampled(1)
    with pytest.raises(ConfigurationError, match="positive"):
        trajectory.lasting(0.0)
    with pytest.raises(ShapeError, match="different names"):
        Trajectory(TIMES, np.zeros((3, 2)), ("a", "a"))
    with pytest.raises(ShapeError, match="space must be"):
        Trajectory(TIMES, np.zeros((3, 2)), space="tool")  # type: ignore[arg-type]


def test_poses_become_unit_and_sign_continuous() -> None:
    quaternions = np.array([[0.0, 0.0, 0.0, 2.0], [0.0, 0.1, 0.0, -1.0], [0.0, 0.2, 0.0, 0.9]])
    poses = as_poses(TIMES, np.hstack((np.zeros((3, 3)), quaternions)))
    np.testing.assert_allclose(np.linalg.norm(poses.values[:, 3:], axis=1), 1.0)
    assert (np.einsum("ti,ti->t", poses.values[1:, 3:], poses.values[:-1, 3:]) > 0.9).sum() == 2
    np.testing.assert_allclose(np.linalg.norm(poses.at([0.3, 0.7])[:, 3:], axis=1), 1.0)
    assert poses.names[3:] == ("qx", "qy", "qz", "qw")


def test_poses_that_are_none() -> None:
    with pytest.raises(ShapeError, match=r"\(T, 7\)"):
        as_poses(TIMES, np.zeros((3, 6)))
    with pytest.raises(ShapeError, match="zero"):
        as_poses(TIMES, np.zeros((3, 7)))
    with pytest.raises(ShapeError, match="unit length"):
        Trajectory(TIMES, np.ones((3, 7)), space="task")
    flipped = np.zeros((3, 7))
    flipped[:, 6] = [1.0, -1.0, 1.0]
    with pytest.raises(ShapeError, match="change sign"):
        Trajectory(TIMES, flipped, space="task")


def test_weights_speak_of_the_basis_that_movement_knows(rng: np.random.Generator) -> None:
    mean = rng.normal(size=(7, 8))
    root = rng.normal(size=(7, 8, 8))
    weights = WeightDistribution(mean, root @ root.swapaxes(1, 2), 0.07)
    phase = np.linspace(0.0, 1.0, 40)
    np.testing.assert_allclose(weights.basis_values(phase), GaussianBasis.recorded().phi(phase), atol=1e-14)
    np.testing.assert_allclose(weights.mean_values(phase), GaussianBasis.recorded().phi(phase) @ mean.T)
    assert weights.is_psd.all()
    assert weights.mean_trajectory(12).clock == "phase"
    phi = GaussianBasis.recorded().phi(phase)
    variances = np.array([np.diag(phi @ block @ phi.T) for block in weights.covariance]).T
    np.testing.assert_allclose(weights.std(phase), np.sqrt(variances))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 6), st.floats(1e-6, 10.0), st.integers(0, 2**31))
def test_a_block_with_a_negative_eigenvalue_is_no_covariance(joint: int, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(7, 8, 8))
    covariance = root @ root.swapaxes(1, 2)
    vector = np.linalg.qr(rng.normal(size=(8, 8)))[0][:, 0]
    largest = np.linalg.eigvalsh(covariance[joint])[-1]
    covariance[joint] -= (largest + size) * np.outer(vector, vector)
    assert WeightDistribution(np.zeros((7, 8)), covariance, 0.07).is_psd.tolist() == [
        number != joint for number in range(7)
    ]


def test_weights_that_are_none() -> None:
    with pytest.raises(ShapeError, match="symmetric"):
        WeightDistribution(np.zeros((1, 2)), np.array([[[1.0, 0.5], [0.0, 1.0]]]), 0.07)
    with pytest.raises(ShapeError, match="covariance"):
        WeightDistribution(np.zeros((1, 2)), np.zeros((1, 3, 3)), 0.07)
    with pytest.raises(ShapeError, match="width"):
        WeightDistribution(np.zeros((1, 2)), np.zeros((1, 2, 2)), 0.0)
    with pytest.raises(ShapeError, match="7 coordinates"):
        WeightDistribution(np.zeros((3, 2)), np.zeros((3, 2, 2)), 0.07, "task")
