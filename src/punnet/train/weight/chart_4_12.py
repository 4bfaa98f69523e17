"""The bar chart of figure 4.12."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from punnet.weight.metrics import PCW_TOLERANCES

if TYPE_CHECKING:
    from punnet.train.weight.figure_4_12 import Figure412

__all__ = ["draw_chart"]

_GROUP = 0.84  # of the width that a model has


def draw_chart(figure: Figure412, path: Path) -> None:
    """Write a PNG: for each model a bar a tolerance, as high as the share of weights within it; the thesis' as marks."""
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = figure.rows
    drawing = Figure(figsize=(max(8.0, 1.25 * len(rows) + 2.0), 5.6), layout="constrained")
    FigureCanvasAgg(drawing)
    axes = drawing.subplots()
    width = _GROUP / len(PCW_TOLERANCES)
    middles = np.arange(len(rows), dtype=np.float64)
    colours = colormaps["YlOrRd"](np.linspace(0.9, 0.25, len(PCW_TOLERANCES)))
    for number, (tolerance, colour) in enumerate(zip(PCW_TOLERANCES, colours, strict=True)):
        places = middles + (number - (len(PCW_TOLERANCES) - 1) / 2.0) * width
        heights = [row.evaluations["truth"].whole.pcw[tolerance] for row in rows]
        axes.bar(places, heights, width, color=colour, label=f"within {100 * tolerance:.0f}%")
        known = [
            (place, row.thesis[tolerance])
            for place, row in zip(places, rows, strict=True)
            if tolerance in row.thesis
        ]
        if known:
            axes.plot(*zip(*known, strict=True), "D", color="#1f6f8b", markersize=5, zorder=3)
    axes.plot([], [], "D", color="#1f6f8b", markersize=5, label="thesis")
    names = [row.title.replace(", ", "\n") for row in rows]
    axes.set_xticks(middles, names, rotation=30, ha="right")
    axes.set(ylim=(0, 102), ylabel="berries whose weight is right, %", title=figure.settings["data"])
    axes.grid(axis="y", alpha=0.3)
    axes.set_axisbelow(True)
    axes.legend(ncols=7, loc="upper center", bbox_to_anchor=(0.5, -0.32), frameon=False)
    drawing.savefig(path, dpi=110)
