import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError
from punnet.geometry import is_transform
from punnet.planning.approach import (
    angles_of_approach,
    approach_poses,
    approach_rotation,
    comfortable_angles,
)

ANGLE = st.floats(-1.2, 1.2)


def test_at_zero_the_tool_looks_along_x_with_its_x_up() -> None:
    np.testing.assert_allclose(approach_rotation(0.0, 0.0), [[0, 0, 1], [0, -1, 0], [1, 0, 0]], atol=1e-15)


def test_signs_yaw_to_the_left_pitch_up_roll_about_the_tool() -> None:
    assert approach_rotation(0.2, 0.0)[1, 2] > 0
    assert approach_rotation(0.0, 0.2)[2, 2] > 0
    rolled = approach_rotation(0.3, 0.2, 0.4)
    plain = approach_rotation(0.3, 0.2)
    np.testing.assert_allclose(rolled[:, 2], plain[:, 2])
    np.testing.assert_allclose(plain.T @ rolled @ [1, 0, 0], [np.cos(0.4), np.sin(0.4), 0], atol=1e-12)


@given(ANGLE, ANGLE, ANGLE)
@settings(deadline=None, max_examples=50)
def test_poses_are_rigid_and_lie_on_the_line(yaw: float, pitch: float, roll: float) -> None:
    rotation, grip = approach_rotation(yaw, pitch, roll), np.array([0.7, 0.1, 0.6])
    poses = approach_poses(grip, rotation, [0.09, 0.03, 0.0])
    assert all(is_transform(pose) for pose in poses)
    np.testing.assert_allclose(
        poses[:, :3, 3] + np.array([[0.09], [0.03], [0.0]]) * rotation[:, 2], [grip] * 3
    )
    np.testing.assert_allclose(angles_of_approach(rotation[:, 2]), (yaw, pitch), atol=1e-9)


def test_batches_equal_single_calls() -> None:
    points = np.random.default_rng(0).uniform([0.7, -0.2, 0.6], [0.8, 0.2, 0.8], (4, 3))
    yaw, pitch = comfortable_angles(points)
    together = approach_poses(points, approach_rotation(yaw, pitch), [0.05, 0.0])
    for i, point in enumerate(points):
        one = approach_poses(point, approach_rotation(*comfortable_angles(point)), [0.05, 0.0])
        np.testing.assert_allclose(together[i], one, atol=1e-14)


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.01, 0.0, -1.0), (0.0, 0.0, 0.0), (1.0, 0.0)])
def test_directions_without_a_yaw_are_refused(direction: tuple[float, ...]) -> None:
    with pytest.raises(ConfigurationError, match="not vertical"):
        angles_of_approach(direction)
