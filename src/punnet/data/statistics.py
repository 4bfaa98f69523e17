"""Distributions of a data set: sizes, occlusion, visibility of key-points, ripeness, weights, berries an image."""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import STAGES, Annotation, Dataset
from punnet.outputs import FIGURES, require_suffix, write_bytes
from punnet.scene import CLASSES, KEYPOINTS, Visibility

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["DatasetStatistics", "Distribution", "dataset_statistics", "draw_statistics"]

PERCENTILES = (5, 25, 50, 75, 95)
CLASS_COLOURS = ("#d6224c", "#d49a00")
VISIBILITY_COLOURS = ("#c9c9c9", "#8fb7e8", "#1f5fa8", "#e08a2e")
VISIBILITY_NAMES = {
    Visibility.ABSENT: "absent",
    Visibility.HIDDEN_BY_ITSELF: "hidden by itself",
    Visibility.VISIBLE: "visible",
    Visibility.HIDDEN_BY_OTHER: "hidden by other",
}


@dataclass(frozen=True, eq=False)
class Distribution:
    """Values of one quantity, of all berries or images that have it, by class.

    Parameters
    ----------
    name, unit
        What it is, and in what.
    values
        (N,) finite numbers.
    classes
        (N,) class index of each; None for a quantity of images.
    """

    name: str
    unit: str
    values: NDArray[np.float64]
    classes: NDArray[np.int64] | None = None

    def percentiles(self) -> list[float] | None:
        """5, 25, 50, 75 and 95%; None without values."""
        if not len(self.values):
            return None
        return [round(float(value), 4) for value in np.percentile(self.values, PERCENTILES)]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        levels = self.percentiles()
        return {
            "unit": self.unit,
            "count": len(self.values),
            "mean": round(float(self.values.mean()), 4) if len(self.values) else None,
            "percentiles": None
            if levels is None
            else {str(p): v for p, v in zip(PERCENTILES, levels, strict=True)},
        }


@dataclass(frozen=True, eq=False)
class DatasetStatistics:
    """What :func:`dataset_statistics` counts; crowd annotations count only in ``crowd``.

    Parameters
    ----------
    name
        Of the data set.
    images, berries, crowd, groups
        How many; ``groups`` is 0 where no image says its plant.
    distributions
        By name.
    visibility
        (5, 4) berries by key-point and :class:`~punnet.scene.Visibility`.
    stages
        Berries by stage of colour; stages that do not occur are left out.
    """

    name: str
    images: int
    berries: int
    crowd: int
    groups: int
    distributions: dict[str, Distribution]
    visibility: NDArray[np.int64]
    stages: dict[str, int]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "name": self.name,
            "images": self.images,
            "berries": self.berries,
            "crowd": self.crowd,
            "groups": self.groups,
            "distributions": {name: one.to_json() for name, one in self.distributions.items()},
            "visibility": {
                keypoint: {VISIBILITY_NAMES[code]: int(self.visibility[k, code]) for code in VISIBILITY_NAMES}
                for k, keypoint in enumerate(KEYPOINTS)
            },
            "stages": self.stages,
        }


def dataset_statistics(dataset: Dataset) -> DatasetStatistics:
    """Count a data set; no file is opened."""
    annotations = [annotation for image in dataset for annotation in image.annotations]
    berries = [annotation for annotation in annotations if not annotation.crowd]
    shorter = [
        math.sqrt(image.width * image.height)
        for image in dataset
        for annotation in image.annotations
        if not annotation.crowd
    ]
    an_image = [float(sum(not annotation.crowd for annotation in image.annotations)) for image in dataset]
    sizes = [_extent(berry) for berry in berries]
    visibility = np.zeros((len(KEYPOINTS), len(Visibility)), dtype=np.int64)
    for berry in berries:
        if berry.visibility is not None:
            visibility[np.arange(len(KEYPOINTS)), berry.visibility] += 1
    found = Counter(berry.stage for berry in berries if berry.stage is not None)
    distributions = (
        Distribution("berries an image", "", np.array(an_image)),
        _of_berries("box size", "px", berries, sizes),
        _of_berries(
            "box size / image size", "", berries, [a / b for a, b in zip(sizes, shorter, strict=True)]
        ),
        _of_berries("height / width of box", "", berries, [_slenderness(berry) for berry in berries]),
        _of_berries("occlusion", "hidden share", berries, [berry.occlusion for berry in berries]),
        _of_berries("ripeness", "share", berries, [berry.ripeness for berry in berries]),
        _of_berries("weight", "g", berries, [berry.weight for berry in berries]),
        _of_berries("distance of picking point", "m", berries, [_distance(berry) for berry in berries]),
    )
    return DatasetStatistics(
        name=dataset.name,
        images=len(dataset),
        berries=len(berries),
        crowd=len(annotations) - len(berries),
        groups=len({image.group for image in dataset if image.group is not None}),
        distributions={one.name: one for one in distributions},
        visibility=visibility,
        stages={stage: found[stage] for stage in STAGES if found[stage]},
    )


