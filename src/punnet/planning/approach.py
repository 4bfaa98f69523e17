"""The straight way in: tool poses on a line that ends at the grip point.

The tool comes in along its z axis with x up, as it stands at home (:mod:`punnet.robot.tool`). Yaw turns it
about the vertical (positive to the left, +y), pitch raises its nose (positive up), roll turns it about its
own z axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError
from punnet.geometry import make_transform

__all__ = ["angles_of_approach", "approach_poses", "approach_rotation", "comfortable_angles"]

HOME_SIDE = -0.06  # y of the flange at home, metres: from there a berry straight ahead needs no yaw
YAW_SHARE = 0.6  # of the angle under which the berry is seen from the base; the wrist does not turn fully
LOW, HIGH = 0.58, 0.86  # metres above the table between which the comfortable pitch goes from …
# … to. Nose down, as at home: a level tool would need joint 6 at its limit for low berries, and at full
# stretch it brings the forearm, the tool and joint 1 through one point, where the wrist can't move sideways.
PITCH_LOW, PITCH_HIGH = np.deg2rad(-14.0), np.deg2rad(-8.0)


def approach_rotation(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike = 0.0) -> NDArray[np.float64]:
    """Rotations ``R_base_tool`` (..., 3, 3) for angles in radians.

    At zero the tool's x is up, its y the base's −y, its z the base's +x.
    """
    yaw, pitch, roll = np.broadcast_arrays(
        *(np.asarray(angle, dtype=np.float64) for angle in (yaw, pitch, roll))
    )
    cos_pitch, sin_pitch, zero = np.cos(pitch), np.sin(pitch), np.zeros_like(yaw)
    forward = np.stack((np.cos(yaw) * cos_pitch, np.sin(yaw) * cos_pitch, sin_pitch), axis=-1)
    right = np.stack((np.sin(yaw), -np.cos(yaw), zero), axis=-1)
    up = np.cross(right, forward)
    c, s = np.cos(roll)[..., None], np.sin(roll)[..., None]
    return np.stack((c * up + s * right, c * right - s * up, forward), axis=-1)


def angles_of_approach(direction: ArrayLike) -> tuple[float, float]:
    """Yaw and pitch in radians of a direction (3,) in the base frame.

    Raises
    ------
    ConfigurationError
        If the direction is within 5° of the vertical, where yaw means nothing, or no direction at all.
    """
    vector = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(vector))
    if (
        vector.shape != (3,)
        or not length > 0
        or np.hypot(vector[0], vector[1]) < np.sin(np.deg2rad(5)) * length
    ):
        raise ConfigurationError(f"approach: direction {vector} must be 3 numbers and not vertical")
    return float(np.arctan2(vector[1], vector[0])), float(np.arcsin(vector[2] / length))


def comfortable_angles(points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Yaw and pitch (...), radians, at which the arm reaches grip points (..., 3) without strain.

    Moderately turned towards the berry and nose down, more so for low berries.
    """
    p = np.asarray(points, dtype=np.float64)
    yaw = YAW_SHARE * np.arctan2(p[..., 1] - HOME_SIDE, p[..., 0])
    share = np.clip((p[..., 2] - LOW) / (HIGH - LOW), 0.0, 1.0)
    return np.asarray(yaw), np.asarray(PITCH_LOW + share * (PITCH_HIGH - PITCH_LOW))


def approach_poses(
    grip_point: ArrayLike, rotation: NDArray[np.float64], distances: ArrayLike
) -> NDArray[np.float64]:
    """Tool poses (..., P, 4, 4) before a grip point (..., 3), with one rotation (..., 3, 3).

    ``distances`` (P,) are metres back from it along the tool's z axis.
    """
    back = np.asarray(distances, dtype=np.float64)[:, None] * rotation[..., None, :, 2]
    return make_transform(rotation[..., None, :, :], np.asarray(grip_point)[..., None, :] - back)
