"""From a joint path without time to a trajectory that an arm may execute: rest to rest, within limits.

1. The path is rounded to a quintic B-spline (C⁴, so even jerk is continuous along it) whose control
   points lie on the path: the curve stays in the hull of the path, so it can't overshoot a joint limit,
   and starts and ends exactly where the path does. Its parameter x runs with the path's length, or slower where points
   lie close: a movement that dawdles before it turns would be a sharp corner in its length, and all of it as slow
   as that corner. What is quickest counts.
2. The place x on the path follows a jerk-limited profile (ruckig). Its bounds come from
   ``q̇ = q'ẋ``, ``q̈ = q''ẋ² + q'ẍ``, ``q⃛ = q'''ẋ³ + 3q''ẋẍ + q'x⃛`` at their largest along the path.
3. The sampled trajectory is verified at and between its samples, and stretched in time until velocity,
   acceleration and jerk hold: by a factor k they fall by k, k² and k³.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from ruckig import InputParameter, Ruckig
from ruckig import Trajectory as RuckigTrajectory
from scipy.interpolate import BSpline

from punnet.errors import ConfigurationError, KinematicsError, ShapeError
from punnet.movement.joint_trajectory import JointTrajectory

__all__ = ["JointLimits", "retime"]

DEGREE = 5
SPACINGS = (0.0, 0.3, 1.0, 3.0)
"""What each step of the path counts for beside its length, of the mean length: 0 forgets how points are spaced."""
CONTROL_POINTS = (6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
VELOCITY_FRACTIONS = (1.0, 0.9, 0.8, 0.7, 0.55, 0.4)
SAME_POINT = 1e-9
POSITION_TOLERANCE = 1e-6
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
    at_least: float = 0.0,
) -> JointTrajectory:
    """Give a joint path its time: rest to rest, within position, velocity, acceleration and jerk limits.

    Parameters
    ----------
    path
        (N, J) joint positions in radians, N ≥ 2; repeats are ignored. Points may lie as they come: closer ones are a hint of
        where a movement is slow, taken only if it is quicker for it.
    limits
        What the arm may do.
    speed
        In (0, 1]: the motion takes about 1/speed times as long as it could.
    time_step
        Seconds between samples; the duration is a multiple of it.
    tolerance
        Radians by which corners of the path may be rounded. Both ends are kept exactly.
    at_least
        Seconds that the motion takes at least; what would be quicker is slowed down evenly.

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
        If ``speed``, ``time_step``, ``tolerance`` or ``at_least`` is out of range.
    """
    if not 0 < speed <= 1:
        raise ConfigurationError(f"retime: speed must be in (0, 1], got {speed}")
    if not 0 < time_step <= 1 or not tolerance > 0:
        raise ConfigurationError(
            f"retime: time_step must be in (0, 1] s and tolerance positive, got {time_step} and {tolerance}"
        )
    if not 0 <= at_least < np.inf:
        raise ConfigurationError(f"retime: at_least must be seconds ≥ 0, got {at_least}")
    points = _validated_path(path, limits)
    if len(points) == 1:
        rest = np.zeros((2, points.shape[1]))
        return JointTrajectory(
            np.array([0.0, max(time_step, at_least)]), points[[0, 0]], rest, rest.copy(), limits.joint_names
        )
    allowed = limits.slowed(speed)
    spline, profiles = min(
        (
            (rounded, _profiles(rounded, allowed, time_step))
            for rounded in (_rounded(points, allowed.velocity, spacing, tolerance) for spacing in SPACINGS)
        ),
        key=lambda candidate: min(profile.duration for profile in candidate[1]),
    )
    best: JointTrajectory | None = None
    for profile in sorted(profiles, key=lambda profile: profile.duration):
        before = None if best is None else len(best.times) - 1
        timed = _timed(spline, profile, allowed, time_step, at_least, before)
        best = best if timed is None else timed
    assert best is not None  # without a number of steps to stay below, the first is timed
    return best


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


def _rounded(
    points: NDArray[np.float64], velocity: NDArray[np.float64], spacing: float, tolerance: float
) -> BSpline:
    """Quintic B-spline with the fewest control points on the path that stays within ``tolerance`` of it.

    The parameter x is the time in seconds that the path takes with the slowest joint always at full speed, and ``spacing``
    of the mean step more for each step. Control points at the Greville abscissae: Schoenberg's variation-diminishing
    approximation.
    """
    steps = (np.abs(np.diff(points, axis=0)) / velocity).max(axis=1)
    x = np.concatenate(([0.0], np.cumsum(steps + spacing * steps.mean())))
    length = float(x[-1])
    dense = np.union1d(x, np.linspace(0.0, length, 257))
    wanted = _on_polyline(dense, x, points)
    for count in CONTROL_POINTS:
        knots, greville = _knots(count)
        spline = BSpline(length * knots, _on_polyline(length * greville, x, points), DEGREE)
        if np.abs(spline(dense) - wanted).max() <= tolerance:
            break
    return spline


@cache
def _knots(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Knots (count + 6,) from 0 to 1 of a quintic spline, and its Greville abscissae (count,): means of five knots each."""
    inner = np.linspace(0.0, 1.0, count - DEGREE + 1)
    knots = np.concatenate((np.zeros(DEGREE), inner, np.ones(DEGREE)))
    return knots, sliding_window_view(knots[1:-1], DEGREE).mean(axis=1)


