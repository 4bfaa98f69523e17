"""From a joint path without time to a trajectory that an arm may execute: rest to rest, within limits.

1. The path is rounded to a quintic B-spline (C⁴, so even jerk is continuous along it) whose control points
   lie on the path: the curve stays in the hull of the path, so it can't overshoot a joint limit, and starts
   and ends exactly where the path does.
2. The fastest motion along it within velocity and acceleration limits (:mod:`punnet.movement.path_speed`) is
   low-passed in time by a triangle, which bounds and smooths jerk and never leaves the path.
3. The sampled trajectory is verified between its samples too. Where a limit does not hold the arm is told to
   go slower there and step 2 repeats; what is left is stretched in time: by a factor k, velocity,
   acceleration and jerk fall by k, k² and k³.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, PPoly

from punnet.errors import ConfigurationError, KinematicsError, ShapeError
from punnet.movement.joint_trajectory import JointTrajectory
from punnet.movement.path_speed import fastest_motion

__all__ = ["JointLimits", "retime"]

DEGREE = 5
CONTROL_POINTS = (6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
GRID = 200
"""Least number of steps along the path in which its speed is chosen."""
EASING_ROUNDS = 3
EASED = 1.01
"""An excess over the limits up to this is left to stretching."""
LOW_PASS_STEPS = 2
"""Half the width of the low-pass in time steps: changes of acceleration must show in the samples."""
SAME_POINT = 1e-9
POSITION_TOLERANCE = 1e-6
SUBSAMPLES = 8
MINIMUM_STEPS = 2


@dataclass(frozen=True, eq=False)
class JointLimits:
    """What the joints of an arm may do.

    Parameters
    ----------
    lower, upper
        (J,) positions in radians.
    velocity, acceleration, jerk
        (J,) largest magnitudes in rad/s, rad/s², rad/s³.
    joint_names
        J names that trajectories carry; ``joint1`` … ``jointJ`` if empty.

    Raises
    ------
    ShapeError
        If shapes disagree, a bound is not finite or positive, or a lower limit is not below its upper one.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    jerk: NDArray[np.float64]
    joint_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        size = np.asarray(self.lower).size
        for name in ("lower", "upper", "velocity", "acceleration", "jerk"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (size,) or size == 0 or not np.isfinite(array).all():
                raise ShapeError(f"joint limits: {name} must be ({size},) finite numbers, got {array.shape}")
            if name not in ("lower", "upper") and (array <= 0).any():
                raise ShapeError(f"joint limits: {name} must be positive, got {array}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if (self.lower >= self.upper).any():
            raise ShapeError(f"joint limits: lower {self.lower} must be below upper {self.upper}")
        if self.joint_names and len(self.joint_names) != size:
            raise ShapeError(f"joint limits: {size} joint names needed, got {self.joint_names}")

    def __len__(self) -> int:
        return int(self.lower.size)

    def slowed(self, speed: float) -> JointLimits:
        """Limits at a fraction of the speed: velocity × speed, acceleration × speed², jerk × speed³."""
        return JointLimits(
            self.lower,
            self.upper,
            self.velocity * speed,
            self.acceleration * speed**2,
            self.jerk * speed**3,
            self.joint_names,
        )


def retime(
    path: ArrayLike,
    limits: JointLimits,
    *,
    speed: float = 1.0,
    time_step: float = 0.01,
    tolerance: float = 0.005,
) -> JointTrajectory:
    """Give a joint path its time: rest to rest, within position, velocity, acceleration and jerk limits.

    Parameters
    ----------
    path
        (N, J) joint positions in radians, N ≥ 2; their spacing does not matter, repeats are ignored.
    limits
        What the arm may do.
    speed
        In (0, 1]: the motion takes about 1/speed times as long as it could.
    time_step
        Seconds between samples; the duration is a multiple of it.
    tolerance
        Radians by which corners of the path may be rounded. Both ends are kept exactly.

    Returns
    -------
    JointTrajectory
        With velocities and accelerations. Its own interpolation (quintic Hermite) holds the limits
        everywhere.

    Raises
    ------
    ShapeError
        If the path is not a finite (N, J) array.
    KinematicsError
        If the path leaves the position limits; the message names the joint and the point.
    ConfigurationError
        If ``speed``, ``time_step`` or ``tolerance`` is out of range.
    """
    if not 0 < speed <= 1:
        raise ConfigurationError(f"retime: speed must be in (0, 1], got {speed}")
    if not 0 < time_step <= 1 or not tolerance > 0:
        raise ConfigurationError(
            f"retime: time_step must be in (0, 1] s and tolerance positive, got {time_step} and {tolerance}"
        )
    points = _validated_path(path, limits)
    if len(points) == 1:
        rest = np.zeros((2, points.shape[1]))
        return JointTrajectory(
            np.array([0.0, time_step]), points[[0, 0]], rest, rest.copy(), limits.joint_names
        )
    allowed = limits.slowed(speed)
    spline = _rounded(points, allowed.velocity, tolerance)
    return _timed(spline, allowed, time_step, LOW_PASS_STEPS * time_step / speed)


def _validated_path(path: ArrayLike, limits: JointLimits) -> NDArray[np.float64]:
    """Check the path and drop repeated points; at least its first point is kept."""
    points = np.asarray(path, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != len(limits):
        raise ShapeError(f"retime: path must be (N ≥ 2, {len(limits)}), got {points.shape}")
    if not np.isfinite(points).all():
        bad = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise ShapeError(f"retime: path point {bad} is not finite: {points[bad]}")
    excess = np.maximum(limits.lower - points, points - limits.upper)
    if excess.max() > POSITION_TOLERANCE:
        index, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
        raise KinematicsError(
            f"retime: path point {index} has joint {joint + 1} at {points[index, joint]:.4f} rad, outside "
            f"[{limits.lower[joint]:.4f}, {limits.upper[joint]:.4f}]"
        )
    moved = np.concatenate(([True], np.abs(np.diff(points, axis=0)).max(axis=1) > SAME_POINT))
    kept = points[moved]
    if len(kept) > 1:
        kept[-1] = points[-1]
    return kept


def _rounded(points: NDArray[np.float64], velocity: NDArray[np.float64], tolerance: float) -> BSpline:
    """Quintic B-spline with the fewest control points on the path that stays within ``tolerance`` of it.

    The parameter x is the time in seconds that the path takes with the slowest joint always at full speed.
    Control points at the Greville abscissae: Schoenberg's variation-diminishing approximation.
    """
    steps = (np.abs(np.diff(points, axis=0)) / velocity).max(axis=1)
    x = np.concatenate(([0.0], np.cumsum(steps)))
    length = float(x[-1])
    dense = np.union1d(x, np.linspace(0.0, length, 257))
    wanted = _on_polyline(dense, x, points)
    for count in CONTROL_POINTS:
        inner = np.linspace(0.0, length, count - DEGREE + 1)
        knots = np.concatenate((np.zeros(DEGREE), inner, np.full(DEGREE, length)))
        greville = np.array([knots[i + 1 : i + 1 + DEGREE].mean() for i in range(count)])
        spline = BSpline(knots, _on_polyline(greville, x, points), DEGREE)
        if np.abs(spline(dense) - wanted).max() <= tolerance:
            break
    return spline


def _on_polyline(
    where: NDArray[np.float64], x: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.stack([np.interp(where, x, column) for column in points.T], axis=1)


def _timed(spline: BSpline, limits: JointLimits, time_step: float, half_width: float) -> JointTrajectory:
    """Find the fastest trajectory along the spline, eased where its smoothed motion breaks the limits."""
    length = float(spline.t[-1])
    x = np.linspace(0.0, length, max(GRID, 2 * len(spline.c)) + 1)
    first, second = spline(x, nu=1), spline(x, nu=2)
    ease = np.ones(len(x))
    best: JointTrajectory | None = None
    for _ in range(EASING_ROUNDS):
        velocity, acceleration = np.outer(ease, limits.velocity), np.outer(ease**2, limits.acceleration)
        motion = _Motion(
            spline, fastest_motion(first, second, float(x[1]), velocity, acceleration), half_width
        )
        count = max(MINIMUM_STEPS, int(np.ceil(motion.duration / time_step - 1e-9)))
        times, excess = _excess(motion.sampled(count, time_step, limits.joint_names), limits)
        trajectory = _stretched(motion, int(np.ceil(count * excess.max())), time_step, limits)
        if best is None or trajectory.duration < best.duration:
            best = trajectory
        if excess.max() <= EASED:
            break
        where = times * motion.duration / (count * time_step) - half_width
        ease /= np.maximum(1.0, _window_maximum(where, excess, motion.place.x[1:-1], half_width))
    assert best is not None
    return best


class _Motion:
    """A spline q(x), a place x(t) on it, and the low-pass over time between them."""

    def __init__(self, spline: BSpline, place: PPoly, half_width: float) -> None:
        self.spline = spline
        self.half_width = half_width
        self.fastest = float(place.x[-1])
        # At rest before and after, as far as the low-pass looks.
        times = np.concatenate(([-2 * half_width], place.x, [self.fastest + 2 * half_width]))
        rest = np.array([[[0.0], [0.0], [0.0]], [[0.0], [0.0], [float(spline.t[-1])]]])
        self.place = PPoly(np.concatenate((rest[0], place.c, rest[1]), axis=1), times)
        self.integrals = (self.place.antiderivative(2), self.place.antiderivative(1), self.place)

    @property
    def duration(self) -> float:
        return self.fastest + 2 * self.half_width

    def sampled(self, count: int, time_step: float, joint_names: tuple[str, ...]) -> JointTrajectory:
        """``count`` steps, stretched from the motion's own duration to ``count · time_step``."""
        stretch = count * time_step / self.duration
        clock = np.linspace(-self.half_width, self.fastest + self.half_width, count + 1)
        before = np.maximum(clock - self.half_width, self.place.x[0])
        after = np.minimum(clock + self.half_width, self.place.x[-1])
        # Low-pass by a triangle: second differences of the second integral, and so on for its derivatives.
        x, rate, change = ((f(after) - 2 * f(clock) + f(before)) / self.half_width**2 for f in self.integrals)
        rate, change = rate[:, None] / stretch, change[:, None] / stretch**2
        for ends in (rate, change):
            ends[[0, -1]] = 0.0
        x = np.clip(x, 0.0, self.spline.t[-1])
        x[0], x[-1] = 0.0, self.spline.t[-1]
        first, second = self.spline(x, nu=1), self.spline(x, nu=2)
        return JointTrajectory(
            np.arange(count + 1, dtype=np.float64) * time_step,
            self.spline(x),
            first * rate,
            second * rate**2 + first * change,
            joint_names,
        )


def _stretched(motion: _Motion, count: int, time_step: float, limits: JointLimits) -> JointTrajectory:
    """Sample the motion in the fewest time steps from ``count`` on that hold the limits."""
    count = max(MINIMUM_STEPS, count)
    while True:
        trajectory = motion.sampled(count, time_step, limits.joint_names)
        excess = float(_excess(trajectory, limits)[1].max())
        if excess <= 1.0:
            return trajectory
        count = max(count + 1, int(np.ceil(count * excess)))


def _excess(
    trajectory: JointTrajectory, limits: JointLimits
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find how much time would have to be stretched for the limits to hold, at many times."""
    substeps = np.linspace(0.0, 1.0, SUBSAMPLES, endpoint=False)
    times = (trajectory.times[:-1, None] + substeps * np.diff(trajectory.times)[:, None]).ravel()
    factor = np.zeros(len(times))
    for order, bound in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        worst = (np.abs(trajectory.sample(times, derivative=order)) / bound).max(axis=1)
        factor = np.maximum(factor, worst ** (1.0 / order))
    return times, factor


def _window_maximum(
    times: NDArray[np.float64], values: NDArray[np.float64], centres: NDArray[np.float64], half_width: float
) -> NDArray[np.float64]:
    """Largest of the values whose times lie within ``half_width`` of each centre; 0 where none does."""
    begin = np.searchsorted(times, centres - half_width)
    end = np.searchsorted(times, centres + half_width, side="right")
    return np.array([values[i:j].max(initial=0.0) for i, j in zip(begin, end, strict=True)])
