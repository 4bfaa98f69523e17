"""The picture of a benchmark: what became of every reachable ripe berry, one bar a run."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["draw_outcomes", "row_name"]

_PICKED = "#5a9e57"
_REASONS = ("#c8102e", "#e8792b", "#f2b544", "#8e5ea2", "#3b7ea1", "#7a5c3e", "#d77fa1", "#5f6b6d")
_MOST_REASONS = len(_REASONS)
_REST = "other reasons"
_GREY = "#c9c9c9"
_BAR_HEIGHT = 0.42  # inches


def row_name(figures: Mapping[str, Any]) -> str:
    """What was measured, in one line: eyes, planner, choice and order."""
    bundle = "" if figures["planner_bundle"] is None else f" ({figures['planner_bundle']})"
    return f"{figures['perception']} + {figures['planner']}{bundle} + {figures['choice']}, {figures['order']}"


def draw_outcomes(runs: Sequence[Mapping[str, Any]]) -> bytes:
    """PNG of stacked bars: the share of reachable ripe berries picked, and of those missed for each reason.

    ``runs`` are figures as :meth:`punnet.harvest.benchmark.BenchmarkResult.to_json` gives them; the commonest reasons have
    a colour of their own.
    """
    from matplotlib.figure import Figure

    total: Counter[str] = Counter()
    for figures in runs:
        total.update(figures["missed"])
    named = [reason for reason, _ in total.most_common(_MOST_REASONS)]
    figure = Figure(figsize=(10.0, 1.7 + _BAR_HEIGHT * len(runs) + 0.2 * len(named)), layout="constrained")
    axes = figure.add_subplot()
    labels = [f"{figures['suite']}/{figures['suite_version']}  {row_name(figures)}" for figures in runs]
    shares = [_shares(figures, named) for figures in runs]
    left = [0.0] * len(runs)
    for name, colour in (("picked", _PICKED), *zip(named, _REASONS, strict=False), (_REST, _GREY)):
        widths = [share.get(name, 0.0) for share in shares]
        if any(widths):
            axes.barh(range(len(runs)), widths, left=left, color=colour, label=name, height=0.7)
        left = [start + width for start, width in zip(left, widths, strict=True)]
    for row, (figures, share) in enumerate(zip(runs, shares, strict=True)):
        success = figures["success"]
        text = f"{share['picked']:.1f}%  ({success['hits']} of {success['of']})" if success["of"] else "none"
        axes.text(1.0, row, text, va="center", ha="left", color="white", fontsize=9)
    axes.set_yticks(range(len(runs)), labels, fontsize=9)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("% of reachable ripe berries")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if any(count for share in shares for count in share.values()):
        figure.legend(loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def _shares(figures: Mapping[str, Any], named: Sequence[str]) -> dict[str, float]:
    """Percent of the reachable ripe berries that were picked, and missed for each of the reasons ``named``."""
    count = figures["success"]["of"]
    if not count:
        return {"picked": 0.0}
    shares = {"picked": 100.0 * figures["success"]["hits"] / count}
    for reason, times in figures["missed"].items():
        name = reason if reason in named else _REST
        shares[name] = shares.get(name, 0.0) + 100.0 * times / count
    return shares
