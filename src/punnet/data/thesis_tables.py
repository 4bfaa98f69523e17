"""Tables 3.1 and 3.2 of the thesis as Markdown: what data sets hold, ours beside its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from punnet.data.dataset import Dataset
from punnet.scene import CLASSES, PLUCKABLE

__all__ = [
    "BETWEEN_NUMBERS",
    "NOTHING",
    "THESIS",
    "DatasetFacts",
    "MarkdownTable",
    "dataset_facts",
    "table_3_1",
    "table_3_2",
]

YES, NO, NOTHING = "✓", "✗", "–"
ROWS_3_1 = (
    "images",
    "berries",
    "depth",
    "segmentation",
    "farm",
    "ripeness",
    "key-points",
    "weight",
    "dimensions",
)
THESIS_3_1: dict[str, tuple[str, ...]] = {
    "SDI": ("31200", "17938", NO, YES, YES, NO, NO, NO, NO),
    "Dryad": ("35442", "1611", YES, NO, NO, NO, NO, YES, YES),
    "Dataset-1": ("1588", "2413", YES, YES, YES, YES, YES, YES, YES),
    "Dataset-2": ("3100", "17938", NO, YES, YES, YES, YES, NO, NO),
}
THESIS_3_2: dict[str, tuple[str, ...]] = {
    "Dataset-1": ("1588", "1757", "656", "2413", "1910"),
    "Dataset-2": ("3100", "3659", "14279", "10999", NOTHING),
}
BETWEEN_NUMBERS = " / "
THESIS = "thesis: "


@dataclass(frozen=True)
class MarkdownTable:
    """A table that can be printed as Markdown or written as JSON.

    Parameters
    ----------
    name
        Of the thesis.
    columns
        Headings; the first is that of the row names.
    rows
        Text, as many as there are columns.
    """

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """The table, first column to the left, the rest to the right."""
        rule = ["---"] + ["---:"] * (len(self.columns) - 1)
        return "\n".join(f"| {' | '.join(cells)} |" for cells in (self.columns, rule, *self.rows))

    def to_json(self) -> dict[str, Any]:
        """Rows as objects; numbers as such, several as a list, ✓ and ✗ as true and false, a dash as null."""
        rows = [dict(zip(self.columns, (row[0], *map(_plain, row[1:])), strict=True)) for row in self.rows]
        return {"table": self.name, "rows": rows}


@dataclass(frozen=True)
class DatasetFacts:
    """What tables 3.1 and 3.2 say of a data set; crowd annotations do not count.

    Parameters
    ----------
    name
        What to call it.
    images, pluckable, unpluckable
        How many.
    with_keypoints, with_masks, with_weight
        How many berries have them.
    with_depth
        How many images have depth.
    farm
        Whether it was taken on a farm; None where the file's ``info.farm`` does not say.
    """

    name: str
    images: int
    pluckable: int
    unpluckable: int
    with_keypoints: int
    with_masks: int
    with_weight: int
    with_depth: int
    farm: bool | None

    @property
    def berries(self) -> int:
        """Of both classes."""
        return self.pluckable + self.unpluckable


def dataset_facts(dataset: Dataset, name: str | None = None) -> DatasetFacts:
    """Count what a data set holds; no file is opened."""
    berries = [a for image in dataset for a in image.annotations if not a.crowd]
    pluckable = sum(berry.class_index == PLUCKABLE for berry in berries)
    farm = dataset.info.get("farm")
    return DatasetFacts(
        name=dataset.name if name is None else name,
        images=len(dataset),
        pluckable=pluckable,
        unpluckable=len(berries) - pluckable,
        with_keypoints=sum(b.visibility is not None and bool((b.visibility > 0).any()) for b in berries),
        with_masks=sum(berry.segmentation is not None for berry in berries),
        with_weight=sum(math.isfinite(berry.weight) for berry in berries),
        with_depth=sum(image.depth_path is not None for image in dataset),
        farm=farm if isinstance(farm, bool) else None,
    )


def table_3_1(sets: Sequence[DatasetFacts]) -> MarkdownTable:
    """What each data set has, a column a set: ours first, then those of the thesis.

    Ripeness is ticked where classes tell it, as in the thesis, so for every set that has berries. No format has a field
    for dimensions; ours never have them.
    """
    columns: list[tuple[str, ...]] = []
    for facts in sets:
        has = (facts.with_depth, facts.with_masks, facts.berries, facts.with_keypoints, facts.with_weight)
        depth, masks, ripeness, points, weight = (YES if count else NO for count in has)
        farm = NOTHING if facts.farm is None else YES if facts.farm else NO
        columns.append(
            (str(facts.images), str(facts.berries), depth, masks, farm, ripeness, points, weight, NO)
        )
    columns += THESIS_3_1.values()
    names = ("data set", *(facts.name for facts in sets), *(f"{THESIS}{name}" for name in THESIS_3_1))
    rows = tuple((label, *(column[row] for column in columns)) for row, label in enumerate(ROWS_3_1))
    return MarkdownTable("3.1", names, rows)


def table_3_2(sets: Sequence[DatasetFacts]) -> MarkdownTable:
    """Images, berries by class, berries with key-points and with a weight; a row a set."""
    columns = ("data set", "images", *CLASSES, "with key-points", "with weight")
    ours = [
        (
            facts.name,
            str(facts.images),
            str(facts.pluckable),
            str(facts.unpluckable),
            str(facts.with_keypoints),
            str(facts.with_weight) if facts.with_weight else NOTHING,
        )
        for facts in sets
    ]
    thesis = [(f"{THESIS}{name}", *cells) for name, cells in THESIS_3_2.items()]
    return MarkdownTable("3.2", columns, (*ours, *thesis))


def _plain(cell: str) -> Any:
    known: dict[str, bool | None] = {YES: True, NO: False, NOTHING: None}
    if BETWEEN_NUMBERS in cell:
        return [_plain(part) for part in cell.split(BETWEEN_NUMBERS)]
    if cell in known:
        return known[cell]
    try:
        return int(cell) if cell.isdigit() else float(cell)
    except ValueError:
        return cell
