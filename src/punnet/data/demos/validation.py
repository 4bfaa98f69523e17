"""A validator of demonstrations: what the reader had to leave out, and what is wrong with the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from punnet.data.demos.checks import ArmLimits, ForwardKinematics, check_episode, pose_offset
from punnet.data.demos.episode import DemonstrationSet
from punnet.data.demos.faults import DemoFault, DemoReport
from punnet.data.demos.formats import read_readable_demos
from punnet.data.demos.pairing import SuspectTarget, suspect_targets

__all__ = ["check_demonstrations", "validate_demos"]

LARGEST_OFFSET = 0.05
"""Metres that a recorded pose may lie off where the joints put it; fitted weights leave a centimetre or two."""

_FEWEST_WITH_POSES = 3
Progress = Callable[[int, int], None]


def validate_demos(
    path: str | Path,
    format: str | None = None,  # noqa: A002
    *,
    limits: ArmLimits | None = None,
    forward_kinematics: ForwardKinematics | None = None,
    progress: Progress | None = None,
) -> DemoReport:
    """Find what is wrong with demonstrations of any format; each photograph is decoded once.

    Parameters
    ----------
    path, format
        As for :func:`~punnet.data.demos.read_demos`.
    limits
        Of the arm; without them neither positions nor speeds are judged.
    forward_kinematics
        Of the arm; without it joints are not held against poses.
    progress
        Called with episodes done and episodes in all.

    Raises
    ------
    FileFormatError
        If nothing is at the path, or its format can't be guessed.
    """
    reading = read_readable_demos(path, format)
    demonstrations = DemonstrationSet(tuple(reading.episodes), Path(path).name)
    faults = check_demonstrations(
        demonstrations,
        where=str(path),
        limits=limits,
        forward_kinematics=forward_kinematics,
        progress=progress,
    )
    return DemoReport(Path(path), len(demonstrations), (*reading.left_out, *faults))


def check_demonstrations(
    demonstrations: DemonstrationSet,
    *,
    where: str = "",
    limits: ArmLimits | None = None,
    forward_kinematics: ForwardKinematics | None = None,
    progress: Progress | None = None,
) -> tuple[DemoFault, ...]:
    """Find what is wrong with demonstrations that could be read, one by one and as a set."""
    place = where or demonstrations.name
    faults: list[DemoFault] = []
    for done, episode in enumerate(demonstrations, start=1):
        faults += [DemoFault(code, text, place, episode.id) for code, text in check_episode(episode, limits)]
        if progress is not None:
            progress(done, len(demonstrations))
    faults += _duplicates(demonstrations, place)
    if forward_kinematics is not None and len(demonstrations.joint_names) == 7:
        faults += _mismatches(demonstrations, forward_kinematics, place)
    arm = forward_kinematics if len(demonstrations.joint_names) == 7 else None
    for suspect in suspect_targets(demonstrations, arm):
        first = demonstrations[demonstrations.targets[suspect.target_id][0]].id
        code = "suspected-mismatch" if suspect.swapped_with is None else "suspected-swap"
        faults.append(DemoFault(code, _told(suspect), place, first))
    return tuple(faults)


def _told(suspect: SuspectTarget) -> str:
    off = (
        f"target '{suspect.target_id}' is reached {1e3 * suspect.residual:.0f} mm from where its box lies "
        f"({suspect.distance:.1f} standard deviations of the others)"
    )
    if suspect.swapped_with is None:
        return f"{off} and no other box of its scene fits; look at its picture"
    return f"{off}; exchanged with '{suspect.swapped_with}' both fit: were their boxes swapped?"


def _duplicates(demonstrations: DemonstrationSet, place: str) -> Iterator[DemoFault]:
    seen: dict[bytes, str] = {}
    for episode in demonstrations:
        content = np.round(episode.movement.values, 9).tobytes()
        if content in seen:
            message = f"is sample for sample the movement of episode '{seen[content]}'; leave one of them out"
            yield DemoFault("duplicate", message, place, episode.id)
        else:
            seen[content] = episode.id


def _mismatches(
    demonstrations: DemonstrationSet, forward_kinematics: ForwardKinematics, place: str
) -> Iterator[DemoFault]:
    """Episodes whose poses are not fixed to the arm at the point where those of the others are."""
    offsets = {}
    for episode in demonstrations:
        offset = pose_offset(episode, forward_kinematics)
        if offset is not None:
            offsets[episode.id] = offset
    if len(offsets) < _FEWEST_WITH_POSES:
        return
    usual = np.median([np.median(offset, axis=0) for offset in offsets.values()], axis=0)
    for name, offset in offsets.items():
        farthest = float(np.linalg.norm(offset - usual, axis=1).max())
        if farthest > LARGEST_OFFSET:
            message = (
                f"poses lie up to {1e3 * farthest:.0f} mm off where its joints put them, the other episodes' tool "
                "point taken; joints and poses are of different movements, or one of them is stale"
            )
            yield DemoFault("pose-mismatch", message, place, name)
