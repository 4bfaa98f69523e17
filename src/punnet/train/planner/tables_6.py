"""Tables 6.1 to 6.4 of the thesis and the numbers of figure 6.12: ours beside its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.thesis_tables import BETWEEN_NUMBERS, NOTHING, MarkdownTable
from punnet.movement.distribution import Space
from punnet.planning.reach_errors import COORDINATES, ReachErrors, reach_errors
from punnet.train.planner.baselines import baseline
from punnet.train.planner.chapter_6 import SPACES, ChapterSix
from punnet.train.planner.comparison import usable_baselines
from punnet.train.planner.executed import Executed
from punnet.train.planner.full import FullConfig, fit_full

__all__ = [
    "THESIS_6_1",
    "THESIS_6_2",
    "THESIS_6_3",
    "THESIS_6_4",
    "ChapterErrors",
    "chapter_errors",
    "figure_6_12",
    "table_6_1",
    "table_6_2",
    "table_6_3",
    "table_6_4",
]

UNIT = 1e-4
THESIS_6_1: dict[str, tuple[float, ...]] = {
    "ae": (5.4, 48.9, 93.0, 37.1, 24.2, 29.0, 21.4),
    "vae": (1.30, 14.4, 9.60, 19.3, 23.5, 15.4, 5.40),
    "cvae": (1.00, 9.00, 5.90, 5.90, 20.1, 15.4, 5.40),
}
"""Eq. 5.13 by joint, in 1e-4."""
THESIS_6_2: dict[str, tuple[float, ...]] = {
    "ae": (1.40, 15.31, 0.92, 1.53, 24.2, 1.15, 0.78),
    "vae": (1.40, 7.05, 0.12, 0.57, 4.10, 0.37, 0.36),
    "cvae": (1.40, 0.88, 0.12, 0.57, 1.56, 0.21, 0.33),
}
"""Eq. 5.13 by coordinate, in 1e-4."""
MEASURES = ("position_m", "orientation", "position_2_sigma_m", "orientation_2_sigma")
THESIS_6_3: dict[str, tuple[float, ...]] = {
    "direct-joint": (0.15, 0.10, 0.31, 0.41),
    "ae-joint": (0.10, 0.06, 0.32, 0.41),
    "vae-joint": (0.06, 0.03, 0.19, 0.31),
    "cvae-joint": (0.04, 0.02, 0.18, 0.28),
    "direct-task": (0.08, 0.06, 0.10, 0.10),
    "ae-task": (0.04, 0.04, 0.09, 0.07),
    "vae-task": (0.03, 0.03, 0.07, 0.06),
    "cvae-task": (0.02, 0.02, 0.06, 0.06),
}
"""Position and orientation of Eq. 6.2, of the mean and at 2σ."""
THESIS_6_4 = {"ae": (0.616, 0.482), "vae": (0.424, 0.352)}
"""Davies–Bouldin before and after tuning."""
NETWORKS = ("direct", "ae", "l-ae", "vae", "l-vae", "cvae", "l-cvae")
TUNED = ("ae", "vae", "cvae")


@dataclass(frozen=True, eq=False)
class ChapterErrors:
    """Errors on the unseen reaches.

    Parameters
    ----------
    runs
        By name of network or baseline, one a seed; baselines have one.
    learned
        Names of the networks, in the thesis' order.
    """

    runs: Mapping[str, tuple[ReachErrors, ...]]
    learned: Sequence[str]

    def values(self, name: str, measure: str) -> NDArray[np.float64]:
        """(S) a number of :meth:`ReachErrors.summary`, or (S, 7) of ``eq_5_13``."""
        return np.array([run.summary()[measure] for run in self.runs[name]])

    def to_json(self) -> dict[str, Any]:
        """Summaries of every run."""
        return {name: [run.summary() for run in runs] for name, runs in self.runs.items()}


def chapter_errors(chapter: ChapterSix, spaces: Sequence[Space] = SPACES) -> ChapterErrors:
    """Measure the networks, ``full`` and the baselines, which learn from the same reaches, on the unseen ones."""
    unseen = chapter.unseen
    runs: dict[str, tuple[ReachErrors, ...]] = {
        name: tuple(reach_errors(one.movements, unseen, one.space) for one in outcomes)
        for name, outcomes in chapter.outcomes.items()
        if outcomes[0].space in spaces
    }
    learned = tuple(runs)
    for space in spaces:
        fitted = [fit_full(FullConfig(space=space), chapter.learnt)]
        fitted += [
            baseline(name, chapter.learnt, space)  # type: ignore[misc]
            for name in usable_baselines(chapter.learnt)
        ]
        for one in fitted:
            if one.name not in runs:
                runs[one.name] = (reach_errors(one.predict(unseen), unseen, one.space),)
    return ChapterErrors(runs, learned)


def table_6_1(errors: ChapterErrors) -> MarkdownTable:
    """Eq. 5.13 of each joint, in 1e-4: ours / the thesis'; the mean over seeds and its spread."""
    return _by_degree("6.1", errors, "joint", THESIS_6_1)


