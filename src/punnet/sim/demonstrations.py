"""Simulated demonstrations of reach-to-pick, by the thesis' protocol (section 6.1): how the arm moves.

For each of 25 berry positions the arm reaches 10 times from home. As in the thesis the repeats differ by a
random via-point and by the final orientation; here the elbow varies too, as it does between people's. Every
reach ends with a straight approach along the tool's z axis. What the camera sees of it:
:mod:`punnet.sim.demonstrations_scene`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from punnet.errors import ConfigurationError, ShapeError
from punnet.planning.approach import approach_poses, approach_rotation, comfortable_angles
from punnet.planning.likely_joints import likely_joints
from punnet.planning.promp_depth import APPROACH_DISTANCE, APPROACH_PHASE
from punnet.robot import HOME, Panda

__all__ = [
    "EXPLORING",
    "REACH_LIKE",
    "THESIS_LIKE",
    "WORKSPACE",
    "Demonstrations",
    "ReachStyle",
    "reach_to",
    "simulate_demonstrations",
]

WORKSPACE: NDArray[np.float64] = np.array([[0.70, -0.22, 0.58], [0.80, 0.18, 0.86]])
"""Lower and upper corner (2, 3) of the box that grip points are drawn from, metres in the base frame."""

VIA_PHASE_RANGE = (0.3, 0.42)
LIMIT_MARGIN = 0.12  # radians
SMALLEST_MANIPULABILITY = 0.01
LARGEST_STEP = 0.06  # radians between neighbours on the approach; more is a change of posture on the way
TOOL_SPEED = 0.12  # metres per second on average, which gives a demonstration its duration
APPROACH_STEPS = 16
ATTEMPTS = 100


@dataclass(frozen=True)
class ReachStyle:
    """How much reaches to the same berry differ.

    Parameters
    ----------
    orientation_std
        Yaw, pitch and roll of the tool at the berry, radians.
    pitch_range
        Least and greatest pitch, radians.
    posture_std
        Of the posture that the arm tends to, each joint in radians: how much the elbow differs.
    willingness
        How far each joint leaves that posture for a pose, radians; only ratios count.
    via_position_std, via_orientation_std, via_elbow_std
        Of the point on the way, metres and radians.
    """

    orientation_std: tuple[float, float, float]
    pitch_range: tuple[float, float]
    posture_std: tuple[float, ...]
    willingness: tuple[float, ...]
    via_position_std: float
    via_orientation_std: float
    via_elbow_std: float


EXPLORING = ReachStyle(
    orientation_std=(np.deg2rad(6.0), np.deg2rad(3.5), np.deg2rad(2.5)),
    pitch_range=(np.deg2rad(-15.0), np.deg2rad(10.0)),
    posture_std=(0.06, 0.12, 0.06, 0.15, 0.10, 0.12, 0.15),
    willingness=(0.2, 0.4, 0.2, 0.5, 0.3, 0.4, 0.5),
    via_position_std=0.03,
    via_orientation_std=np.deg2rad(5.0),
    via_elbow_std=0.1,
)
"""Uses the arm's freedom, elbow and all: what a primitive that is conditioned on a pose should have seen."""

REACH_LIKE = ReachStyle(
    orientation_std=(np.deg2rad(1.5), np.deg2rad(3.0), np.deg2rad(3.0)),
    pitch_range=(np.deg2rad(-20.0), np.deg2rad(5.0)),
    posture_std=(0.02,) * 7,
    willingness=(0.1, 0.4, 0.15, 0.5, 0.1, 0.4, 0.5),
    via_position_std=0.03,
    via_orientation_std=np.deg2rad(5.0),
    via_elbow_std=0.05,
)
"""Differs about as the repeats behind the lab's 75 real targets: the tool comes in nearly alike."""

