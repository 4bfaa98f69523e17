"""Planners by name: what ``--planner`` takes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from punnet.errors import ConfigurationError
from punnet.planning.deep_promp import DeepProMPPlanner, FusedPlanner
from punnet.planning.planner import Planner
from punnet.planning.promp_depth import ProMPDepthPlanner
from punnet.robot import Arm

__all__ = ["DEFAULT_PLANNER", "PLANNERS", "planner_named"]

Maker = Callable[..., Planner]


PLANNERS: dict[str, Maker] = {
    "promp-depth": ProMPDepthPlanner.from_bundle,
    "deep-promp": DeepProMPPlanner.from_bundle,
    "fused": FusedPlanner.from_bundle,
}
"""``promp-depth``: demonstrated reaches conditioned on the berry's place; ``deep-promp``: a reach told from one colour
photograph; ``fused``: that, conditioned on the berry's place."""

DEFAULT_PLANNER = "fused"


def planner_named(name: str, *, arm: Arm | None = None, bundle: str | Path | None = None) -> Planner:
    """A planner of one of these names.

    Parameters
    ----------
    name
        One of :data:`PLANNERS`.
    arm
        The arm with its tool; a Panda if not given.
    bundle
        What it learnt: a bundle's name (``NAME:MODEL`` for another than its first model), its folder, or a training run;
        the one that comes with the package if not given.

    Raises
    ------
    ConfigurationError
        If there is no such planner.
    BundleError
        If the bundle is damaged or of another kind.
    """
    if name not in PLANNERS:
        raise ConfigurationError(f"planner: no planner '{name}'; there are {', '.join(PLANNERS)}")
    return PLANNERS[name](*(() if bundle is None else (bundle,)), arm=arm)
