"""Planners measured on plants or scenes that they have not seen: leaving groups out in turn, over seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from punnet.errors import ConfigurationError
from punnet.movement.distribution import Space
from punnet.planning.reach_errors import ReachErrors, join_errors, reach_errors
from punnet.planning.reaches import Reaches
from punnet.train.planner.baselines import BASELINES, baseline, needs_points
from punnet.train.planner.fitting import AnyConfig, fit_planner
from punnet.train.planner.prediction import Prediction
from punnet.train.planner.regression import fold_numbers

__all__ = ["FOLDS", "Measured", "leave_groups_out", "measure", "usable_baselines"]

FOLDS = 8
"""Most folds; with fewer groups each is left out by itself."""
Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Measured:
    """Errors of one planner.

    Parameters
    ----------
    name
        Of the planner.
    space
        That it predicts in.
    runs
        Errors on all groups, one a seed.
    """

    name: str
    space: Space
    runs: tuple[ReachErrors, ...]

    def to_json(self) -> dict[str, Any]:
        """Means over seeds; ``spread`` has the standard deviations of the errors at the end over seeds, if there are more."""
        summaries = [run.summary() for run in self.runs]
        result = {"planner": self.name, "space": self.space, "seeds": len(self.runs), **_averaged(summaries)}
        if len(summaries) > 1:
            result["spread"] = {
                key: float(np.std([s[key] for s in summaries], ddof=1))
                for key in ("position_m", "orientation")
            }
        return result


def measure(prediction: Prediction, reaches: Reaches) -> Measured:
    """A trained planner on reaches that it has not seen."""
    return Measured(
        prediction.name,
        prediction.space,
        (reach_errors(prediction.predict(reaches), reaches, prediction.space),),
    )


def leave_groups_out(
    planner: AnyConfig | str,
    reaches: Reaches,
    *,
    space: Space,
    seeds: Sequence[int],
    folder: Path,
    progress: Tell,
) -> Measured:
    """Fit without each group in turn (without folds of them where there are more than eight), and measure on it.

    Parameters
    ----------
    planner
        Settings of a learned one, or the name of a baseline.
    reaches
        What to learn from and to be measured on: never the same group in both.
    space
        For a baseline.
    seeds
        One run of all folds for each.
    folder
        Where trainings keep what a stopped call goes on from.
    progress
        Told how it goes.

    Raises
    ------
    ConfigurationError
        If there is one group only, or a baseline needs what the reaches do not have.
    """
    folds = fold_numbers(reaches.groups, FOLDS)
    if len(np.unique(folds)) < 2:
        raise ConfigurationError(f"{reaches.name}: all of one plant or scene; nothing can be left out")
    name, runs = "", []
    for seed in seeds:
        parts = []
        for fold in np.unique(folds):
            seen, unseen = (
                reaches.subset(np.flatnonzero(folds != fold)),
                reaches.subset(np.flatnonzero(folds == fold)),
            )
            if isinstance(planner, str):
                prediction: Prediction = baseline(planner, seen, space, seed)
            else:
                place = folder / f"seed-{seed}" / f"without-{fold}"
                prediction = fit_planner(
                    planner,
                    seen,
                    seed=seed,
                    folder=place / planner.name,
                    shared=place / "shared",
                    progress=progress,
                )
            name, space = prediction.name, prediction.space
            parts.append(reach_errors(prediction.predict(unseen), unseen, prediction.space))
        progress(f"{name}, seed {seed}: {len(parts)} folds measured")
        runs.append(join_errors(parts))
    return Measured(name, space, tuple(runs))


def usable_baselines(reaches: Reaches) -> list[str]:
    """Names of the baselines that these reaches allow."""
    known = bool(np.isfinite(reaches.points).all())
    return [name for name in BASELINES if known or not needs_points(name)]


def _averaged(values: Sequence[Any]) -> Any:
    """Means of equal structures of numbers."""
    first = values[0]
    if isinstance(first, dict):
        return {key: _averaged([value[key] for value in values]) for key in first}
    if isinstance(first, list):
        return [_averaged(list(column)) for column in zip(*values, strict=True)]
    return first if first is None or isinstance(first, int) else float(np.mean(values))
