"""One call for all that can be trained: the thesis' networks and ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.planning.reaches import Reaches
from punnet.train.detector.config import config_from_json
from punnet.train.planner.config import KINDS, QUICK, PlannerConfig
from punnet.train.planner.deep import DeepPrediction, fit_deep_promp
from punnet.train.planner.full import FullConfig, FullPrediction, fit_full

__all__ = ["ALL_KINDS", "AnyConfig", "fit_planner", "planner_config"]

AnyConfig = PlannerConfig | FullConfig
ALL_KINDS: tuple[str, ...] = ("full", *KINDS)


def planner_config(kind: str, changes: Mapping[str, Any], *, quick: bool = False) -> AnyConfig:
    """Settings of a kind with some changed; ``quick`` starts from a short training.

    Raises
    ------
    ConfigurationError
        If there is no such kind or setting, or it can't have that value.
    """
    if kind not in ALL_KINDS:
        raise ConfigurationError(f"planner: no kind '{kind}'; there are {', '.join(ALL_KINDS)}")
    if kind == "full":
        found: AnyConfig = config_from_json(FullConfig, changes)
    else:
        found = config_from_json(PlannerConfig, {"kind": kind, **(QUICK if quick else {}), **changes})
    return found


def fit_planner(
    config: AnyConfig,
    reaches: Reaches,
    *,
    seed: int,
    folder: Path,
    progress: Callable[[str], None],
    shared: Path | None = None,
    unlabelled: NDArray[Any] | None = None,
) -> DeepPrediction | FullPrediction:
    """Train a planner; what takes long goes on where it was stopped.

    Parameters
    ----------
    config, reaches, seed, folder, progress, shared, unlabelled
        As :func:`~punnet.train.planner.deep.fit_deep_promp`; ``full`` is fitted at once and needs the first two only.

    Raises
    ------
    ConfigurationError
        If there is too little to learn from, or a folder holds another network.
    Interrupted
        At Ctrl-C.
    """
    if isinstance(config, FullConfig):
        return fit_full(config, reaches)
    return fit_deep_promp(
        config, reaches, seed=seed, folder=folder, progress=progress, shared=shared, unlabelled=unlabelled
    )
