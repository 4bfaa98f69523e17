"""Unit quaternions, scalar-last (x, y, z, w)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from punnet.errors import ShapeError

__all__ = [
    "continuous_quaternions",
    "quaternion_angle",
    "quaternion_from_rotation",
    "rotation_from_quaternion",
]


def quaternion_from_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) to unit quaternions (..., 4), with w ≥ 0."""
    rotation = np.asarray(rotation, dtype=np.float64)
    if rotation.shape[-2:] != (3, 3):
        raise ShapeError(f"quaternion_from_rotation: need (..., 3, 3), got {rotation.shape}")
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_quat(canonical=True)
    return np.asarray(flat, dtype=np.float64).reshape(*rotation.shape[:-2], 4)


def rotation_from_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (..., 4), normalised here, to rotations (..., 3, 3)."""
    quaternion = np.asarray(quaternion, dtype=np.float64)
    if quaternion.shape[-1:] != (4,):
        raise ShapeError(f"rotation_from_quaternion: need (..., 4), got {quaternion.shape}")
    flat = Rotation.from_quat(quaternion.reshape(-1, 4)).as_matrix()
    return np.asarray(flat, dtype=np.float64).reshape(*quaternion.shape[:-1], 3, 3)


def continuous_quaternions(quaternions: ArrayLike) -> NDArray[np.float64]:
    """Flip signs along a trajectory (T, 4) so that neighbours lie in the same hemisphere."""
    q = np.array(quaternions, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != 4:
        raise ShapeError(f"continuous_quaternions: need (T, 4), got {q.shape}")
    flips = np.where(np.einsum("ti,ti->t", q[1:], q[:-1]) < 0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips)[:, None]
    return q


def quaternion_angle(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Angle in radians, in [0, π], between unit quaternions (..., 4), element by element."""
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return np.asarray(4.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)), dtype=np.float64)