THESIS_LIKE = ReachStyle(
    orientation_std=(np.deg2rad(2.0), np.deg2rad(11.0), np.deg2rad(17.0)),
    pitch_range=(np.deg2rad(-40.0), np.deg2rad(25.0)),
    posture_std=(0.0,) * 7,
    willingness=(0.1, 0.4, 0.1, 0.5, 0.1, 0.4, 1.0),
    via_position_std=0.03,
    via_orientation_std=np.deg2rad(5.0),
    via_elbow_std=0.05,
)
"""Differs about as the repeats behind the thesis' own 25 targets: much in pitch and roll. The mean of ten such reaches
is itself uncertain by some 6°."""


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """n reaches of T instants each.

    Parameters
    ----------
    joints
        (n, T, 7) radians, evenly sampled in phase.
    targets
        (n, 3) grip points in the base frame, metres.
    configuration
        (n,) index of the berry position; repeats share it. Split by it, never across it.
    durations
        (n,) seconds.

    Raises
    ------
    ShapeError
        If the arrays do not fit each other.
    """

    joints: NDArray[np.float64]
    targets: NDArray[np.float64]
    configuration: NDArray[np.int64]
    durations: NDArray[np.float64]

    def __post_init__(self) -> None:
        n = len(self.joints)
        if self.joints.ndim != 3 or self.joints.shape[2] != 7:
            raise ShapeError(f"demonstrations: joints must be (n, T, 7), got {self.joints.shape}")
        for name, shape in (("targets", (n, 3)), ("configuration", (n,)), ("durations", (n,))):
            if getattr(self, name).shape != shape:
                raise ShapeError(f"demonstrations: {name} must be {shape}, got {getattr(self, name).shape}")

    def __len__(self) -> int:
        return len(self.joints)

    def select(self, chosen: ArrayLike) -> Demonstrations:
        """Those at an index array or boolean mask."""
        index = np.asarray(chosen)
        return Demonstrations(
            self.joints[index], self.targets[index], self.configuration[index], self.durations[index]
        )


def simulate_demonstrations(
    rng: np.random.Generator,
    configurations: int = 25,
    repeats: int = 10,
    samples: int = 150,
    *,
    arm: Panda | None = None,
) -> Demonstrations:
    """Demonstrate reaches to random berries, :data:`EXPLORING`.

    Parameters
    ----------
    rng
        Source of all randomness.
    configurations, repeats
        Berry positions, and reaches to each.
    samples
        Instants T of each reach.
    arm
        The arm with its tool; the Panda with our picker if not given.

    Raises
    ------
    ConfigurationError
        If a count is too small, or the arm can't reach a position in any of many attempts.
    """
    if configurations < 1 or repeats < 1 or samples < 2:
        raise ConfigurationError(
            f"demonstrations: configurations and repeats must be ≥ 1 and samples ≥ 2, "
            f"got {configurations}, {repeats}, {samples}"
        )
    arm = Panda() if arm is None else arm
    return reach_to(
        rng,
        rng.uniform(WORKSPACE[0], WORKSPACE[1], size=(configurations, 3)),
        repeats,
        samples,
        style=EXPLORING,
        arm=arm,
    )


def reach_to(
    rng: np.random.Generator,
    points: ArrayLike,
    repeats: int = 10,
    samples: int = 150,
    *,
    style: ReachStyle = REACH_LIKE,
    arm: Panda | None = None,
) -> Demonstrations:
    """Demonstrate reaches to given grip points.

    Parameters
    ----------
    rng
        Source of all randomness.
    points
        (C, 3) metres in the base frame.
    repeats, samples
        Reaches to each, and instants T of each reach.
    style
        How much they differ.
    arm
        The arm with its tool; the Panda with our picker if not given.

    Raises
    ------
    ConfigurationError
        If the arm can't reach a point in any of many attempts.
    """
    arm = Panda() if arm is None else arm
    centres = np.asarray(points, dtype=np.float64)
    if centres.ndim != 2 or centres.shape[1] != 3 or not np.isfinite(centres).all():
        raise ShapeError(f"demonstrations: points must be finite (C, 3), got {centres.shape}")
    targets = np.repeat(centres, repeats, axis=0)
    joints = _reaches(rng, arm, style, targets, np.linspace(0.0, 1.0, samples))
    return Demonstrations(
        joints=joints,
        targets=targets,
        configuration=np.repeat(np.arange(len(centres)), repeats),
        durations=_durations(arm, joints),
    )


