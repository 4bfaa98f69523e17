"""Table 3.3 of the thesis as Markdown: average precision of masks and key-points, ours beside its own.

The table heads its Dataset-1 columns R50-FPN and X101 while section 3.4.4 calls the second X101-FPN; the table's own
head is followed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from punnet.data.thesis_tables import BETWEEN_NUMBERS, NOTHING, THESIS, MarkdownTable
from punnet.scene import CLASSES

__all__ = ["table_3_3"]

IOU, OKS = ("0.5", "0.7", "0.9"), ("0.1", "0.3", "0.5")
# Backbone and data: masks of pluckable and unpluckable at IoU .5 .7 .9, key-points of both at OKS .1 .3 .5.
THESIS_3_3: dict[str, tuple[tuple[float, float, float], ...]] = {
    "R50-FPN, Dataset-1": (
        (93.32, 90.97, 83.55),
        (59.46, 53.61, 42.91),
        (91.27, 89.10, 81.90),
        (51.36, 46.20, 37.30),
    ),
    "X101, Dataset-1": (
        (94.19, 92.83, 88.70),
        (61.12, 56.22, 45.64),
        (97.21, 91.40, 87.74),
        (61.26, 56.52, 46.84),
    ),
    "X101-FPN, Dataset-2": (
        (71.12, 64.70, 43.24),
        (76.83, 74.52, 68.79),
        (64.32, 58.93, 39.92),
        (73.26, 71.39, 66.46),
    ),
    "X101, Dataset-2": (
        (72.12, 66.84, 47.86),
        (78.09, 76.65, 70.30),
        (59.29, 54.40, 42.12),
        (74.67, 71.45, 65.30),
    ),
}


def table_3_3(evaluations: Mapping[str, Mapping[str, Any]]) -> MarkdownTable:
    """AP of masks and key-points in percent, a row a detector and data set.

    Parameters
    ----------
    evaluations
        By the name of its row, what ``punnet evaluate detector --json`` printed.
    """
    masks = [f"masks {name}, IoU .5 / .7 / .9" for name in CLASSES]
    points = [f"key-points {name}, OKS .1 / .3 / .5" for name in CLASSES]
    columns = ("detector and data", "images", *masks, *points)
    ours = [(name, str(data["images"]), *_precision(data)) for name, data in evaluations.items()]
    thesis = [
        (f"{THESIS}{name}", NOTHING, *(BETWEEN_NUMBERS.join(map(_percent, values)) for values in groups))
        for name, groups in THESIS_3_3.items()
    ]
    return MarkdownTable("3.3", columns, (*ours, *thesis))


def _precision(data: Mapping[str, Any]) -> list[str]:
    """A cell a class, of masks and then of key-points; one dash where nothing was annotated."""
    classes = {row["class"]: row for row in data["classes"]}
    cells = []
    for kind, thresholds in (("mask_ap", IOU), ("keypoint_ap", OKS)):
        for name in CLASSES:
            values = [classes[name][kind].get(threshold) for threshold in thresholds]
            known = [_percent(100 * value) for value in values if value is not None]
            cells.append(BETWEEN_NUMBERS.join(known) if len(known) == len(values) else NOTHING)
    return cells


def _percent(value: float) -> str:
    # 76.65 is a little less in binary; printed figures are rounded as on paper.
    return f"{value + 1e-9:.1f}"
