"""The room that the arm and the picker take: spheres along them, for checks that must be quick and may be cautious."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError
from punnet.robot.panda import Panda

__all__ = ["Boxes", "arm_spheres", "self_clearance", "structure_clearance"]

_SPACING = 0.035

# Parts in order along the arm. A piece is: part, frame, its two ends in that frame, radius; metres.
# Frames 1 … 7 are the links' by modified Denavit–Hartenberg (see panda.py), 8 is the flange, 0 the base.
BASE, SHOULDER, UPPER_ARM, FOREARM, WRIST, PICKER = range(6)
_PIECES = (
    (BASE, 0, (0.0, 0.0, 0.06), (0.0, 0.0, 0.20), 0.085),
    (BASE, 0, (-0.09, -0.03, 0.05), (-0.09, 0.03, 0.05), 0.085),
    (BASE, 0, (-0.05, 0.0, 0.06), (0.0, 0.0, 0.06), 0.085),
    (SHOULDER, 1, (0.0, 0.0, -0.10), (0.0, 0.0, 0.0), 0.085),
    (SHOULDER, 2, (0.0, 0.0, -0.07), (0.0, 0.0, 0.07), 0.075),
    (UPPER_ARM, 3, (0.0, 0.0, -0.20), (0.0, 0.0, 0.0), 0.075),
    (UPPER_ARM, 4, (0.0, 0.0, -0.07), (0.0, 0.0, 0.07), 0.070),
    (FOREARM, 5, (0.0, 0.0, -0.33), (0.0, 0.0, -0.22), 0.070),
    (FOREARM, 5, (0.0, 0.03, -0.20), (0.0, 0.075, -0.02), 0.055),
    (WRIST, 6, (0.0, 0.0, -0.06), (0.0, 0.0, 0.02), 0.070),
    (WRIST, 6, (0.03, 0.015, 0.0), (0.08, 0.015, 0.0), 0.070),
    (WRIST, 7, (0.0, 0.0, 0.02), (0.0, 0.0, 0.09), 0.055),
    (WRIST, 7, (0.02, 0.02, 0.08), (0.048, 0.048, 0.08), 0.048),
    (PICKER, 8, (0.0, 0.0, 0.01), (0.0, 0.0, 0.10), 0.042),
    (PICKER, 8, (0.0, -0.018, 0.10), (0.0, -0.018, 0.195), 0.018),
    (PICKER, 8, (0.0, 0.018, 0.10), (0.0, 0.018, 0.195), 0.018),
    (PICKER, 8, (0.026, -0.018, 0.10), (0.026, -0.018, 0.20), 0.014),
    (PICKER, 8, (0.026, 0.018, 0.10), (0.026, 0.018, 0.20), 0.014),
    (PICKER, 8, (0.080, -0.035, 0.031), (0.080, 0.035, 0.031), 0.022),
)
# Neighbours along the arm always touch; between the others there is air.
_NEXT_TO = {(BASE, SHOULDER), (SHOULDER, UPPER_ARM), (UPPER_ARM, FOREARM), (FOREARM, WRIST), (WRIST, PICKER)}
_ALWAYS_CLEAR = {(BASE, UPPER_ARM)}


@dataclass(frozen=True, eq=False)
class Boxes:
    """Structure: boxes with sides along the base frame's axes, lowest corners (B, 3) and highest corners (B, 3), metres.

    Raises
    ------
    ShapeError
        If the shapes disagree or a box has no extent.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.low.ndim != 2 or self.low.shape[1:] != (3,) or self.high.shape != self.low.shape:
            raise ShapeError(f"boxes: need (B, 3) and (B, 3), got {self.low.shape} and {self.high.shape}")
        if not (self.high > self.low).all():
            raise ShapeError("boxes: each must have its lowest corner below its highest")

    @classmethod
    def none(cls) -> Boxes:
        """No structure at all."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)))


@cache
def _spheres() -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Part (S,), frame (S,), centre in that frame (S, 3) and radius (S,)."""
    rows: list[tuple[int, int, NDArray[np.float64], float]] = []
    for part, frame, start, end, radius in _PIECES:
        length = float(np.linalg.norm(np.subtract(end, start)))
        for share in np.linspace(0.0, 1.0, max(2, round(length / _SPACING) + 1)):
            rows.append((part, frame, np.asarray(start) + share * np.subtract(end, start), radius))
    return (
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([row[3] for row in rows]),
    )


def arm_spheres(arm: Panda, joints: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (..., S, 3) in the base frame and radii (S,) of spheres that hold arm and picker, for joints (..., 7)."""
    _, frame, centre, radius = _spheres()
    T = arm.link_poses(joints)[..., frame, :, :]
    return np.einsum("...sij,sj->...si", T[..., :3, :3], centre) + T[..., :3, 3], radius


def self_clearance(arm: Panda, joints: ArrayLike) -> NDArray[np.float64]:
    """Least distance (...) between parts of the arm that are not neighbours, metres; negative if they may touch."""
    centres, radius = arm_spheres(arm, joints)
    first, second = _pairs()
    gap = np.linalg.norm(centres[..., first, :] - centres[..., second, :], axis=-1)
    return np.asarray((gap - radius[first] - radius[second]).min(axis=-1))


def structure_clearance(arm: Panda, joints: ArrayLike, structure: Boxes) -> NDArray[np.float64]:
    """Least distance (...) of arm and picker, but not of its base, from structure, metres; infinite without any."""
    part = _spheres()[0]
    moving = part > SHOULDER
    centres, radius = arm_spheres(arm, joints)
    centres, radius = centres[..., moving, None, :], radius[moving]
    beyond = np.maximum(structure.low - centres, centres - structure.high)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    inside = np.minimum(beyond.max(axis=-1), 0.0)
    distance = outside + inside - radius[:, None]
    return np.asarray(distance.min(axis=(-2, -1), initial=np.inf))


@cache
def _pairs() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (P,) and (P,) of spheres that could meet."""
    part = _spheres()[0]
    apart = {
        (a, b)
        for a in range(PICKER + 1)
        for b in range(a + 1, PICKER + 1)
        if (a, b) not in _NEXT_TO | _ALWAYS_CLEAR
    }
    both = [(i, j) for i in range(len(part)) for j in range(len(part)) if (part[i], part[j]) in apart]
    return np.array([i for i, _ in both]), np.array([j for _, j in both])
