"""The picture of a comparison: what punnets weigh, and what is given away, by policy."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING

import numpy as np

from punnet.weight.packing.comparison import BAR, Comparison, Setting
from punnet.weight.packing.packer import PackingConfig

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_comparison"]

_COLOURS = ("#b3122f", "#1f6f8b", "#7fb0c0", "#8a6d00", "#cdb860")


def draw_comparison(comparison: Comparison) -> bytes:
    """Give a PNG: on the left the weights of the punnets, on the right giveaway and batches that pass."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 7.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(comparison.settings), 2, squeeze=False, width_ratios=(3, 2))
    for setting, (weights, giveaway) in zip(comparison.settings, panels, strict=True):
        _weights(weights, setting, comparison.config)
        _giveaway(giveaway, setting)
    trial = comparison.settings[0].results[0]
    figure.suptitle(
        f"{len(trial.batches)} batches of {trial.batches[0].berries} berries into punnets of "
        f"{comparison.config.nominal:g} g, {comparison.places} open at a time"
    )
    picture = io.BytesIO()
    figure.savefig(picture, dpi=110, format="png")
    return picture.getvalue()


def _weights(axes: Axes, setting: Setting, config: PackingConfig) -> None:
    """Share of punnets by weight."""
    nominal, tolerance = config.nominal, config.tolerance
    step = max(1.0, round(nominal / 125.0))
    edges = nominal + np.arange(-math.ceil(2.5 * max(tolerance, 4.0) / step), 0.3 * nominal / step) * step
    for result, colour in zip(setting.results, _COLOURS, strict=False):
        if len(result.weights):
            share = np.histogram(result.weights, edges)[0] / len(result.weights)
            axes.stairs(100 * share, edges, color=colour, linewidth=1.8)
    top = 1.12 * axes.get_ylim()[1]
    axes.set_ylim(0, top)
    for grams, words in (
        (nominal, "nominal"),
        (nominal - tolerance, "− TNE"),
        (nominal - 2 * tolerance, "− 2 TNE"),
    ):
        axes.axvline(grams, color="#555555", linewidth=0.9, linestyle="--")
        axes.text(grams, 0.98 * top, words, rotation=90, ha="right", va="top", fontsize=8.5, color="#555555")
    axes.set(
        title=setting.name, xlabel="grams in the punnet", ylabel="% of punnets", xlim=(edges[0], edges[-1])
    )


def _giveaway(axes: Axes, setting: Setting) -> None:
    """Bars in the colours of the curves; hatched where batches fail the rule."""
    names = [result.name for result in setting.results]
    shares = [100 * result.giveaway for result in setting.results]
    bars = axes.barh(names, np.nan_to_num(shares), linewidth=1.8)
    for bar, result, colour in zip(bars, setting.results, _COLOURS, strict=False):
        fails = result.passed < len(result.batches)
        bar.set(edgecolor=colour, facecolor="white" if fails else colour, hatch="////" if fails else None)
    words = [
        f"{share:.2f}%, {result.passed} of {len(result.batches)} pass"
        for share, result in zip(shares, setting.results, strict=True)
    ]
    axes.bar_label(
        bars, words, fontsize=9, padding=3, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    )
    axes.axvline(100 * BAR, color="#555555", linewidth=0.9, linestyle="--", zorder=0)
    axes.invert_yaxis()
    axes.set(title=f"giveaway (dashed: {100 * BAR:g}%; hatched: fails the rule)", xlabel="% of nominal")
    axes.set_xlim(0, 1.45 * max(1.0, *np.nan_to_num(shares)))
    axes.spines[["top", "right"]].set_visible(False)
