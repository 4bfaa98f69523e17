"""Grams by eye, before picking: silhouette, depth and intrinsics to a volume, a weight and its interval."""

from punnet.weight.choosing import load_weight_estimator
from punnet.weight.cloud import berry_points, relief_height
from punnet.weight.ellipsoid import EllipsoidConfig, EllipsoidEstimator
from punnet.weight.estimator import WeightEstimates, WeightEstimator
from punnet.weight.features import feature_matrix, feature_names
from punnet.weight.learned import LearnedWeightEstimator
from punnet.weight.metrics import PCW_TOLERANCES, WeightErrors, percent_correct_weight, weight_errors
from punnet.weight.observation import BerryObservation, observe
from punnet.weight.silhouette import Silhouette, hidden_share, measure_silhouette

__all__ = [
    "PCW_TOLERANCES",
    "BerryObservation",
    "EllipsoidConfig",
    "EllipsoidEstimator",
    "LearnedWeightEstimator",
    "Silhouette",
    "WeightErrors",
    "WeightEstimates",
    "WeightEstimator",
    "berry_points",
    "feature_matrix",
    "feature_names",
    "hidden_share",
    "load_weight_estimator",
    "measure_silhouette",
    "observe",
    "percent_correct_weight",
    "relief_height",
    "weight_errors",
]