def table_6_2(errors: ChapterErrors) -> MarkdownTable:
    """Eq. 5.13 of each coordinate, as :func:`table_6_1`."""
    return _by_degree("6.2", errors, "task", THESIS_6_2)


def table_6_3(errors: ChapterErrors) -> MarkdownTable:
    """Eq. 6.2 at the final point: ours / the thesis', a row a planner."""
    columns = ("planner", "position, m", "orientation", "±2σ position, m", "±2σ orientation")
    rows = [
        (
            name,
            *(
                _beside(_spread(errors.values(name, measure), ".3f"), _of(THESIS_6_3.get(name), row))
                for row, measure in enumerate(MEASURES)
            ),
        )
        for name in errors.runs
    ]
    return MarkdownTable("6.3", columns, tuple(rows))


def figure_6_12(executed: Executed) -> MarkdownTable:
    """Metres from the demonstrated end to where the arm stood, before and after tuning, and how many reaches came to an end."""
    columns = (
        "network",
        "mean, before",
        "mean, after",
        "±2σ, before",
        "±2σ, after",
        "came to their end, before",
        "came to their end, after",
    )
    rows = []
    for space in SPACES:
        for kind in TUNED:
            names = (f"{kind}-{space}", f"l-{kind}-{space}")
            off = [executed.position(name, beside=beside) for beside in (False, True) for name in names]
            whole = [executed.of(name, beside=False) + executed.of(name, beside=True) for name in names]
            rows.append(
                (
                    names[0],
                    *(f"{values.mean():.3f}" if len(values) else NOTHING for values in off),
                    *(f"{sum(one.reason is None for one in found)} of {len(found)}" for found in whole),
                )
            )
    return MarkdownTable("6.12", columns, tuple(rows))


def table_6_4(
    chapter: ChapterSix,
    score: Callable[[NDArray[np.float64], NDArray[np.int64], int], tuple[float, float]],
) -> MarkdownTable:
    """Davies–Bouldin of the latents by target: after t-SNE, ours / the thesis', and without it.

    Parameters
    ----------
    score
        :func:`punnet.train.planner.latents.separability`.
    """
    columns = ("encoder", "after t-SNE", "of 256 numbers", "unseen plants, after t-SNE")
    names = [("ae", "base", 0, "ae-task"), ("vae", "base", 0, "vae-task")]
    for kind in ("ae", "vae"):
        names += [(kind, f"tuned, {space}", 1, f"l-{kind}-{space}") for space in SPACES]
    names.sort(key=lambda entry: entry[0])
    rows = []
    for kind, told, column, name in names:
        outcomes = chapter.outcomes[name]
        seen = np.array([score(one.latents, chapter.learnt.targets, one.seed) for one in outcomes])
        unseen = np.array([score(one.unseen_latents, chapter.unseen.targets, one.seed) for one in outcomes])
        rows.append(
            (
                f"{kind.upper()} {told}",
                _beside(_spread(seen[:, 0], ".3f"), f"{THESIS_6_4[kind][column]:.3f}"),
                _spread(seen[:, 1], ".3f"),
                _spread(unseen[:, 0], ".3f"),
            )
        )
    return MarkdownTable("6.4", columns, tuple(rows))


def _by_degree(
    name: str, errors: ChapterErrors, space: Space, thesis: Mapping[str, tuple[float, ...]]
) -> MarkdownTable:
    names = [found for found in errors.runs if found.endswith(f"-{space}")]
    rows = []
    for row, coordinate in enumerate(COORDINATES[space]):
        cells = [
            _beside(
                _spread(errors.values(found, "eq_5_13")[:, row] / UNIT, ".3g"),
                _of(thesis.get(found.removesuffix(f"-{space}")), row),
            )
            for found in names
        ]
        rows.append((coordinate, *cells))
    return MarkdownTable(name, ("1e-4", *names), tuple(rows))


def _spread(values: NDArray[np.float64], shape: str) -> str:
    """Mean over seeds, with the standard deviation where there are several."""
    beside = f" ± {np.std(values, ddof=1):{shape}}" if len(values) > 1 else ""
    return f"{np.mean(values):{shape}}{beside}"


def _of(values: Sequence[float] | None, row: int) -> str | None:
    return None if values is None else f"{values[row]:g}"


def _beside(ours: str, thesis: str | None) -> str:
    return f"{ours}{BETWEEN_NUMBERS}{NOTHING if thesis is None else thesis}"
