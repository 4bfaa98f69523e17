"""How many demonstrations there are, how long, how far, and how much repeats of the same reach differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import DemonstrationSet
from punnet.data.demos.trajectory import POSE_NAMES, Space

__all__ = ["DemoStatistics", "SpaceStatistics", "demonstration_statistics"]


@dataclass(frozen=True, eq=False)
class SpaceStatistics:
    """The movements in one space.

    Parameters
    ----------
    space
        ``"joint"`` or ``"task"``.
    names
        The D coordinates.
    lowest, highest
        (D,) reached by any sample.
    spread
        (D,) standard deviation of the ends of reaches to the same target, pooled; of weights their own at the
        end. NaN if no target was reached twice.
    """

    space: Space
    names: tuple[str, ...]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    spread: NDArray[np.float64]

    def to_json(self) -> dict[str, Any]:
        """Plain values; what is not known is null."""
        return {
            name: {"lowest": float(low), "highest": float(high), "end_spread": _known(spread)}
            for name, low, high, spread in zip(
                self.names, self.lowest, self.highest, self.spread, strict=True
            )
        }


@dataclass(frozen=True, eq=False)
class DemoStatistics:
    """Counts of a set.

    Parameters
    ----------
    name
        Of the set.
    episodes, targets, groups, photographs, samples
        How many there are.
    durations, rates
        Of the episodes whose source told: seconds, and samples a second.
    spaces
        Joint space, task space, or both.
    """

    name: str
    episodes: int
    targets: int
    groups: int
    photographs: int
    samples: int
    durations: NDArray[np.float64]
    rates: NDArray[np.float64]
    spaces: tuple[SpaceStatistics, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain values; what is not known is null."""
        return {
            "name": self.name,
            "episodes": self.episodes,
            "targets": self.targets,
            "groups": self.groups,
            "photographs": self.photographs,
            "samples": self.samples,
            "seconds": _range(self.durations),
            "samples_per_second": _range(self.rates),
            **{f"{space.space}_space": space.to_json() for space in self.spaces},
        }


def demonstration_statistics(demonstrations: DemonstrationSet) -> DemoStatistics:
    """Count a set."""
    timed = [e.movement for e in demonstrations if e.movement.clock == "seconds"]
    durations = np.array([trajectory.duration for trajectory in timed])
    counts = np.array([len(trajectory) - 1 for trajectory in timed])
    spaces = (_space(demonstrations, "joint"), _space(demonstrations, "task"))
    return DemoStatistics(
        name=demonstrations.name,
        episodes=len(demonstrations),
        targets=len(demonstrations.targets),
        groups=len(demonstrations.groups),
        photographs=sum(len(episode.photographs) for episode in demonstrations),
        samples=sum(len(episode.movement) for episode in demonstrations),
        durations=durations,
        rates=counts / durations,
        spaces=tuple(space for space in spaces if space is not None),
    )


def _space(demonstrations: DemonstrationSet, space: Space) -> SpaceStatistics | None:
    parts = [e.joints if space == "joint" else e.poses for e in demonstrations]
    known = [part for part in parts if part is not None]
    if not known:
        return None
    squares, freedom = np.zeros(known[0].values.shape[1]), 0
    for indices in demonstrations.targets.values():
        ends = np.array([part.end for index in indices if (part := parts[index]) is not None])
        if len(ends) > 1:
            squares += np.square(ends - ends.mean(axis=0)).sum(axis=0)
            freedom += len(ends) - 1
    spread = np.sqrt(squares / freedom) if freedom else _weights_spread(demonstrations, space, len(squares))
    return SpaceStatistics(
        space,
        known[0].names if space == "joint" else POSE_NAMES,
        np.min([part.values.min(axis=0) for part in known], axis=0),
        np.max([part.values.max(axis=0) for part in known], axis=0),
        spread,
    )


def _weights_spread(demonstrations: DemonstrationSet, space: Space, count: int) -> NDArray[np.float64]:
    """Root mean square over targets of the weights' standard deviation at the end."""
    all_weights = [e.joint_weights if space == "joint" else e.task_weights for e in demonstrations]
    variances = [np.square(weights.std([1.0])[0]) for weights in all_weights if weights is not None]
    return np.sqrt(np.mean(variances, axis=0)) if variances else np.full(count, np.nan)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _range(values: NDArray[np.float64]) -> dict[str, float] | None:
    if not len(values):
        return None
    return {
        "least": float(values.min()),
        "median": float(np.median(values)),
        "most": float(values.max()),
    }