def _reaches(
    rng: np.random.Generator,
    arm: Panda,
    style: ReachStyle,
    targets: NDArray[np.float64],
    phase: NDArray[np.float64],
) -> NDArray[np.float64]:
    """One reach (T, 7) to each target (n, 3); those that strain the arm are drawn again."""
    reaches = np.zeros((len(targets), len(phase), 7))
    missing = np.arange(len(targets))
    for _ in range(ATTEMPTS):
        approaches = _approaches(rng, arm, style, targets[missing])
        followed = np.isfinite(approaches).all(axis=(1, 2))
        approaches = approaches[followed]
        drawn = np.array([_join(rng, arm, style, approach, phase) for approach in approaches]).reshape(
            -1, len(phase), 7
        )
        easy = (arm.manipulability(approaches) > SMALLEST_MANIPULABILITY).all(axis=1)
        smooth = (np.abs(np.diff(approaches, axis=1)) < LARGEST_STEP).all(axis=(1, 2))
        good = easy & smooth & arm.within_limits(drawn, LIMIT_MARGIN).all(axis=1)
        done = missing[followed][good]
        reaches[done] = drawn[good]
        missing = np.setdiff1d(missing, done)
        if len(missing) == 0:
            return reaches
    raise ConfigurationError(
        f"demonstrations: no comfortable reach to {np.round(targets[missing[0]], 3)} in {ATTEMPTS} attempts"
    )


def _approaches(
    rng: np.random.Generator, arm: Panda, style: ReachStyle, targets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joints (n, S, 7) along straight approaches of random orientation; NaN where the arm can't follow."""
    yaw, pitch = comfortable_angles(targets)
    noise = rng.normal(0.0, style.orientation_std, (len(targets), 3))
    rotations = approach_rotation(
        yaw + noise[:, 0], np.clip(pitch + noise[:, 1], *style.pitch_range), noise[:, 2]
    )
    poses = approach_poses(targets, rotations, np.linspace(APPROACH_DISTANCE, 0.0, APPROACH_STEPS))
    postures = HOME + rng.normal(0.0, style.posture_std, (len(targets), 7))
    covariance = np.diag(np.square(style.willingness))
    return likely_joints(arm, poses, postures[:, None], covariance)[0]


def _join(
    rng: np.random.Generator,
    arm: Panda,
    style: ReachStyle,
    approach: NDArray[np.float64],
    phase: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Reach (T, 7) from home over a random via-point to the approach, which slows down until it stops."""
    along = CubicSpline(
        np.linspace(0.0, 1.0, len(approach)), approach
    )  # over the share of the distance covered
    length = 1.0 - APPROACH_PHASE
    middle = (HOME + approach[0]) / 2.0
    J = arm.jacobian(middle)
    twist = rng.normal(0.0, np.repeat([style.via_position_std, style.via_orientation_std], 3))
    inverse = np.linalg.pinv(J, rcond=0.05)
    elbow = (np.eye(7) - inverse @ J) @ rng.normal(0.0, style.via_elbow_std, 7)
    via_phase = rng.uniform(*VIA_PHASE_RANGE)
    entry_rate = along(0.0, 1) * 2.0 / length  # share covered is 1 − ((1 − z)/length)²
    free = CubicSpline(
        [0.0, via_phase, APPROACH_PHASE],
        [HOME, middle + inverse @ twist + elbow, approach[0]],
        bc_type=((1, np.zeros(7)), (1, entry_rate)),
    )
    covered = 1.0 - (np.clip(1.0 - phase, 0.0, length) / length) ** 2
    before = (phase < APPROACH_PHASE)[:, None]
    return np.asarray(np.where(before, free(np.minimum(phase, APPROACH_PHASE)), along(covered)))


def _durations(arm: Panda, joints: NDArray[np.float64]) -> NDArray[np.float64]:
    points = arm.forward_kinematics_tool(joints)[..., :3, 3]
    return np.asarray(np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1) / TOOL_SPEED)
