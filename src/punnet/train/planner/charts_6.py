"""Figures 6.9, 6.10, 6.12 and 6.14 of the thesis, of our networks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.planning.reach_errors import COORDINATES, reach_errors
from punnet.train.planner.chapter_6 import SPACES, ChapterSix
from punnet.train.planner.executed import Executed
from punnet.train.planner.latents import embedding, separability
from punnet.train.planner.tables_6 import TUNED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_figure_6_9", "draw_figure_6_10", "draw_figure_6_12", "draw_figure_6_14"]

TRUE, FOUND = "#1f5fa8", "#c8102e"
PHASES: NDArray[np.float64] = np.linspace(0.0, 1.0, 101)
DOTS = 100


def draw_figure_6_9(chapter: ChapterSix, path: Path) -> dict[str, Any]:
    """Loss of the MLPs by epoch, logarithmic; what is drawn."""
    figure = _figure(8.0, 3.6)
    cells = figure.subplots(1, 2, sharey=False)
    drawn: dict[str, Any] = {}
    for axes, space in zip(cells, SPACES, strict=True):
        for kind in TUNED:
            curve = list(chapter.outcomes[f"{kind}-{space}"][0].curves["movements"])
            drawn[f"{kind}-{space}"] = curve
            axes.semilogy(np.arange(1, len(curve) + 1), curve, lw=0.9, label=kind)
        axes.set(xlabel="epoch", title=f"{space} space")
        axes.grid(alpha=0.25)
        axes.legend(frameon=False)
    cells[0].set_ylabel("Eq. 5.13, summed over all seven")
    figure.savefig(path, dpi=DOTS)
    return drawn


def draw_figure_6_10(chapter: ChapterSix, path: Path, name: str = "cvae-joint") -> dict[str, Any]:
    """A prediction (red) on the demonstrated distribution (blue), mean and ±2σ: the reach with the median error."""
    outcome, unseen = chapter.outcomes[name][0], chapter.unseen
    off = reach_errors(outcome.movements, unseen, outcome.space).position
    row = int(np.argsort(off)[len(off) // 2])
    target = int(unseen.targets[row])
    phi = unseen.basis.phi(PHASES)
    true = unseen.movements(outcome.space)
    figure = _figure(11.0, 4.8)
    cells = figure.subplots(2, 4, sharex=True).ravel()
    for degree, coordinate in enumerate(COORDINATES[outcome.space]):
        axes = cells[degree]
        for mean, block, colour, label in (
            (true.mean[target, degree], true.blocks[target, degree], TRUE, "demonstrated"),
            (
                outcome.movements.mean[row, degree],
                outcome.movements.blocks[row, degree],
                FOUND,
                "predicted",
            ),
        ):
            middle = phi @ mean
            sigma = np.sqrt(np.maximum(np.einsum("tb,bc,tc->t", phi, block, phi), 0.0))
            axes.fill_between(PHASES, middle - 2 * sigma, middle + 2 * sigma, color=colour, alpha=0.18, lw=0)
            axes.plot(PHASES, middle, color=colour, lw=1.6, label=label)
        axes.set_title(coordinate, fontsize=9, loc="left")
        axes.grid(alpha=0.25)
    cells[-1].axis("off")
    handles, labels = cells[0].get_legend_handles_labels()
    cells[-1].legend(handles, labels, loc="center", frameon=False)
    figure.suptitle(
        f"{name}, unseen target {unseen.target_ids[target]}: {off[row] * 1e3:.0f} mm off, the median",
        fontsize=11,
    )
    figure.savefig(path, dpi=DOTS)
    return {"network": name, "target": unseen.target_ids[target], "position_m": float(off[row])}


def draw_figure_6_12(executed: Executed, path: Path, shown: str = "l-cvae-task") -> dict[str, Any]:
    """Where the arm stood at last, before and after tuning, and the ways of one network to one target.

    The target is that with the median error of ``shown``'s means.
    """
    figure = _figure(11.0, 7.0)
    cells = figure.subplots(2, 2)
    top = max(
        float(executed.position(name, beside=beside).mean())
        for name in {reach.network for reach in executed.reaches}
        for beside in (False, True)
        if len(executed.position(name, beside=beside))
    )
    for axes, space in zip(cells[0], SPACES, strict=True):
        _bars(axes, executed, space)
        axes.set_ylim(0.0, 1.25 * top)
    cells[0, 0].set_ylabel("final position off, m (± standard error)")
    cells[0, 1].legend(frameon=False, fontsize=9)
    means = [reach for reach in executed.of(shown, beside=False) if reach.moved]
    if not means:
        figure.savefig(path, dpi=DOTS)
        return {"shown": None}
    middle = sorted(means, key=lambda reach: reach.position)[len(means) // 2]
    for axes, across, name in zip(cells[1], (2, 1), ("from the side", "from above"), strict=True):
        true = executed.demonstrated[middle.target]
        axes.plot(true[:, 0], true[:, across], color=TRUE, lw=2, label="demonstrated mean")
        axes.plot(*true[-1, (0, across)], "o", color=TRUE)
        for reach in executed.reaches:
            if (reach.network, reach.target) == (shown, middle.target) and reach.moved:
                style = {
                    "color": FOUND,
                    "lw": 1.6 if reach.sigma == 0 else 0.9,
                    "ls": "-" if reach.sigma == 0 else "--",
                }
                label = "executed mean" if reach.sigma == 0 else "executed ±2σ" if reach.sigma > 0 else None
                axes.plot(reach.way[:, 0], reach.way[:, across], label=label, **style)
        axes.set(xlabel="x, m", ylabel=f"{'xyz'[across]}, m", title=f"{shown} to {middle.target}, {name}")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(alpha=0.25)
    cells[1, 0].legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=DOTS)
    return {"shown": shown, "target": middle.target, "position_m": middle.position}


def _bars(axes: Axes, executed: Executed, space: str) -> None:
    for number, (prefix, label, colour) in enumerate((("", "before", "#9aa5b1"), ("l-", "after", FOUND))):
        values = [
            executed.position(f"{prefix}{kind}-{space}", beside=beside)
            for kind in TUNED
            for beside in (False, True)
        ]
        axes.bar(
            np.arange(len(values)) + 0.4 * number - 0.2,
            [v.mean() if len(v) else 0.0 for v in values],
            0.38,
            yerr=[v.std(ddof=1) / np.sqrt(len(v)) if len(v) > 1 else 0.0 for v in values],
            color=colour,
            label=f"{label} tuning",
        )
    axes.set_xticks(
        np.arange(2 * len(TUNED)), [f"{kind}\n{told}" for kind in TUNED for told in ("mean", "±2σ")]
    )
    axes.set_title(f"{space} space, executed", fontsize=10)
    axes.grid(axis="y", alpha=0.25)
    axes.set_axisbelow(True)


def draw_figure_6_14(chapter: ChapterSix, path: Path) -> None:
    """t-SNE of latent vectors of the photographs that were learnt from, a colour a target, before and after tuning."""
    figure = _figure(8.0, 7.4)
    cells = figure.subplots(2, 2)
    colours = chapter.learnt.targets
    for row, kind in zip(cells, ("ae", "vae"), strict=True):
        for axes, (name, told) in zip(
            row, ((f"{kind}-task", "before"), (f"l-{kind}-task", "after tuning")), strict=True
        ):
            outcome = chapter.outcomes[name][0]
            points = embedding(outcome.latents, outcome.seed)
            score = separability(outcome.latents, colours, outcome.seed)[0]
            axes.scatter(points[:, 0], points[:, 1], c=colours, cmap="nipy_spectral", s=9)
            axes.set(xticks=[], yticks=[], title=f"{kind.upper()}, {told}: Davies–Bouldin {score:.3f}")
    figure.savefig(path, dpi=DOTS)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
