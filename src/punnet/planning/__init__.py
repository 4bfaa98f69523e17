"""Planning: from what a camera saw and a target berry to a distribution of reaches."""

from punnet.planning.clearest_approach import ClearestApproachPlanner
from punnet.planning.deep_promp import DeepProMPPlanner, FusedPlanner
from punnet.planning.named import planner_named
from punnet.planning.planner import Planner
from punnet.planning.plot import plot_distribution
from punnet.planning.promp_depth import APPROACH_DISTANCE, APPROACH_PHASE, ProMPDepthPlanner

__all__ = [
    "APPROACH_DISTANCE",
    "APPROACH_PHASE",
    "ClearestApproachPlanner",
    "DeepProMPPlanner",
    "FusedPlanner",
    "Planner",
    "ProMPDepthPlanner",
    "planner_named",
    "plot_distribution",
]