def _on_polyline(
    where: NDArray[np.float64], x: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.stack([np.interp(where, x, column) for column in points.T], axis=1)


def _profiles(spline: BSpline, limits: JointLimits, time_step: float) -> list[RuckigTrajectory]:
    """Jerk-limited rest-to-rest motions of x, one per trade of cruising speed against acceleration."""
    length = float(spline.t[-1])
    grid = np.linspace(0.0, length, 513)
    first, second, third = (np.abs(spline(grid, nu=order)) for order in (1, 2, 3))
    first = np.maximum(first, 1e-12)
    fastest = min(
        float((limits.velocity / first).min()),
        float(np.sqrt(limits.acceleration / np.maximum(second, 1e-12)).min()),
    )
    profiles = []
    for fraction in VELOCITY_FRACTIONS:
        velocity = fraction * fastest
        free = 0.1 * limits.acceleration
        acceleration = float((np.maximum(limits.acceleration - second * velocity**2, free) / first).min())
        used = third * velocity**3 + 3 * second * velocity * acceleration
        jerk = float((np.maximum(limits.jerk - used, 0.1 * limits.jerk) / first).min())
        # A change of acceleration within one sample could not be represented by the samples.
        jerk = min(jerk, acceleration / (2 * time_step))
        profiles.append(_one_axis(length, velocity, acceleration, jerk))
    return profiles


def _one_axis(length: float, velocity: float, acceleration: float, jerk: float) -> RuckigTrajectory:
    problem = InputParameter(1)
    problem.current_position, problem.target_position = [0.0], [length]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [velocity], [acceleration], [jerk]
    profile = RuckigTrajectory(1)
    Ruckig(1).calculate(problem, profile)
    return profile


def _timed(
    spline: BSpline,
    profile: RuckigTrajectory,
    limits: JointLimits,
    time_step: float,
    at_least: float,
    before: int | None,
) -> JointTrajectory | None:
    """Sample the spline along the profile, in the fewest time steps that hold the limits; None if not below ``before``."""
    least = max(MINIMUM_STEPS, int(np.ceil(at_least / time_step - 1e-9)))
    count = max(least, int(np.ceil(profile.duration / time_step)))
    trajectory = _sampled(spline, profile, count, time_step, limits)
    if before is not None and count * _least_excess(trajectory, limits, time_step) >= before:
        return None
    count = max(least, int(np.ceil(count * _excess(trajectory, limits))))
    while before is None or count < before:
        trajectory = _sampled(spline, profile, count, time_step, limits)
        excess = _excess(trajectory, limits)
        if excess <= 1.0:
            return trajectory
        count = max(count + 1, int(np.ceil(count * excess)))
    return None


def _sampled(
    spline: BSpline, profile: RuckigTrajectory, count: int, time_step: float, limits: JointLimits
) -> JointTrajectory:
    """``count`` steps along the profile, stretched from its own duration to ``count · time_step``."""
    stretch = count * time_step / profile.duration
    clock = np.linspace(0.0, profile.duration, count + 1)
    x, rate, change = _states(profile, clock)
    x[-1] = spline.t[-1]
    rate[[0, -1]] = change[[0, -1]] = 0.0
    rate, change = rate[:, None] / stretch, change[:, None] / stretch**2
    x = np.clip(x, 0.0, spline.t[-1])
    first, second = spline(x, nu=1), spline(x, nu=2)
    return JointTrajectory(
        np.arange(count + 1, dtype=np.float64) * time_step,
        spline(x),
        first * rate,
        second * rate**2 + first * change,
        limits.joint_names,
    )


def _states(
    profile: RuckigTrajectory, clock: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Position, velocity and acceleration (N,) of a profile of one axis at N times: what its ``at_time`` gives, at once."""
    phases = profile.profiles[0][0]
    begins = np.concatenate(([0.0], np.cumsum(phases.t)))[:-1]
    phase = np.searchsorted(begins, clock, side="right") - 1
    j, a, v, p = (np.asarray(values)[phase] for values in (phases.j, phases.a, phases.v, phases.p))
    t = clock - begins[phase]
    return p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j


def _excess(trajectory: JointTrajectory, limits: JointLimits) -> float:
    """Factor by which the time must be stretched for the limits to hold; ≤ 1 if they do."""
    return _stretch(trajectory.peak_rates(), limits)


def _least_excess(trajectory: JointTrajectory, limits: JointLimits, time_step: float) -> float:
    """What :func:`_excess` is at least, in a fraction of its time: jerk is somewhere as large as its mean over a step."""
    assert trajectory.velocities is not None  # as _sampled makes it
    assert trajectory.accelerations is not None
    jerks = np.diff(trajectory.accelerations, axis=0) / time_step
    rates = (trajectory.velocities, trajectory.accelerations, jerks)
    return _stretch(np.stack([np.abs(rate).max(axis=0) for rate in rates]), limits)


def _stretch(rates: NDArray[np.float64], limits: JointLimits) -> float:
    """Factor by which the time must be stretched for velocity, acceleration and jerk (3, J) to be within the limits."""
    worst = (rates / np.stack((limits.velocity, limits.acceleration, limits.jerk))).max(axis=1)
    return float((worst ** (1.0 / np.arange(1, 4))).max())
