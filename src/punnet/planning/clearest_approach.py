"""A planner that is told from which side to come in: the one with most room between the other berries."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from punnet.errors import PlanningError
from punnet.movement import TrajectoryDistribution
from punnet.planning.clearance import approach_directions, obstacles_among
from punnet.planning.planner import Planner
from punnet.scene import Frame, Target

__all__ = ["ClearestApproachPlanner"]


@dataclass(eq=False)
class ClearestApproachPlanner:
    """Asks another planner for the approach with the widest clearance, then for the next one if it has none.

    A target that names its approach, or nothing of what hangs around it, is handed on as it is.

    Parameters
    ----------
    planner
        Plans the reaches; has to come in along ``target.approach``.
    """

    planner: Planner

    @property
    def name(self) -> str:
        """Name of both."""
        return f"{self.planner.name} + clearest approach"

    def plan(self, frame: Frame, target: Target, start: NDArray[np.float64]) -> TrajectoryDistribution:
        """Distribution of joint-space reaches from joints ``start`` (7,), along the clearest approach that can be planned.

        Raises
        ------
        PlanningError
            If none can; the reason is that of the clearest.
        """
        if target.picking_point is None or target.among is None or target.approach is not None:
            return self.planner.plan(frame, target, start)
        row = int(np.flatnonzero(target.among.ids == target.berry_id)[0])
        around = obstacles_among(frame, target.among, row)
        refusal = ""
        for direction in approach_directions(target.picking_point, around)[0]:
            try:
                return self.planner.plan(frame, replace(target, approach=direction), start)
            except PlanningError as error:
                refusal = refusal or str(error)
        raise PlanningError(refusal)
