"""The rule of the cut: which stems the blade parts, and which it can't.

A stem is cut only when the blade comes within :data:`BLADE_REACH` of it, between :data:`CUT_ABOVE_CALYX` above the
calyx, and both grasping pads hold it.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim.cluster import STUB_LENGTH
from punnet.sim.picker import PAD_GEOMS
from punnet.sim.plant import STUB_PIECES
from punnet.sim.world import World

__all__ = ["BLADE_REACH", "CUT_ABOVE_CALYX", "StemState", "apply_cut", "gripped_berries", "stem_states"]

BLADE_REACH = 0.010
"""Metres from the blade's edge within which a stem is cut."""
CUT_ABOVE_CALYX = (0.005, 0.030)
"""Least and most height of the cut above the calyx, metres."""

_BLADE_HALF_WIDTH = 0.010
_BLADE_STROKE = 0.020  # its sharp part; farther back is the holder


@dataclass(frozen=True)
class StemState:
    """One berry's stem as the blade finds it; distances in metres."""

    berry: int
    distance: float
    height: float
    gripped: bool

    @property
    def can_be_cut(self) -> bool:
        """Whether the rule lets the blade part it."""
        return (
            self.gripped
            and self.distance <= BLADE_REACH
            and CUT_ABOVE_CALYX[0] <= self.height <= CUT_ABOVE_CALYX[1]
        )


def gripped_berries(world: World) -> set[int]:
    """Berries whose stub both pads touch."""
    pads = [world.model.geom(name).id for name in PAD_GEOMS]
    owner = {world.model.geom(name).id: berry.index for berry in world.planted for name in berry.stub}
    touched: list[set[int]] = [set(), set()]
    for first, second in world.data.contact.geom[: world.data.ncon]:
        for pad, berries in zip(pads, touched, strict=True):
            other = second if first == pad else first if second == pad else -1
            if other in owner:
                berries.add(owner[other])
    return touched[0] & touched[1]


def stem_states(world: World) -> list[StemState]:
    """How each berry that still hangs stands to the blade now."""
    edge = world.data.site("blade_edge")
    axes = np.array(edge.xmat).reshape(3, 3)
    swept = _Swept(np.array(edge.xpos), axes[:, 1], axes[:, 2])
    gripped = gripped_berries(world)
    states = []
    for berry, (T, attached) in enumerate(zip(world.berry_poses(), world.attached(), strict=True)):
        if attached:
            distance, height = _closest(T, swept)
            states.append(StemState(berry, distance, height, berry in gripped))
    return states


def apply_cut(world: World) -> list[int]:
    """Part every stem that the rule lets the blade part; the berries that came off."""
    came_off = []
    for state in stem_states(world):
        if state.can_be_cut:
            world.detach(state.berry)
            _drop_upper_stub(world, state.berry, state.height)
            came_off.append(state.berry)
    return came_off


@dataclass(frozen=True)
class _Swept:
    """Where the blade has been: from ``edge`` back along −``forward``, to both sides along ``across``, (3,) each."""

    edge: NDArray[np.float64]
    across: NDArray[np.float64]
    forward: NDArray[np.float64]


def _closest(T_base_berry: NDArray[np.float64], swept: _Swept) -> tuple[float, float]:
    """Distance between what the blade swept and the stub, and the height above the calyx where they are nearest."""
    heights = np.linspace(0.0, STUB_LENGTH, 37)
    stub = T_base_berry[:3, 3] + heights[:, None] * T_base_berry[:3, 2]
    offset = stub - swept.edge
    aside = np.clip(offset @ swept.across, -_BLADE_HALF_WIDTH, _BLADE_HALF_WIDTH)
    along = np.clip(offset @ swept.forward, -_BLADE_STROKE, 0.0)
    gap = offset - aside[:, None] * swept.across - along[:, None] * swept.forward
    distances = np.linalg.norm(gap, axis=1)
    nearest = int(np.argmin(distances))
    return float(distances[nearest]), float(heights[nearest])


def _drop_upper_stub(world: World, berry: int, height: float) -> None:
    above = [
        world.model.geom(name).id
        for piece, name in enumerate(world.planted[berry].stub)
        if piece * STUB_LENGTH / STUB_PIECES >= height
    ]
    world.part_stubs(np.array(above, dtype=np.int64))
    mujoco.mj_forward(world.model, world.data)
