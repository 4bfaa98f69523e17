"""Learned planners: deep-ProMP as the thesis has it (chapter 5)."""

from punnet.train.planner.config import KINDS, QUICK, Kind, PlannerConfig
from punnet.train.planner.deep import DeepPrediction, fit_deep_promp

__all__ = ["KINDS", "QUICK", "DeepPrediction", "Kind", "PlannerConfig", "fit_deep_promp"]
