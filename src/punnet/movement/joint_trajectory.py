"""A timed joint path: what a robot executes, in the shape of ROS's ``trajectory_msgs/JointTrajectory``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PPoly

from punnet.errors import FileFormatError, ShapeError
from punnet.movement.peaks import peak_rates

__all__ = ["JointTrajectory"]

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Joint positions over time.

    Parameters
    ----------
    times
        (T,) seconds from the start of the motion, strictly increasing, first ≥ 0, T ≥ 2.
    positions
        (T, J) radians.
    velocities
        (T, J) radians per second, None if unknown.
    accelerations
        (T, J) radians per second squared, None if unknown; only together with ``velocities``.
    joint_names
        J names; ``joint1`` … ``jointJ`` if empty.

    Raises
    ------
    ShapeError
        If an array has the wrong shape, is not finite, or the times don't increase.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64] | None = None
    accelerations: NDArray[np.float64] | None = None
    joint_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        times = _read_only(self.times)
        positions = _read_only(self.positions)
        if times.ndim != 1 or times.size < 2:
            raise ShapeError(f"trajectory: times must be (T,) with T ≥ 2, got {times.shape}")
        if not np.isfinite(times).all() or times[0] < 0 or (np.diff(times) <= 0).any():
            raise ShapeError("trajectory: times must be finite, not negative and strictly increasing")
        if positions.ndim != 2 or positions.shape[0] != times.size or positions.shape[1] < 1:
            raise ShapeError(f"trajectory: positions must be ({times.size}, J), got {positions.shape}")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        for name in ("positions", "velocities", "accelerations"):
            value = getattr(self, name)
            if value is None:
                continue
            array = _read_only(value)
            if array.shape != positions.shape or not np.isfinite(array).all():
                raise ShapeError(f"trajectory: {name} must be finite {positions.shape}, got {array.shape}")
            object.__setattr__(self, name, array)
        if self.accelerations is not None and self.velocities is None:
            raise ShapeError("trajectory: accelerations without velocities; give both or neither")
        names = tuple(self.joint_names) or tuple(f"joint{j + 1}" for j in range(positions.shape[1]))
        if len(names) != positions.shape[1] or len(set(names)) != len(names):
            raise ShapeError(f"trajectory: {positions.shape[1]} different joint names needed, got {names}")
        object.__setattr__(self, "joint_names", names)

    def __len__(self) -> int:
        return int(self.times.size)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last point."""
        return float(self.times[-1] - self.times[0])

    @property
    def start(self) -> NDArray[np.float64]:
        """First joint positions (J,)."""
        return np.asarray(self.positions[0])

    @property
    def end(self) -> NDArray[np.float64]:
        """Last joint positions (J,)."""
        return np.asarray(self.positions[-1])

    @cached_property
    def _interpolant(self) -> PPoly:
        return PPoly(_hermite_coefficients(self), self.times)

    def sample(self, t: ArrayLike, *, derivative: int = 0) -> NDArray[np.float64]:
        """Positions, or a time derivative of them, at any times.

        Piecewise linear without velocities, cubic Hermite with them, quintic Hermite with accelerations too.

        Parameters
        ----------
        t
            Times (...) in seconds. Before the first and after the last point the arm stands still there.
        derivative
            0 for radians, 1 for radians per second, 2, 3 … for what follows.

        Returns
        -------
        NDArray
            (..., J).
        """
        t = np.asarray(t, dtype=np.float64)
        if derivative < 0:
            raise ShapeError(f"trajectory: derivative must be ≥ 0, got {derivative}")
        values = self._interpolant(np.clip(t, self.times[0], self.times[-1]), nu=derivative)
        if derivative:
            values = np.where(((t < self.times[0]) | (t > self.times[-1]))[..., None], 0.0, values)
        return np.asarray(values, dtype=np.float64)

    def peak_rates(self) -> NDArray[np.float64]:
        """Bounds (3, J) of velocity, acceleration and jerk, in magnitude, that :meth:`sample` keeps at all times.

        Never below the peaks, and little above them: :func:`punnet.movement.peaks.peak_rates`. Where velocities
        (accelerations) are unknown, they jump between the pieces, and what follows them is that of the pieces.
        """
        return peak_rates(self._interpolant)

    def resample(self, time_step: float) -> JointTrajectory:
        """Points every ``time_step`` seconds; the last step is shorter if the duration is no multiple."""
        if not time_step > 0:
            raise ShapeError(f"trajectory: time_step must be positive seconds, got {time_step}")
        count = max(1, int(np.ceil(self.duration / time_step - 1e-9)))
        times = np.minimum(self.times[0] + time_step * np.arange(count + 1), self.times[-1])
        times[-1] = self.times[-1]
        return JointTrajectory(
            times,
            self.sample(times),
            None if self.velocities is None else self.sample(times, derivative=1),
            None if self.accelerations is None else self.sample(times, derivative=2),
            self.joint_names,
        )

    def stretched(self, factor: float) -> JointTrajectory:
        """The same path, ``factor`` times as slow: velocities fall by it, accelerations by its square.

        A factor of at least 1 keeps every limit that held.
        """
        if not (np.isfinite(factor) and factor > 0):
            raise ShapeError(f"trajectory: the factor must be positive, got {factor}")
        return JointTrajectory(
            self.times * factor,
            self.positions,
            None if self.velocities is None else self.velocities / factor,
            None if self.accelerations is None else self.accelerations / factor**2,
            self.joint_names,
        )

    @classmethod
    def concatenate(
        cls, trajectories: Sequence[JointTrajectory], *, tolerance: float = 1e-3
    ) -> JointTrajectory:
        """One after another; each must start within ``tolerance`` radians of where the one before it ends.

        Velocities (accelerations) are kept if all parts have them.

        Raises
        ------
        ShapeError
            If there is no trajectory, the joints differ, or there is a gap between two parts.
        """
        if not trajectories:
            raise ShapeError("trajectory: nothing to concatenate")
        parts: dict[str, list[NDArray[np.float64]]] = {"positions": [], "velocities": [], "accelerations": []}
        kept = [name for name in parts if all(getattr(part, name) is not None for part in trajectories)]
        times: list[NDArray[np.float64]] = []
        clock = float(trajectories[0].times[0])
        for i, part in enumerate(trajectories):
            if part.joint_names != trajectories[0].joint_names:
                raise ShapeError(f"trajectory: part {i} moves other joints than part 0: {part.joint_names}")
            if i and (gap := float(np.abs(part.start - trajectories[i - 1].end).max())) > tolerance:
                raise ShapeError(f"trajectory: part {i} starts {gap:.4f} rad from the end of part {i - 1}")
            first = 1 if i else 0
            times.append(part.times[first:] - part.times[0] + clock)
            clock += part.duration
            for name in kept:
                parts[name].append(getattr(part, name)[first:])
        arrays = {name: np.concatenate(parts[name]) for name in kept}
        return cls(np.concatenate(times), **arrays, joint_names=trajectories[0].joint_names)

    def to_json(self) -> dict[str, Any]:
        """Return ``joint_names`` and ``points`` as ``trajectory_msgs/JointTrajectory`` has them."""
        points = []
        for i, time in enumerate(self.times):
            seconds, nanoseconds = divmod(round(float(time) * NANOSECONDS), NANOSECONDS)
            point: dict[str, Any] = {"positions": self.positions[i].tolist()}
            for name in ("velocities", "accelerations"):
                array = getattr(self, name)
                point[name] = [] if array is None else array[i].tolist()
            point["time_from_start"] = {"sec": seconds, "nanosec": nanoseconds}
            points.append(point)
        return {"joint_names": list(self.joint_names), "points": points}

    @classmethod
    def from_json(cls, data: Any, *, where: str = "trajectory JSON") -> JointTrajectory:
        """Read what :meth:`to_json` wrote, or a ROS 1 / ROS 2 message as JSON (``secs``/``nsecs`` too).

        Raises
        ------
        FileFormatError
            If a field is missing or malformed; ``where`` names the source in the message.
        """
        try:
            points = data["points"]
            times = np.array([_seconds(point["time_from_start"]) for point in points])
            arrays: dict[str, NDArray[np.float64]] = {}
            for name in ("positions", "velocities", "accelerations"):
                rows = [point.get(name) or [] for point in points]
                if name == "positions" or any(rows):
                    arrays[name] = np.array(rows, dtype=np.float64)
            return cls(times, **arrays, joint_names=tuple(str(name) for name in data.get("joint_names", ())))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise FileFormatError(
                f"{where}: not a JointTrajectory ({type(error).__name__}: {error})"
            ) from error


