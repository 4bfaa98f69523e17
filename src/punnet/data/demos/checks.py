"""What can be wrong with a demonstration that can be read: jumps, limits, gaps, poses and covariances that are none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from punnet.data.demos.episode import Episode
from punnet.data.demos.trajectory import Trajectory
from punnet.errors import PunnetError

__all__ = ["ArmLimits", "ForwardKinematics", "check_episode", "find_jumps", "pose_offset"]

Array: TypeAlias = NDArray[np.float64]
Finding = tuple[str, str]
ForwardKinematics: TypeAlias = Callable[[Array], Array]
"""Joints (..., J) to poses (..., 4, 4) of the link that the recorded poses are fixed to."""

JUMP_FACTOR = 5.0
"""A step is a jump if its speed differs this many times more from its neighbours' than the movement is fast."""

SMALLEST_JUMP = {"joint": 0.05, "task": 0.02}
"""Radians and metres below which a step is none, however sudden."""

_NEIGHBOURS = 11
_FAST = 0.85  # quantile of the speeds that tells how fast a movement is, a few jumps or none
_GAP_FACTOR, _SHORTEST_GAP = 5.0, 0.1  # of the usual step; seconds
_AT_REST = 1e-3  # radians, metres
_LIMIT_TOLERANCE = 1e-4  # radians
_SPEED_TOLERANCE = 1.02
_SHORTEST_QUATERNION = 0.9
_PHASES = np.linspace(0.0, 1.0, 100)


class ArmLimits(Protocol):
    """Limits of an arm's joints, each (J,): a :class:`punnet.movement.JointLimits` will do."""

    @property
    def lower(self) -> Array:
        """Radians."""

    @property
    def upper(self) -> Array:
        """Radians."""

    @property
    def velocity(self) -> Array:
        """Radians per second."""


def check_episode(episode: Episode, limits: ArmLimits | None = None) -> Iterator[Finding]:
    """Yield (code, message) of each fault of one episode; its first photograph is read.

    Parameters
    ----------
    episode
        The episode.
    limits
        Of the arm, if it is known and has as many joints; positions and speeds are held against them.
    """
    yield from _photographs(episode)
    for trajectory in (episode.joints, episode.poses):
        if trajectory is not None:
            yield from _jumps(trajectory)
            yield from _gaps(trajectory)
    if episode.joints is not None:
        if np.ptp(episode.joints.values, axis=0).max() < _AT_REST:
            yield "no-motion", "no joint moves by more than 1 mrad; a demonstration is a movement"
        if limits is not None and len(limits.lower) == episode.joints.values.shape[1]:
            yield from _limits(episode.joints, limits)
    elif episode.poses is not None and np.ptp(episode.poses.values[:, :3], axis=0).max() < _AT_REST:
        yield "no-motion", "the tool moves by less than 1 mm; a demonstration is a movement"
    yield from _weights(episode)


def _photographs(episode: Episode) -> Iterator[Finding]:
    if episode.home is None:
        return
    try:
        episode.home.frame()
    except PunnetError as error:
        yield "unreadable-image", str(error)


def find_jumps(trajectory: Trajectory) -> NDArray[np.int64]:
    """Indices of the samples that the movement jumps to."""
    values = trajectory.values if trajectory.space == "joint" else trajectory.values[:, :3]
    if len(values) < 4:
        return np.zeros(0, dtype=np.int64)
    steps = np.diff(values, axis=0)
    speeds = steps / np.diff(trajectory.times)[:, None]
    usual = np.asarray(median_filter(speeds, size=(_NEIGHBOURS, 1), mode="mirror"))
    fast = np.maximum(np.quantile(np.abs(speeds), _FAST, axis=0), np.abs(usual))
    sudden = np.abs(speeds - usual) > JUMP_FACTOR * fast
    large = np.abs(steps) > SMALLEST_JUMP[trajectory.space]
    return np.asarray(np.flatnonzero((sudden & large).any(axis=1)) + 1)


