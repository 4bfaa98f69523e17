import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from punnet.errors import ShapeError
from punnet.geometry import (
    continuous_quaternions,
    invert_transform,
    is_transform,
    make_transform,
    pose_error,
    quaternion_angle,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
    transform_points,
    vector_from_rotation,
)

small = st.floats(-2.0, 2.0)
vectors = arrays(np.float64, 3, elements=small)


@settings(deadline=None, max_examples=60)
@given(vectors, vectors, arrays(np.float64, (5, 3), elements=small))
def test_inverse_undoes_a_transform(rotation, translation, points):
    T = make_transform(rotation_from_vector(rotation), translation)
    assert is_transform(T)
    assert np.allclose(T @ invert_transform(T), np.eye(4), atol=1e-12)
    assert np.allclose(transform_points(invert_transform(T), transform_points(T, points)), points, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(vectors, vectors)
def test_pose_error_is_the_distance_and_the_angle_between(rotation, translation):
    T = make_transform(rotation_from_vector(rotation), translation)
    distance, angle = pose_error(np.eye(4), T)
    assert np.isclose(distance, np.linalg.norm(translation))
    turned = np.linalg.norm(rotation) % (2 * np.pi)
    assert np.isclose(angle, min(turned, 2 * np.pi - turned), atol=1e-6)


@settings(deadline=None, max_examples=60)
@given(vectors)
def test_quaternions_and_rotations_agree(rotation):
    R = rotation_from_vector(rotation)
    q = quaternion_from_rotation(R)
    assert q[3] >= 0
    assert np.allclose(rotation_from_quaternion(q), R, atol=1e-12)
    assert np.allclose(rotation_from_vector(vector_from_rotation(R)), R, atol=1e-9)
    assert np.isclose(quaternion_angle(q, -q), 0.0, atol=1e-7)


def test_quaternion_of_a_quarter_turn_is_scalar_last():
    q = quaternion_from_rotation([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(q, [0, 0, np.sqrt(0.5), np.sqrt(0.5)])


def test_signs_are_made_continuous():
    angles = np.linspace(0, 3 * np.pi, 50)
    q = np.stack((np.sin(angles / 2), 0 * angles, 0 * angles, np.cos(angles / 2)), axis=1)
    broken = q * np.where(np.arange(50) % 3 == 0, -1, 1)[:, None]
    repaired = continuous_quaternions(broken)
    assert (np.einsum("ti,ti->t", repaired[1:], repaired[:-1]) > 0).all()


@pytest.mark.parametrize(
    "bad", [np.eye(3), np.diag([1.0, 1.0, -1.0, 1.0]), 2 * np.eye(4), np.full((4, 4), np.nan)]
)
def test_what_is_no_transform(bad):
    assert not is_transform(bad)


def test_shapes_are_named():
    with pytest.raises(ShapeError, match=r"\(4, 4\)"):
        transform_points(np.eye(3), np.zeros(3))
