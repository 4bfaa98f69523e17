"""Rigid transforms. ``T_a_b`` (4×4) takes coordinates in frame b to frame a: ``p_a = T_a_b @ p_b``."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from punnet.errors import ShapeError

__all__ = [
    "invert_transform",
    "is_transform",
    "make_transform",
    "pose_error",
    "rotation_from_vector",
    "transform_points",
    "vector_from_rotation",
]


def make_transform(rotation: ArrayLike, translation: ArrayLike) -> NDArray[np.float64]:
    """Assemble (..., 4, 4) transforms from (..., 3, 3) rotations and (..., 3) translations in metres."""
    R = np.asarray(rotation, dtype=np.float64)
    t = np.asarray(translation, dtype=np.float64)
    if R.shape[-2:] != (3, 3) or t.shape[-1:] != (3,):
        raise ShapeError(f"make_transform: need (..., 3, 3) and (..., 3), got {R.shape} and {t.shape}")
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], t.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def invert_transform(T: ArrayLike) -> NDArray[np.float64]:
    """Inverse of rigid transforms (..., 4, 4), by transposing the rotation."""
    T = np.asarray(T, dtype=np.float64)
    if T.shape[-2:] != (4, 4):
        raise ShapeError(f"invert_transform: need (..., 4, 4), got {T.shape}")
    R_transposed = np.swapaxes(T[..., :3, :3], -1, -2)
    return make_transform(R_transposed, -np.einsum("...ij,...j->...i", R_transposed, T[..., :3, 3]))


def transform_points(T_a_b: ArrayLike, points_b: ArrayLike) -> NDArray[np.float64]:
    """Take points (..., 3) in frame b to frame a; ``T_a_b`` is one (4, 4) transform."""
    T = np.asarray(T_a_b, dtype=np.float64)
    points = np.asarray(points_b, dtype=np.float64)
    if T.shape != (4, 4) or points.shape[-1:] != (3,):
        raise ShapeError(f"transform_points: need (4, 4) and (..., 3), got {T.shape} and {points.shape}")
    return points @ T[:3, :3].T + T[:3, 3]


def is_transform(T: ArrayLike, *, tolerance: float = 1e-6) -> bool:
    """Whether T is a (4, 4) rigid transform: orthonormal, determinant +1, last row (0, 0, 0, 1)."""
    T = np.asarray(T, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        return False
    R = T[:3, :3]
    return bool(
        np.allclose(R @ R.T, np.eye(3), atol=tolerance)
        and np.linalg.det(R) > 0
        and np.allclose(T[3], (0.0, 0.0, 0.0, 1.0), atol=tolerance)
    )


def rotation_from_vector(vector: ArrayLike) -> NDArray[np.float64]:
    """Exponential map: rotation vectors (..., 3) in radians to rotations (..., 3, 3)."""
    vector = np.asarray(vector, dtype=np.float64)
    flat = Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix()
    return np.asarray(flat, dtype=np.float64).reshape(*vector.shape[:-1], 3, 3)


def vector_from_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Logarithm: rotations (..., 3, 3) to rotation vectors (..., 3), angle in [0, π]."""
    rotation = np.asarray(rotation, dtype=np.float64)
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat, dtype=np.float64).reshape(*rotation.shape[:-2], 3)


def pose_error(T_a: ArrayLike, T_b: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance in metres and angle in radians between poses (..., 4, 4), element by element."""
    T_a = np.asarray(T_a, dtype=np.float64)
    T_b = np.asarray(T_b, dtype=np.float64)
    distance = np.linalg.norm(T_a[..., :3, 3] - T_b[..., :3, 3], axis=-1)
    relative = np.swapaxes(T_a[..., :3, :3], -1, -2) @ T_b[..., :3, :3]
    return distance, np.linalg.norm(vector_from_rotation(relative), axis=-1)