def _jumps(trajectory: Trajectory) -> Iterator[Finding]:
    jumps = find_jumps(trajectory)
    if not len(jumps):
        return
    k = int(jumps[0])
    steps = trajectory.values[k] - trajectory.values[k - 1]
    which = int(np.argmax(np.abs(steps if trajectory.space == "joint" else steps[:3])))
    unit = "rad" if trajectory.space == "joint" else "m"
    yield (
        "jump",
        f"{trajectory.names[which]} jumps by {steps[which]:+.3g} {unit} at sample {k} "
        f"(t = {trajectory.times[k]:.4g}), {len(jumps)} jumps in all; cut the recording there, or record it again",
    )


def _gaps(trajectory: Trajectory) -> Iterator[Finding]:
    steps = np.diff(trajectory.times)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP_FACTOR * usual)
    if trajectory.clock == "seconds":
        gaps = gaps[steps[gaps] > _SHORTEST_GAP]
    if len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        yield (
            "time-gap",
            f"{len(gaps)} gaps between samples, the longest {steps[longest]:.3g} s after sample {longest} "
            f"(usual step {usual:.3g} s); the movement is drawn straight there",
        )


def _limits(joints: Trajectory, limits: ArmLimits) -> Iterator[Finding]:
    low, high = joints.values.min(axis=0), joints.values.max(axis=0)
    beyond = np.maximum(limits.lower - low, high - limits.upper)
    if (beyond > _LIMIT_TOLERANCE).any():
        worst = int(np.argmax(beyond))
        reached = (
            low[worst]
            if limits.lower[worst] - low[worst] >= high[worst] - limits.upper[worst]
            else high[worst]
        )
        names = ", ".join(joints.names[j] for j in np.flatnonzero(beyond > _LIMIT_TOLERANCE))
        yield (
            "joint-limit",
            f"{names} beyond the arm's limits; {joints.names[worst]} reaches {reached:.4f} rad, {beyond[worst]:.4f} "
            "too far: as it is the arm can't follow it",
        )
    if joints.clock != "seconds":
        return
    speeds = np.abs(np.diff(joints.values, axis=0) / np.diff(joints.times)[:, None]).max(axis=0)
    share = speeds / limits.velocity
    if share.max() > _SPEED_TOLERANCE:
        worst = int(np.argmax(share))
        yield (
            "velocity-limit",
            f"{joints.names[worst]} moves at {speeds[worst]:.3g} rad/s, {share[worst]:.2f} times its limit; "
            "retime it before an arm is sent along",
        )


def _weights(episode: Episode) -> Iterator[Finding]:
    for space, weights in (("joint", episode.joint_weights), ("task", episode.task_weights)):
        if weights is None:
            continue
        trajectory = episode.joints if space == "joint" else episode.poses
        names = trajectory.names if trajectory is not None else ()
        smallest, files = weights.smallest_eigenvalues, episode.extra.get("weight_files", ())
        for number in np.flatnonzero(~weights.is_psd):
            name = names[number] if number < len(names) else f"number {number + 1}"
            source = f" ({files[number]})" if number < len(files) else ""
            yield (
                "not-psd",
                f"the covariance of {name}'s weights{source} is not positive semi-definite (smallest eigenvalue "
                f"{smallest[number]:+.2g} of the largest); use its mean only, or fit it again",
            )
        if space == "task":
            shortest = float(np.linalg.norm(weights.mean_values(_PHASES)[:, 3:], axis=1).min())
            if shortest < _SHORTEST_QUATERNION:
                yield (
                    "quaternion-norm",
                    f"the mean quaternion shrinks to length {shortest:.2f}: weights of both signs were averaged; "
                    "the orientation on the way is not to be trusted",
                )


def pose_offset(episode: Episode, forward_kinematics: ForwardKinematics) -> Array | None:
    """(T, 3) where the recorded pose lies in the frame that the joints put it in; None without both.

    It is constant where joints and poses belong together, whatever point of the tool was recorded.
    """
    if episode.joints is None or episode.poses is None or episode.joints.clock != episode.poses.clock:
        return None
    times = episode.joints.times
    inside = (times >= episode.poses.times[0] - 1e-9) & (times <= episode.poses.times[-1] + 1e-9)
    if not inside.any():
        return None
    T = forward_kinematics(np.asarray(episode.joints.values[inside]))
    away = episode.poses.at(times[inside])[:, :3] - T[:, :3, 3]
    return np.asarray(np.einsum("tji,tj->ti", T[:, :3, :3], away))
