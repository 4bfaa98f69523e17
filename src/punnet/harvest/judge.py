"""What really happened, by the simulator's truth: the robot's own belief is not taken for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import invert_transform, make_transform
from punnet.planning.approach import approach_rotation, comfortable_angles
from punnet.robot import nearest_solutions
from punnet.sim.contacts import BRUISING_FORCE
from punnet.sim.punnets import inside_punnet
from punnet.sim.truth import true_picking_points
from punnet.sim.world import World

__all__ = ["TOUCH_FORCE", "Fate", "judge", "reachable_berries"]

TOUCH_FORCE = 1.0
"""Newtons of the tool on a berry above which it counts as a collision."""

_APPROACH_DISTANCE = 0.09
_YAWS = np.deg2rad((0.0, -15.0, 15.0, -30.0, 30.0))
_PITCHES = np.deg2rad((0.0, -10.0, 10.0))


@dataclass(frozen=True)
class Fate:
    """One berry at the end of a run."""

    index: int
    stage: str
    pluckable: bool
    reachable: bool
    mass: float
    detached: bool
    punnet: int | None
    peak_force: float
    tool_force: float

    @property
    def damaged(self) -> bool:
        """Whether it was pressed harder than :data:`~punnet.sim.contacts.BRUISING_FORCE`."""
        return self.peak_force > BRUISING_FORCE

    @property
    def wrongly_picked(self) -> bool:
        """Whether it came off and should not have."""
        return self.detached and not self.pluckable

    @property
    def collided(self) -> bool:
        """Whether the tool ran into it and left it on the plant."""
        return not self.detached and self.tool_force > TOUCH_FORCE

    @property
    def success(self) -> bool:
        """A reachable, pluckable berry that lies in a punnet."""
        return self.pluckable and self.reachable and self.punnet is not None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "index": self.index,
            "stage": self.stage,
            "pluckable": self.pluckable,
            "reachable": self.reachable,
            "mass_g": round(self.mass, 2),
            "detached": self.detached,
            "punnet": self.punnet,
            "peak_force_n": round(self.peak_force, 2),
            "tool_force_n": round(self.tool_force, 2),
            "damaged": self.damaged,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Fate:
        """Read what :meth:`to_json` wrote; a missing value is a :class:`KeyError`."""
        return cls(
            index=int(data["index"]),
            stage=str(data["stage"]),
            pluckable=bool(data["pluckable"]),
            reachable=bool(data["reachable"]),
            mass=float(data["mass_g"]),
            detached=bool(data["detached"]),
            punnet=data["punnet"],
            peak_force=float(data["peak_force_n"]),
            tool_force=float(data["tool_force_n"]),
        )


def reachable_berries(world: World) -> NDArray[np.bool_]:
    """(N,) whether the arm can bring the tool to each berry's stem, 90 mm straight in, from one of 15 directions.

    Kinematics alone: neither what hangs in the way nor whether the camera sees the berry counts.
    """
    arm = world.arm
    reachable = np.zeros(world.berries, dtype=np.bool_)
    for index, point in enumerate(true_picking_points(world)):
        yaw, pitch = comfortable_angles(point)
        rotations = approach_rotation(*np.meshgrid(yaw + _YAWS, pitch + _PITCHES)).reshape(-1, 3, 3)
        grip = make_transform(rotations, np.broadcast_to(point, (len(rotations), 3)))
        before = make_transform(rotations, point - _APPROACH_DISTANCE * rotations[:, :, 2])
        flange_tool = invert_transform(arm.T_flange_tool)
        solved = [
            np.isfinite(nearest_solutions(poses @ flange_tool, arm.home, arm=arm)).all(axis=1)
            for poses in (grip, before)
        ]
        reachable[index] = bool((solved[0] & solved[1]).any())
    return reachable


def judge(world: World, reachable: NDArray[np.bool_]) -> list[Fate]:
    """The fate of every berry; ``reachable`` is :func:`reachable_berries` of the world before the run."""
    attached = world.attached()
    fates = []
    for hanging, T in zip(world.cluster.berries, world.berry_poses(), strict=True):
        index = hanging.index
        fates.append(
            Fate(
                index=index,
                stage=hanging.berry.stage.name.lower(),
                pluckable=bool(hanging.berry.stage.pluckable),
                reachable=bool(reachable[index]),
                mass=float(hanging.berry.mass),
                detached=not attached[index],
                punnet=None if attached[index] else inside_punnet(T[:3, 3]),
                peak_force=float(world.contacts.peak_on_berry[index]),
                tool_force=float(world.contacts.tool_peak_on_berry[index]),
            )
        )
    return fates
