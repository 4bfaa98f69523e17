"""Learned planners: deep-ProMP as the thesis has it (chapter 5), and ours."""

from punnet.train.planner.config import KINDS, QUICK, Kind, PlannerConfig
from punnet.train.planner.deep import DeepPrediction, fit_deep_promp
from punnet.train.planner.fitting import fit_planner
from punnet.train.planner.full import FullConfig, fit_full
from punnet.train.planner.keras_arrays import from_keras_arrays

__all__ = [
    "KINDS",
    "QUICK",
    "DeepPrediction",
    "FullConfig",
    "Kind",
    "PlannerConfig",
    "fit_deep_promp",
    "fit_full",
    "fit_planner",
    "from_keras_arrays",
]
