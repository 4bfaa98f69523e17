"""A planner that looks where it goes: of many reaches drawn from another planner's distribution it takes the clearest.

The future work of the thesis (chapter 7). The planner's distribution says which reaches are natural; the observed scene
says which of them are free.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, PlanningError
from punnet.movement import TrajectoryDistribution
from punnet.planning.approach import angles_of_approach
from punnet.planning.collision_cost import CHECKED_PHASES, collision_costs, stems_caught
from punnet.planning.observed_scene import ObservedScene, observe
from punnet.planning.planner import Planner
from punnet.planning.straight_candidates import Candidates, draw_candidates, spread_offsets
from punnet.robot import Arm, Panda
from punnet.scene import Frame, Target

__all__ = ["CollisionAwarePlanner"]

WIDEST = np.deg2rad((40.0, 12.0, 12.0))
"""Radians of yaw, pitch and roll about the planned approach among which reaches are drawn."""
NARROW = np.deg2rad((8.0, 6.0, 12.0))
"""The same about an approach that was asked for."""

CERTAINLY_CAUGHT = 3.0
"""Of :func:`~punnet.planning.collision_cost.stems_caught`: from here on a neighbour was dragged along and the berry lost or
bruised in four of four picks, of 46 below 2 none was lost (plants of seeds 500 and 502)."""

_PER_TURN = 0.15  # cost of a squared radian of yaw, pitch and roll together
_PER_JOINT = 0.05  # and of joints away from the planned end
_LOW_MARGIN, _LOW_MANIPULABILITY, _UNCOMFORTABLE = (
    0.12,
    0.010,
    0.3,
)  # counts where it is worse than as planned


@dataclass(eq=False)
class CollisionAwarePlanner:
    """Draws reaches from another planner's distribution and takes the one that costs least in the observed scene.

    Parameters
    ----------
    planner
        Gives distributions over the arm's joints.
    arm
        The arm with its tool.
    draws
        Reaches to choose from.
    broadening
        Radians of standard deviation added to every weight of the distribution: room for other approaches.
    seed
        Of the draws: the same target gives the same reach.

    Raises
    ------
    ConfigurationError
        If there is nothing to choose from, or no room.
    """

    planner: Planner
    arm: Arm = field(default_factory=Panda)
    draws: int = 64
    broadening: float = 0.05
    seed: int = 0

    def __post_init__(self) -> None:
        if self.draws < 1 or not self.broadening > 0:
            raise ConfigurationError(
                f"collision-aware: draws must be ≥ 1 and broadening > 0, got {self.draws} and {self.broadening}"
            )

    @property
    def name(self) -> str:
        """Name of both."""
        return f"{self.planner.name} + collision-aware"

    def plan(self, frame: Frame, target: Target, start: NDArray[np.float64]) -> TrajectoryDistribution:
        """Distribution of joint-space reaches from joints ``start`` (J,); its mean is the reach that was chosen.

        Without a picking point there is nothing to come in straight at, and the planner's distribution is handed on; so
        it is if none of the drawn reaches is possible.

        Raises
        ------
        PlanningError
            If the planner has no reach, or gives poses in place of joints; ``no free approach: …`` if whichever way the tool
            comes in a neighbour's stem is between its fingers.
        """
        planned = self.planner.plan(frame, target, start)
        if target.picking_point is None:
            return planned
        if planned.space != "joint" or planned.dimensions != self.arm.joint_count:
            raise PlanningError(
                f"{self.name}: needs a distribution over {self.arm.joint_count} joints, got {planned.space} space"
            )
        q_start = np.asarray(start, dtype=np.float64)
        candidates = self.candidates(planned, target, q_start)
        scene = observe(frame, target)
        costs = self.costs(candidates, scene, planned)
        best = int(np.argmin(costs))
        if not np.isfinite(costs[best]):
            return planned
        poses = self.arm.forward_kinematics(candidates.trajectories(CHECKED_PHASES)[[best]])
        if stems_caught(scene, poses)[0] >= CERTAINLY_CAUGHT:
            raise PlanningError(
                f"no free approach: whichever way the tool comes in, a neighbour's stem would be dragged along with "
                f"berry {target.berry_id}"
            )
        return candidates.distribution(best, q_start)

    def candidates(
        self, planned: TrajectoryDistribution, target: Target, start: NDArray[np.float64]
    ) -> Candidates:
        """Reaches to choose from; the first comes in as planned, or along ``target.approach``."""
        assert target.picking_point is not None
        forward = self.arm.forward_kinematics_tool(planned.mean([1.0])[0])[:3, 2]
        yaw, pitch = angles_of_approach(forward if target.approach is None else target.approach)
        offsets = spread_offsets(self.draws, WIDEST if target.approach is None else NARROW)
        turns = offsets + np.array([yaw, pitch, 0.0])
        rng = np.random.default_rng(self.seed)
        return draw_candidates(rng, self.arm, planned, start, target.picking_point, turns, self.broadening)

    def costs(
        self, candidates: Candidates, scene: ObservedScene, planned: TrajectoryDistribution
    ) -> NDArray[np.float64]:
        """Cost (K,) of each reach; infinite where it is not possible."""
        poses = self.arm.forward_kinematics(candidates.trajectories(CHECKED_PHASES))
        ends = np.nan_to_num(candidates.joints[:, -1])
        away = np.square(ends - planned.mean([1.0])[0]).sum(axis=1)
        margin = np.maximum(self.arm.limit_margin(ends), 1e-3)
        dexterity = np.maximum(self.arm.manipulability(ends), 1e-4)
        discomfort = (_LOW_MARGIN / margin) ** 2 + (_LOW_MANIPULABILITY / dexterity) ** 2
        excess = np.maximum(discomfort - discomfort[0], 0.0)
        turned = np.arccos(np.clip((_trace(candidates) - 1.0) / 2.0, -1.0, 1.0)) ** 2
        cost = collision_costs(scene, poses).total
        cost = cost + _PER_TURN * turned + _PER_JOINT * away + _UNCOMFORTABLE * excess
        return np.where(candidates.possible, cost, np.inf)


def _trace(candidates: Candidates) -> NDArray[np.float64]:
    """Trace (K,) of the rotation between each approach and the first."""
    return np.asarray(np.einsum("ij,kij->k", candidates.rotations[0], candidates.rotations))
