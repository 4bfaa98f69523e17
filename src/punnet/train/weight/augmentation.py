"""Berries moved and turned at random, as the thesis does (section 4.2): the depth at which they hang stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

__all__ = ["move_points"]


def move_points(
    points: NDArray[np.float32], generator: np.random.Generator, *, shift: float, tilt: float, roll: float
) -> NDArray[np.float32]:
    """Turn each berry about its origin, and move it across the image plane.

    Parameters
    ----------
    points
        (B, N, 3) of B berries, metres, axes of the camera, each about its own middle.
    generator
        Draws a rotation and a shift a berry.
    shift
        Metres in x and in y, up to so much; the middle keeps its depth.
    tilt, roll
        Degrees about x and y, and about z, up to so much.

    Returns
    -------
    numpy.ndarray
        (B, N, 3) float32.
    """
    count = len(points)
    angles = generator.uniform(-1.0, 1.0, size=(count, 3)) * (tilt, tilt, roll)
    turns = Rotation.from_euler("xyz", angles, degrees=True).as_matrix().astype(np.float32)
    offsets = np.zeros((count, 1, 3), dtype=np.float32)
    offsets[:, 0, :2] = generator.uniform(-shift, shift, size=(count, 2))
    return np.asarray(points @ turns.transpose(0, 2, 1) + offsets)
