"""The picture of a comparison: what punnets weigh, and what is given away, by policy."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from punnet.weight.packing.comparison import BAR, Comparison, Setting
from punnet.weight.packing.packer import PackingConfig

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_comparison"]

_COLOURS = ("#b3122f", "#1f6f8b", "#7fb0c0", "#8a6d00", "#cdb860")
_FAILS = "#d9d2cd"


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
    edges = np.arange(-2.5 * max(tolerance, 4.0), 0.16 * nominal, 1.0) + nominal
    for result, colour in zip(setting.results, _COLOURS, strict=False):
        if len(result.weights):
            share = np.histogram(np.clip(result.weights, edges[0], edges[-1]), edges)[0] / len(result.weights)
            axes.stairs(100 * share, edges, color=colour, linewidth=1.8, label=result.name)
    top = axes.get_ylim()[1]
    for grams, words in (
        (nominal, "nominal"),
        (nominal - tolerance, "− TNE"),
        (nominal - 2 * tolerance, "− 2 TNE"),
    ):
        axes.axvline(grams, color="#555555", linewidth=0.9, linestyle="--")
        axes.text(grams, top, f" {words}", va="top", fontsize=8.5, color="#555555")
    axes.set(
        title=setting.name, xlabel="grams in the punnet", ylabel="% of punnets", xlim=(edges[0], edges[-1])
    )
    axes.legend(frameon=False, fontsize=9)


def _giveaway(axes: Axes, setting: Setting) -> None:
    """Bars; pale where batches fail the rule."""
    names = [result.name for result in setting.results]
    shares = [100 * result.giveaway for result in setting.results]
    passed = [result.passed == len(result.batches) for result in setting.results]
    colours = [colour if good else _FAILS for colour, good in zip(_COLOURS, passed, strict=False)]
    bars = axes.barh(names, np.nan_to_num(shares), color=colours)
    words = [
        f" {share:.2f}%, {result.passed} of {len(result.batches)} pass"
        for share, result in zip(shares, setting.results, strict=True)
    ]
    axes.bar_label(bars, words, fontsize=9)
    axes.axvline(100 * BAR, color="#555555", linewidth=0.9, linestyle="--")
    axes.text(100 * BAR, -0.62, f" {100 * BAR:g}%", fontsize=8.5, color="#555555")
    axes.invert_yaxis()
    axes.set(title="giveaway (grey: batches fail the rule)", xlabel="% of nominal")
    axes.set_xlim(0, 1.45 * max(1.0, *np.nan_to_num(shares)))
    axes.spines[["top", "right"]].set_visible(False)
