"""The room that an arm and the picker take: spheres along them, for checks that must be quick and may be cautious."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ShapeError

if TYPE_CHECKING:
    from punnet.robot.arm import Arm

__all__ = [
    "PICKER_PIECES",
    "ArmShape",
    "Boxes",
    "Piece",
    "arm_spheres",
    "self_clearance",
    "structure_clearance",
]

_SPACING = 0.035

Point = tuple[float, float, float]
Piece = tuple[Point, Point, float]
"""A capsule in its frame: its two ends and its radius, metres."""

PICKER_PIECES: tuple[Piece, ...] = (
    ((0.0, 0.0, 0.01), (0.0, 0.0, 0.10), 0.042),
    ((0.0, -0.018, 0.10), (0.0, -0.018, 0.195), 0.018),
    ((0.0, 0.018, 0.10), (0.0, 0.018, 0.195), 0.018),
    ((0.026, -0.018, 0.10), (0.026, -0.018, 0.20), 0.014),
    ((0.026, 0.018, 0.10), (0.026, 0.018, 0.20), 0.014),
    ((0.080, -0.035, 0.031), (0.080, 0.035, 0.031), 0.022),
)
"""The picker and its camera, in a frame with the Panda's flange's axes: x up at home, z ahead."""


@dataclass(frozen=True, eq=False)
class ArmShape:
    """Spheres on the links of an arm.

    Parameters
    ----------
    part
        (S,) which part of the arm a sphere belongs to; parts are numbered along the arm.
    frame
        (S,) which of :meth:`~punnet.robot.arm.Arm.link_poses` it moves with.
    centre, radius
        (S, 3) in that frame and (S,), metres.
    together
        Pairs of parts that are never held against each other, smaller number first: neighbours, which always touch, and
        those between which there always is air.
    standing
        Parts up to this one stand on the arm's foot, which structure may come near to.

    Raises
    ------
    ShapeError
        If the shapes disagree or a radius is none.
    """

    part: NDArray[np.int64]
    frame: NDArray[np.int64]
    centre: NDArray[np.float64]
    radius: NDArray[np.float64]
    together: frozenset[tuple[int, int]]
    standing: int

    def __post_init__(self) -> None:
        count = len(self.part)
        if (
            self.frame.shape != (count,)
            or self.centre.shape != (count, 3)
            or self.radius.shape != (count,)
            or not (self.radius > 0).all()
        ):
            raise ShapeError(
                f"arm shape: need part (S,), frame (S,), centre (S, 3) and radius (S,) > 0, got {self.part.shape}, "
                f"{self.frame.shape}, {self.centre.shape}, {self.radius.shape}"
            )

    @cached_property
    def pairs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices (P,) and (P,) of spheres that could meet."""
        first, second = np.triu_indices(len(self.part), 1)
        parts = np.sort(np.stack((self.part[first], self.part[second]), axis=1), axis=1)
        apart = parts[:, 0] != parts[:, 1]
        for a, b in self.together:
            apart &= (parts[:, 0] != a) | (parts[:, 1] != b)
        return first[apart], second[apart]

    @classmethod
    def of_pieces(
        cls,
        pieces: tuple[tuple[int, int, Piece], ...],
        *,
        together: frozenset[tuple[int, int]],
        standing: int,
    ) -> ArmShape:
        """Spheres along capsules, each given with its part and frame."""
        rows = [
            (part, frame, centre, piece[2])
            for part, frame, piece in pieces
            for centre in spheres_along(piece)
        ]
        return cls(
            np.array([row[0] for row in rows]),
            np.array([row[1] for row in rows]),
            np.array([row[2] for row in rows]),
            np.array([row[3] for row in rows]),
            together,
            standing,
        )


def spheres_along(piece: Piece) -> NDArray[np.float64]:
    """Centres (N, 3) of spheres of a capsule's radius along its axis."""
    start, end = np.asarray(piece[0]), np.asarray(piece[1])
    count = max(2, round(float(np.linalg.norm(end - start)) / _SPACING) + 1)
    return np.asarray(start + np.linspace(0.0, 1.0, count)[:, None] * (end - start))


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


def arm_spheres(arm: Arm, joints: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (..., S, 3) in the base frame and radii (S,) of spheres that hold arm and picker, for joints (..., J)."""
    shape = arm.shape
    T = arm.link_poses(joints)[..., shape.frame, :, :]
    return np.einsum("...sij,sj->...si", T[..., :3, :3], shape.centre) + T[..., :3, 3], shape.radius


def self_clearance(arm: Arm, joints: ArrayLike) -> NDArray[np.float64]:
    """Least distance (...) between parts of the arm that are not neighbours, metres; negative if they may touch."""
    centres, radius = arm_spheres(arm, joints)
    first, second = arm.shape.pairs
    gap = np.linalg.norm(centres[..., first, :] - centres[..., second, :], axis=-1)
    return np.asarray((gap - radius[first] - radius[second]).min(axis=-1, initial=np.inf))


def structure_clearance(arm: Arm, joints: ArrayLike, structure: Boxes) -> NDArray[np.float64]:
    """Least distance (...) of arm and picker, but not of its foot, from structure, metres; infinite without any."""
    moving = arm.shape.part > arm.shape.standing
    centres, radius = arm_spheres(arm, joints)
    centres, radius = centres[..., moving, None, :], radius[moving]
    beyond = np.maximum(structure.low - centres, centres - structure.high)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    inside = np.minimum(beyond.max(axis=-1), 0.0)
    distance = outside + inside - radius[:, None]
    return np.asarray(distance.min(axis=(-2, -1), initial=np.inf))