def _read_only(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def _seconds(stamp: Any) -> float:
    if isinstance(stamp, int | float):
        return float(stamp)
    seconds = stamp["sec"] if "sec" in stamp else stamp["secs"]
    nanoseconds = stamp["nanosec"] if "nanosec" in stamp else stamp["nsecs"]
    return float(seconds) + float(nanoseconds) / NANOSECONDS


def _hermite_coefficients(trajectory: JointTrajectory) -> NDArray[np.float64]:
    """Coefficients (degree + 1, T − 1, J), highest power first, of the Hermite piece on each interval."""
    h = np.diff(trajectory.times)[:, None]
    p0, p1 = trajectory.positions[:-1], trajectory.positions[1:]
    if trajectory.velocities is None:
        return np.stack(((p1 - p0) / h, p0))
    v0, v1 = trajectory.velocities[:-1], trajectory.velocities[1:]
    if trajectory.accelerations is None:
        chord = (p1 - p0) / h
        return np.stack(((v0 + v1 - 2 * chord) / h**2, (3 * chord - 2 * v0 - v1) / h, v0, p0))
    a0, a1 = trajectory.accelerations[:-1], trajectory.accelerations[1:]
    # What the end of the interval still asks for after the Taylor part of its beginning.
    position = p1 - (p0 + h * (v0 + h * a0 / 2))
    velocity = v1 - (v0 + h * a0)
    acceleration = a1 - a0
    return np.stack(
        (
            (6 * position - 3 * h * velocity + h**2 * acceleration / 2) / h**5,
            (-15 * position + 7 * h * velocity - h**2 * acceleration) / h**4,
            (10 * position - 4 * h * velocity + h**2 * acceleration / 2) / h**3,
            a0 / 2,
            v0,
            p0,
        )
    )