def _of_berries(name: str, unit: str, berries: Sequence[Annotation], values: Iterable[float]) -> Distribution:
    array = np.array(list(values), dtype=np.float64)
    known = np.isfinite(array)
    classes = np.array([berry.class_index for berry in berries], dtype=np.int64)
    return Distribution(name, unit, array[known], classes[known])


def _extent(berry: Annotation) -> float:
    """Geometric mean of the box's sides, in pixels."""
    width, height = berry.box[2:] - berry.box[:2]
    return math.sqrt(width * height)


def _slenderness(berry: Annotation) -> float:
    width, height = berry.box[2:] - berry.box[:2]
    return float(height / width) if width > 0 else math.nan


def _distance(berry: Annotation) -> float:
    return math.nan if berry.keypoint_depths is None else float(berry.keypoint_depths[0])


def draw_statistics(statistics: DatasetStatistics, path: str | Path, *, force: bool = False) -> Path:
    """Draw histograms, one a distribution that has values, and the visibility of key-points.

    Raises
    ------
    OutputExistsError
        If the file exists and ``force`` is not set.
    OutputError
        If it can't be written, or its suffix is none of PNG, SVG and PDF.
    """
    from matplotlib.figure import Figure

    path = Path(path)
    require_suffix(path, *FIGURES)
    known = [one for one in statistics.distributions.values() if len(one.values)]
    with_visibility = bool(statistics.visibility.any())
    panels = max(1, len(known) + with_visibility)
    columns = min(3, panels)
    rows = -(-panels // columns)
    figure = Figure(figsize=(4.2 * columns, 2.9 * rows), layout="constrained")
    figure.suptitle(f"{statistics.name}: {statistics.images} images, {statistics.berries} berries")
    axes = [figure.add_subplot(rows, columns, i + 1) for i in range(panels)]
    for ax, distribution in zip(axes, known, strict=False):
        _histogram(ax, distribution)
    if with_visibility:
        _visibility(axes[len(known)], statistics.visibility)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:].lower(), dpi=110)
    return write_bytes(path, buffer.getvalue(), force=force)


def _histogram(ax: Axes, distribution: Distribution) -> None:
    values, classes = distribution.values, distribution.classes
    high = float(np.percentile(values, 99.5))
    low = min(0.0, float(values.min()))
    if distribution.unit in ("share", "hidden share"):
        edges = np.linspace(0.0, 1.0, 21)
    elif classes is None:
        edges = np.arange(-0.5, max(1.0, high) + 1.5)
    else:
        edges = np.linspace(low, max(high, low + 1e-6), 31)
    clipped = np.clip(values, edges[0], edges[-1])
    if classes is None:
        ax.hist(clipped, edges.tolist(), color="#4d7a4d")
    else:
        ax.hist(
            [clipped[classes == k] for k in range(len(CLASSES))],
            edges.tolist(),
            stacked=True,
            color=list(CLASS_COLOURS),
            label=list(CLASSES),
        )
    unit = f" ({distribution.unit})" if distribution.unit else ""
    ax.set_xlabel(f"{distribution.name}{unit}")
    ax.spines[["top", "right"]].set_visible(False)
    if classes is not None:
        ax.legend(frameon=False, fontsize="x-small")


def _visibility(ax: Axes, counts: NDArray[np.int64]) -> None:
    begin = np.zeros(len(KEYPOINTS))
    names = [name.replace("_", " ") for name in KEYPOINTS]
    for code, label in VISIBILITY_NAMES.items():
        ax.barh(names, counts[:, code], left=begin, color=VISIBILITY_COLOURS[code], label=label)
        begin += counts[:, code]
    ax.invert_yaxis()
    ax.set_xlabel("berries")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize="x-small", ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
