"""A picture of a trajectory distribution, in the manner of figure 5.5 of the thesis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.movement import TrajectoryDistribution, ViaPoint

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_distribution"]

PHASES: NDArray[np.float64] = np.linspace(0.0, 1.0, 201)
COLOUR = "#5b3a8e"
VIA_COLOUR = "#c8102e"
COLUMNS = 4
MINIMUM_SPAN = {"joint": 0.2, "task": 0.05}  # so that a still joint does not look like a moving one


def plot_distribution(
    distribution: TrajectoryDistribution, path: str | Path, *, title: str = "Trajectory distribution"
) -> Path:
    """Draw one panel a degree of freedom: mean, ±σ and ±2σ shaded, via-points marked.

    Parameters
    ----------
    distribution
        What to draw; angles are shown in radians, positions in metres.
    path
        Image file; the suffix (``.png``, ``.svg``, ``.pdf``) chooses the format.
    title
        Heading of the picture.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileFormatError
        If the file can't be written or its format is unknown.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    path = Path(path)
    count = distribution.dimensions
    columns = min(COLUMNS, count)
    rows = -(-(count + 1) // columns)  # one cell is left for the legend
    figure = Figure(figsize=(3.0 * columns, 2.1 * rows + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    cells = np.atleast_1d(figure.subplots(rows, columns, sharex=True, squeeze=False)).ravel()
    mean, std = distribution.mean(PHASES), distribution.std(PHASES)
    for d in range(count):
        _draw_degree(cells[d], distribution, d, mean[:, d], std[:, d])
    for cell in cells[count:]:
        cell.axis("off")
    for cell in cells[max(0, count - columns) : count]:
        cell.set_xlabel("phase", fontsize=9)
        cell.tick_params(labelbottom=True)
    handles, labels = cells[0].get_legend_handles_labels()
    if len(cells) > count:
        cells[count].legend(handles, labels, loc="center", fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=12)
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: the plot can't be written ({error})") from error
    return path


def _draw_degree(
    axes: Axes,
    distribution: TrajectoryDistribution,
    degree: int,
    mean: NDArray[np.float64],
    std: NDArray[np.float64],
) -> None:
    axes.fill_between(PHASES, mean - 2 * std, mean + 2 * std, color=COLOUR, alpha=0.16, lw=0, label="±2σ")
    axes.fill_between(PHASES, mean - std, mean + std, color=COLOUR, alpha=0.28, lw=0, label="±σ")
    axes.plot(PHASES, mean, color=COLOUR, lw=1.8, label="mean")
    points = [found for via in distribution.via_points if (found := _position_at(via, degree)) is not None]
    if points:
        phase, value, error = np.array(points).T
        style: dict[str, Any] = {
            "color": VIA_COLOUR,
            "fmt": "o",
            "ms": 4.5,
            "lw": 1.2,
            "zorder": 5,
            "clip_on": False,
        }
        axes.errorbar(phase, value, yerr=2 * error, label="via-points", **style)
    low, high = axes.get_ylim()
    missing = MINIMUM_SPAN[distribution.space] - (high - low)
    if missing > 0:
        axes.set_ylim(low - missing / 2, high + missing / 2)
    unit = "m" if distribution.space == "task" and degree < 3 else "rad"
    axes.set_title(f"{distribution.names[degree]} ({unit})", fontsize=9, loc="left")
    axes.set_xlim(0.0, 1.0)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.25, lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _position_at(via_point: ViaPoint, degree: int) -> tuple[float, float, float] | None:
    """Phase, value and std of a via-point for one degree of freedom, None if it has no position for it."""
    chosen = via_point.degrees_of_freedom
    if via_point.order != 0 or (chosen is not None and degree not in chosen):
        return None
    index = degree if chosen is None else chosen.index(degree)
    return via_point.phase, float(via_point.values[index]), float(np.sqrt(via_point.variances[index]))
