"""Pictures of demonstrations: joints over time, paths in space, where boxes lie and where reaches end."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import DemonstrationSet, Episode
from punnet.data.demos.pairing import suspect_targets
from punnet.data.demos.trajectory import Trajectory
from punnet.errors import OutputExistsError, PunnetError
from punnet.outputs import FIGURES, require_suffix, write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_demonstrations"]

MOST_DRAWN = 300
"""Movements that are drawn at most; of more, evenly spread ones."""

_MOST_SAMPLES = 400


def draw_demonstrations(demonstrations: DemonstrationSet, path: str | Path, *, force: bool = False) -> Path:
    """Draw a set: a panel a coordinate, one colour a target, ±2σ where weights tell it, and the photograph beside.

    Raises
    ------
    OutputError
        If the file is no PNG, SVG or PDF.
    OutputExistsError
        If the file exists and ``force`` is not set.
    """
    import matplotlib

    matplotlib.use("agg", force=False)
    from matplotlib.figure import Figure

    place = Path(path)
    require_suffix(place, *FIGURES)
    if place.exists() and not force:
        raise OutputExistsError(f"{place}: exists; give another name or --force")
    spaces = [
        space for space in ("joints", "poses") if any(getattr(e, space) is not None for e in demonstrations)
    ]
    widths = [7, *(len(demonstrations.joint_names) for space in spaces if space == "joints")]
    columns = max(min(max(widths), 8), 4)
    figure = Figure(figsize=(2.3 * columns, 2.2 * len(spaces) + 3.6), layout="constrained")
    grid = figure.add_gridspec(len(spaces) + 1, columns, height_ratios=[*[2.0] * len(spaces), 3.4])
    colours = _colours(demonstrations)
    for row, space in enumerate(spaces):
        names = demonstrations.joint_names if space == "joints" else ("x", "y", "z", "qx", "qy", "qz", "qw")
        for number, name in enumerate(names[:columns]):
            axes = figure.add_subplot(grid[row, number])
            _draw_coordinate(axes, demonstrations, space, number, colours)
            unit = "rad" if space == "joints" else "m" if number < 3 else ""
            axes.set_title(f"{name} [{unit}]" if unit else name, fontsize=8)
            axes.tick_params(labelsize=6)
    bottom, third = len(spaces), max(1, columns // 3)
    shown = list(demonstrations.groups.values())[:2]
    for number, indices in enumerate(shown):
        axes = figure.add_subplot(grid[bottom, number * third : (number + 1) * third])
        _draw_photograph(axes, demonstrations.subset(indices), colours)
    _draw_ends(figure.add_subplot(grid[bottom, len(shown) * third :]), demonstrations, colours)
    count = f"{len(demonstrations)} episodes, {len(demonstrations.targets)} targets"
    figure.suptitle(f"{demonstrations.name}: {count}", fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=place.suffix[1:].lower(), dpi=110)
    return write_bytes(place, buffer.getvalue(), force=force)


def _colours(demonstrations: DemonstrationSet) -> dict[str, Any]:
    from matplotlib import colormaps

    names = list(demonstrations.targets)
    # Steps of the golden ratio: neighbours on a plant, which follow each other, differ.
    return {name: colormaps["turbo"]((0.3 + 0.618 * k) % 1.0) for k, name in enumerate(names)}


def _drawn(demonstrations: DemonstrationSet) -> list[Episode]:
    if len(demonstrations) <= MOST_DRAWN:
        return list(demonstrations)
    return [demonstrations[int(k)] for k in np.linspace(0, len(demonstrations) - 1, MOST_DRAWN)]


def _draw_coordinate(
    axes: Axes, demonstrations: DemonstrationSet, space: str, number: int, colours: dict[str, Any]
) -> None:
    for episode in _drawn(demonstrations):
        trajectory: Trajectory | None = getattr(episode, space)
        if trajectory is None or number >= trajectory.values.shape[1]:
            continue
        samples = min(len(trajectory), _MOST_SAMPLES)
        times = np.linspace(trajectory.times[0], trajectory.times[-1], samples)
        values = trajectory.at(times)[:, number]
        colour = colours[episode.target_id]
        axes.plot(times, values, color=colour, linewidth=0.6, alpha=0.7)
        weights = episode.joint_weights if space == "joints" else episode.task_weights
        if weights is not None:
            phase = np.linspace(0.0, 1.0, samples)
            deviation = 2.0 * weights.std(phase)[:, number]
            axes.fill_between(
                times, values - deviation, values + deviation, color=colour, alpha=0.06, linewidth=0
            )
    clocks = {episode.movement.clock for episode in demonstrations}
    axes.set_xlabel("time [s]" if clocks == {"seconds"} else "phase", fontsize=6)


def _draw_photograph(axes: Axes, scene: DemonstrationSet, colours: dict[str, Any]) -> None:
    """The first photograph of a scene that can be read, with the boxes of its targets."""
    axes.set_axis_off()
    for episode in scene:
        if episode.home is None:
            continue
        try:
            axes.imshow(episode.home.rgb())
        except PunnetError:
            continue
        boxes = {other.target_id: other.target.box for other in scene if other.target is not None}
        for name, box in boxes.items():
            _draw_box(axes, box, colours[name])
        plural = "" if len(boxes) == 1 else "s"
        axes.set_title(f"{episode.group or episode.id}: {len(boxes)} target{plural}", fontsize=8)
        return
    axes.text(0.5, 0.5, "no photograph", ha="center", va="center", fontsize=9)


def _draw_box(axes: Axes, box: NDArray[np.float64], colour: Any) -> None:
    from matplotlib.patches import Rectangle

    x0, y0, x1, y1 = box
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=colour, linewidth=1.5))


def _draw_ends(axes: Axes, demonstrations: DemonstrationSet, colours: dict[str, Any]) -> None:
    """Paths seen from the robot (y to the left, z up), suspects marked; of joints alone the first two."""
    with_poses = [episode for episode in _drawn(demonstrations) if episode.poses is not None]
    if not with_poses:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no poses", ha="center", va="center", fontsize=9)
        return
    for episode in with_poses:
        assert episode.poses is not None
        path = episode.poses.resampled(min(len(episode.poses), 100))
        axes.plot(path[:, 1], path[:, 2], color=colours[episode.target_id], linewidth=0.6, alpha=0.6)
        axes.plot(path[-1, 1], path[-1, 2], "o", color=colours[episode.target_id], markersize=3)
    for suspect in suspect_targets(demonstrations):
        episode = demonstrations[demonstrations.targets[suspect.target_id][0]]
        if episode.poses is not None:
            y, z = episode.poses.end[1:3]
            axes.plot(y, z, "o", markersize=9, markerfacecolor="none", markeredgecolor="black")
            axes.annotate(suspect.target_id, (y, z), xytext=(5, 5), textcoords="offset points", fontsize=7)
    axes.invert_xaxis()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("y [m]", fontsize=7)
    axes.set_ylabel("z [m]", fontsize=7)
    axes.set_title("paths as the robot sees them; circled: box and reach do not fit", fontsize=8)
    axes.tick_params(labelsize=6)
