"""What the readers of demonstrations share: episodes that are refused one by one, arrays that may be anything."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.episode import DemonstrationSet, Episode
from punnet.data.demos.faults import DemoFault, EpisodeRefused
from punnet.data.demos.trajectory import Clock, Space, Trajectory, as_poses
from punnet.errors import FileFormatError, PunnetError, ShapeError
from punnet.scene import Target

__all__ = ["Reading", "number_array", "target_of_box", "trajectory_of"]

Finding = tuple[str, str]


@dataclass
class Reading:
    """The outcome of reading a source: what could be read, and why the rest could not.

    Parameters
    ----------
    path
        The source.
    """

    path: Path
    episodes: list[Episode] = field(default_factory=list)
    left_out: list[DemoFault] = field(default_factory=list)
    info: dict[str, Any] = field(default_factory=dict)
    _ids: set[str] = field(default_factory=set, repr=False)

    @contextmanager
    def episode(self, name: str, file: Path | None = None) -> Iterator[None]:
        """Around the reading of one episode: an error in it is noted, and the next one is read."""
        where = str(self.path if file is None else file)
        try:
            yield
        except EpisodeRefused as error:
            self.left_out += [DemoFault(code, message, where, name) for code, message in error.findings]
        except PunnetError as error:
            self.left_out.append(DemoFault("unreadable", str(error), where, name))

    def add(self, episode: Episode) -> None:
        """Take an episode; refused if there is one of that id.

        Raises
        ------
        EpisodeRefused
            If there is.
        """
        if episode.id in self._ids:
            raise EpisodeRefused([("duplicate-id", "another episode has this id; give each its own")])
        self._ids.add(episode.id)
        self.episodes.append(episode)

    def demonstrations(self) -> DemonstrationSet:
        """The episodes as a set; those whose joints are not those of the most are left out.

        Raises
        ------
        FileFormatError
            If none is left; the message gives the first reason.
        """
        self.drop_other_arms()
        if not self.episodes:
            reason = f": {self.left_out[0]}" if self.left_out else ""
            raise FileFormatError(f"{self.path}: no demonstration could be read{reason}")
        return DemonstrationSet(
            tuple(self.episodes), self.path.resolve().name or str(self.path), dict(self.info)
        )

    def drop_other_arms(self) -> None:
        """Leave out the episodes whose joints are not those of the most."""
        counted = Counter(episode.joints.names for episode in self.episodes if episode.joints is not None)
        if len(counted) < 2:
            return
        usual = counted.most_common(1)[0][0]
        for episode in [e for e in self.episodes if e.joints is not None and e.joints.names != usual]:
            assert episode.joints is not None
            names = episode.joints.names
            message = (
                f"has {len(names)} joints ({', '.join(names)}), most episodes have {len(usual)} "
                f"({', '.join(usual)}); demonstrations of another arm belong in a set of their own"
            )
            self.left_out.append(DemoFault("joint-count", message, str(self.path), episode.id))
            self.episodes.remove(episode)


def number_array(value: Any, what: str) -> NDArray[np.float64]:
    """``value`` as an array of floats; null becomes NaN.

    Raises
    ------
    EpisodeRefused
        If it is ragged or holds anything but numbers.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise EpisodeRefused(
            [("missing-field", f"{what}: numbers in a rectangular array are needed, got {value!r:.60}")]
        ) from error
    if isinstance(value, bool) or (isinstance(value, list) and array.dtype == np.bool_):
        raise EpisodeRefused([("missing-field", f"{what}: numbers are needed")])
    return array


def trajectory_of(
    times: Any,
    values: Any,
    *,
    names: tuple[str, ...] = (),
    space: Space = "joint",
    clock: Clock = "seconds",
) -> Trajectory:
    """Build a checked trajectory of what a file gave.

    Parameters
    ----------
    times, values
        (T,) and (T, D), or anything else.

    Raises
    ------
    EpisodeRefused
        With every fault that there is.
    """
    what = "joints" if space == "joint" else "poses"
    moments, samples = number_array(times, "time"), number_array(values, what)
    samples = np.squeeze(samples, axis=1) if samples.ndim == 3 and samples.shape[1] == 1 else samples
    if findings := list(_shape_findings(moments, samples, what)):
        raise EpisodeRefused(findings)
    if findings := list(_value_findings(moments, samples, what)):
        raise EpisodeRefused(findings)
    try:
        if space == "task":
            return as_poses(moments, samples, clock=clock)
        return Trajectory(moments, samples, names, clock=clock)
    except ShapeError as error:
        raise EpisodeRefused([("bad-pose" if space == "task" else "missing-field", str(error))]) from error


def _shape_findings(times: NDArray[np.float64], values: NDArray[np.float64], what: str) -> Iterator[Finding]:
    if values.ndim != 2 or values.shape[1] < 1 or times.ndim != 1:
        yield (
            "missing-field",
            f"time must be (T,) and {what} (T, D) numbers, got {times.shape} and {values.shape}",
        )
        return
    if len(times) != len(values):
        yield (
            "length-mismatch",
            f"{len(times)} times for {len(values)} samples of {what}; each sample needs its time",
        )
    if min(len(times), len(values)) < 2:
        yield "too-short", f"{len(values)} sample; a movement has at least 2"


def _value_findings(times: NDArray[np.float64], values: NDArray[np.float64], what: str) -> Iterator[Finding]:
    for name, rows in (("time", np.isfinite(times)), (what, np.isfinite(values).all(axis=1))):
        if not rows.all():
            bad = np.flatnonzero(~rows)
            yield (
                "not-finite",
                f"NaN or infinity in {name} of {len(bad)} samples, the first is sample {bad[0]}; "
                "cut the recording before, or fill the gap",
            )
    steps = np.diff(times)
    back = np.flatnonzero(steps <= 0)  # NaN compares as false: told above
    if len(back):
        k = int(back[0])
        kind = "stands still" if (steps[back] == 0).all() else "goes back"
        yield (
            "time-order",
            f"time {kind} at {len(back)} places, first at sample {k + 1} "
            f"({times[k + 1]:.6g} after {times[k]:.6g}); sort the samples, or drop the repeated ones",
        )


def target_of_box(box: Any, *, point: Any = None) -> Target:
    """Target from an xyxy box and, if known, its picking point.

    Raises
    ------
    EpisodeRefused
        If the box is not four finite numbers of some area, or the point not three.
    """
    corners = number_array(box, "target box")
    if corners.shape != (4,) or not np.isfinite(corners).all():
        raise EpisodeRefused([("bad-box", f"target box must be 4 finite numbers, got {box!r:.80}")])
    if not (corners[0] < corners[2] and corners[1] < corners[3]):
        raise EpisodeRefused([("bad-box", f"target box {corners.tolist()} (xyxy) is empty")])
    try:
        return Target(
            box=corners, picking_point=None if point is None else number_array(point, "target point")
        )
    except ShapeError as error:
        raise EpisodeRefused([("bad-box", str(error))]) from error
