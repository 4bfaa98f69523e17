"""Punnets on weigh cells beside the robot."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim.layers import ARM_VISUAL, STRUCTURE

__all__ = ["PUNNET_PLACES", "PUNNET_SIZE", "add_punnets", "inside_punnet"]

PUNNET_SIZE = (0.115, 0.175, 0.075)
"""Inner length (x), width (y) and height of a punnet, metres."""
PUNNET_PLACES: NDArray[np.float64] = np.array([[0.36, 0.42, 0.29], [0.50, 0.42, 0.29]])
"""Centre of each punnet's floor, (P, 3) in the base frame."""

_WALL = 0.002
_CLEAR = (0.86, 0.90, 0.94, 0.35)
_CELL = (0.25, 0.27, 0.30, 1.0)
# A soft liner: a berry that falls a few centimetres meets about 1 N/mm.
_LINER = (0.012, 1.0)


def add_punnets(spec: mujoco.MjSpec) -> None:
    """Stand a punnet on a weigh cell at each of :data:`PUNNET_PLACES`."""
    length, width, height = PUNNET_SIZE
    for number, place in enumerate(PUNNET_PLACES):
        body = spec.worldbody.add_body(name=f"punnet{number}", pos=place)
        sides = (
            ((length / 2, width / 2, _WALL), (0.0, 0.0, -_WALL)),
            ((_WALL, width / 2, height / 2), (length / 2 + _WALL, 0.0, height / 2)),
            ((_WALL, width / 2, height / 2), (-length / 2 - _WALL, 0.0, height / 2)),
            ((length / 2, _WALL, height / 2), (0.0, width / 2 + _WALL, height / 2)),
            ((length / 2, _WALL, height / 2), (0.0, -width / 2 - _WALL, height / 2)),
        )
        for half_size, position in sides:
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=half_size,
                pos=position,
                rgba=_CLEAR,
                contype=STRUCTURE[0],
                conaffinity=STRUCTURE[1],
                group=ARM_VISUAL,
                friction=(0.8, 0.02, 0.01),
                solref=_LINER,
                condim=6,
            )
        cell_height = (place[2] - 2 * _WALL) / 2
        body.add_geom(
            name=f"weigh_cell{number}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(length / 2 - 0.01, width / 2 - 0.02, cell_height),
            pos=(0.0, 0.0, -2 * _WALL - cell_height),
            rgba=_CELL,
            contype=STRUCTURE[0],
            conaffinity=STRUCTURE[1],
            group=ARM_VISUAL,
        )


def inside_punnet(position: NDArray[np.float64]) -> int | None:
    """Number of the punnet that holds ``position`` (3,) in the base frame, None if none does."""
    length, width, height = PUNNET_SIZE
    for number, place in enumerate(PUNNET_PLACES):
        offset = position - place
        if (
            abs(offset[0]) <= length / 2
            and abs(offset[1]) <= width / 2
            and -0.01 <= offset[2] <= height + 0.02
        ):
            return number
    return None
