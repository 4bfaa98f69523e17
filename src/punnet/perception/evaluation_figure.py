"""The figure of an evaluation: precision over recall, what is taken for what, which berries are found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.perception.confusion import Confusion, FoundShare, found_by_occlusion, found_by_size
from punnet.perception.evaluation import Evaluation
from punnet.scene import CLASSES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_evaluation_figure"]

CLASS_COLOURS = ("#d6284b", "#c99a00")
LINE_STYLES = ("-", "--", ":")
INK = "#1f6f8b"


def draw_evaluation_figure(evaluation: Evaluation, path: Path) -> None:
    """Write a PNG of six panels: both precision–recall curves, both confusions, recall by size and by occlusion.

    Panels for which nothing was annotated say so.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 9.2), layout="constrained")
    FigureCanvasAgg(figure)
    (masks, points, shown), (classes, size, occlusion) = figure.subplots(2, 3)
    rows = evaluation.scores.rows[: len(CLASSES)]
    _curves(masks, "masks", "IoU", [row.mask_precision for row in rows])
    _curves(points, "key-points", "OKS", [row.keypoint_precision for row in rows])
    _confusion(shown, "visibility of key-points", evaluation.visibility)
    _confusion(classes, f"classes, detections from {evaluation.settings.user_score:g}", evaluation.classes)
    _found(size, "found, by √(mask area) in pixels", found_by_size(evaluation.berries))
    _found(occlusion, "found, by share hidden by something else", found_by_occlusion(evaluation.berries))
    figure.suptitle(f"{evaluation.detector} on {evaluation.data}: {len(evaluation.images)} images")
    figure.savefig(path, dpi=110)


def _curves(
    axes: Axes, what: str, similarity: str, curves: Sequence[Mapping[float, NDArray[np.float64]]]
) -> None:
    axes.set(title=f"precision over recall, {what}", xlim=(0, 1), ylim=(0, 1.02))
    axes.set(xlabel="recall", ylabel="precision")
    drawn = 0
    for name, colour, of_class in zip(CLASSES, CLASS_COLOURS, curves, strict=True):
        for style, (threshold, precision) in zip(LINE_STYLES, of_class.items(), strict=False):
            if precision.size:
                recall = np.linspace(0, 1, precision.size)
                axes.plot(recall, precision, style, color=colour, label=f"{name}, {similarity} {threshold:g}")
                drawn += 1
    axes.grid(alpha=0.3)
    if drawn:
        axes.legend(fontsize=8, loc="best")
    else:
        _nothing(axes)


def _confusion(axes: Axes, title: str, confusion: Confusion | None) -> None:
    axes.set_title(title)
    if confusion is None:
        _nothing(axes)
        return
    counts = confusion.counts
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, vmin=0, vmax=1, cmap="Blues", aspect="auto")
    axes.set_xticks(range(len(confusion.columns)), confusion.columns, fontsize=8)
    axes.set_yticks(range(len(confusion.rows)), confusion.rows, fontsize=8)
    axes.set(xlabel="found", ylabel="annotated")
    for (row, column), count in np.ndenumerate(counts):
        ink: dict[str, Any] = {"color": "white" if shares[row, column] > 0.6 else "black"}
        axes.text(
            column,
            row,
            f"{count}\n{100 * shares[row, column]:.0f}%",
            ha="center",
            va="center",
            fontsize=9,
            **ink,
        )


def _found(axes: Axes, title: str, shares: Sequence[FoundShare]) -> None:
    axes.set(title=title, ylim=(0, 1.12))
    known = [share for share in shares if share.berries]
    if not known:
        _nothing(axes)
        return
    places = np.arange(len(known))
    found = [share.found / share.berries for share in known]
    named = [share.rightly_named / share.berries for share in known]
    axes.bar(places, found, color=INK, alpha=0.45, label="found")
    axes.bar(places, named, color=INK, width=0.5, label="and rightly named")
    labels = [
        f"{share.least:g}…{share.most:g}\n{share.berries} berries".replace("…inf", " or more")
        for share in known
    ]
    axes.set_xticks(places, labels, fontsize=8)
    axes.legend(fontsize=8, loc="upper left", ncols=2)
    axes.grid(axis="y", alpha=0.3)


def _nothing(axes: Axes) -> None:
    axes.text(0.5, 0.5, "not annotated", ha="center", va="center", transform=axes.transAxes, color="gray")
