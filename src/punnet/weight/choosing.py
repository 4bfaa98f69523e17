"""Weight estimators by name: what ``--estimator`` takes, and what is used without it."""

from __future__ import annotations

from pathlib import Path

from punnet.bundle import list_bundles
from punnet.weight.ellipsoid import EllipsoidEstimator
from punnet.weight.estimator import WeightEstimator
from punnet.weight.learned import LearnedWeightEstimator

__all__ = ["ELLIPSOID", "SHIPPED_ESTIMATOR", "default_weight_estimator", "load_weight_estimator"]

ELLIPSOID = "ellipsoid"

SHIPPED_ESTIMATOR = "weight-shape"
"""The bundle that weighs unless told otherwise."""


def default_weight_estimator() -> str:
    """Name of what weighs unless told otherwise: the bundle that comes with the package, or geometry without it."""
    shipped = {manifest.name for manifest in list_bundles()}
    return SHIPPED_ESTIMATOR if SHIPPED_ESTIMATOR in shipped else ELLIPSOID


def load_weight_estimator(source: str | Path | None = None) -> WeightEstimator:
    """Make a weight estimator ready.

    Parameters
    ----------
    source
        ``ellipsoid`` for geometry alone, the name of a bundle that comes with the package, or a bundle's folder; None
        takes :func:`default_weight_estimator`.

    Raises
    ------
    BundleError
        If there is no such bundle, or it is damaged or weighs nothing.
    """
    source = default_weight_estimator() if source is None else source
    return EllipsoidEstimator() if source == ELLIPSOID else LearnedWeightEstimator.from_bundle(source)
