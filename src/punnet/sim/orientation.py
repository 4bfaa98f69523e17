"""Orientations as MuJoCo takes them: quaternions with the scalar first, unlike everywhere else in Punnet."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["mujoco_quaternion"]


def mujoco_quaternion(rotation: ArrayLike) -> NDArray[np.float64]:
    """Quaternion (w, x, y, z) of a rotation (3, 3)."""
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation, dtype=np.float64).ravel())
    return quaternion
