"""Reaches drawn from a planned distribution, each bent to start at the arm and to come in straight at the picking point.

A draw keeps its own approach: its direction is turned a little from the planned one, joints are found along the straight
line in, and the draw is conditioned on them and on the start. For a Gaussian that is exact and one matrix serves all
draws (Matheron's rule): ``w ← w + Σ Aᵀ (A Σ Aᵀ)⁻¹ (y − A w)``, where ``A w`` are the joints at the via-points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import invert_transform
from punnet.movement import TrajectoryDistribution, ViaPoint
from punnet.planning.approach import approach_poses, approach_rotation
from punnet.planning.promp_depth import APPROACH_DISTANCE, APPROACH_PHASE
from punnet.robot import Arm
from punnet.robot.projection import projected

__all__ = ["Candidates", "draw_candidates", "spread_offsets"]

VIA_PHASES = np.array([0.7, 0.8, 0.9, 1.0])
LARGEST_DEVIATION = 0.004
CHECKED_DISTANCE = 0.07
SMALLEST_MARGIN = 0.02
_REGULARISATION = 1e-10
_CHECKED = np.linspace(APPROACH_PHASE, 1.0, 9)


@dataclass(frozen=True, eq=False)
class Candidates:
    """K reaches.

    Parameters
    ----------
    prior
        What they are conditioned draws of.
    weights
        (K, J, B).
    joints
        (K, 4, J) at the via-points of the straight line in; NaN where the arm can't be on it.
    rotations
        (K, 3, 3) of the tool on that line.
    possible
        (K,) whether a reach keeps to its line and within the joint limits.
    """

    prior: TrajectoryDistribution
    weights: NDArray[np.float64]
    joints: NDArray[np.float64]
    rotations: NDArray[np.float64]
    possible: NDArray[np.bool_]

    def trajectories(self, phases: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joints (K, T, J) at phases (T,)."""
        phi = self.prior.basis.derivative(phases, 0)
        return np.asarray(np.swapaxes(self.weights @ phi.T, 1, 2))

    def distribution(self, index: int, start: NDArray[np.float64]) -> TrajectoryDistribution:
        """What is left of the prior on the line of candidate ``index``, the candidate being its mean."""
        via_points = [ViaPoint(p, q) for p, q in zip(VIA_PHASES, self.joints[index], strict=True)]
        conditioned = self.prior.condition([ViaPoint(0.0, start), *via_points])
        return replace(conditioned, weight_mean=self.weights[index])


def spread_offsets(count: int, half_widths: NDArray[np.float64]) -> NDArray[np.float64]:
    """``count`` offsets (K, D) that fill the box ±``half_widths`` (D,) evenly; the first is none.

    A Kronecker sequence with the generalised golden ratio, the root of x^(D + 1) = x + 1.
    """
    dimensions = len(half_widths)
    golden = 1.5
    for _ in range(60):
        golden = (1.0 + golden) ** (1.0 / (dimensions + 1))
    steps = np.arange(count)[:, None] * golden ** -np.arange(1.0, dimensions + 1.0)
    unit = 2.0 * np.mod(steps + 0.5, 1.0) - 1.0
    unit[0] = 0.0
    return np.asarray(unit * half_widths)


def draw_candidates(
    rng: np.random.Generator,
    arm: Arm,
    planned: TrajectoryDistribution,
    start: NDArray[np.float64],
    point: NDArray[np.float64],
    turns: NDArray[np.float64],
    broadening: float,
) -> Candidates:
    """Draw a reach for each turn of the approach.

    Parameters
    ----------
    planned
        Distribution over the arm's joints.
    start, point
        Joints (J,) that the arm is at, and the picking point (3,).
    turns
        (K, 3) yaw, pitch and roll of each approach: radians, as :func:`~punnet.planning.approach.approach_rotation`
        takes them. The first is drawn without chance.
    broadening
        Radians of standard deviation added to every weight, so that approaches that the planner did not plan are
        possible.
    """
    prior = planned.broadened(broadening)
    rotations = approach_rotation(*turns.T)
    joints = _joints_on_line(arm, planned.mean([1.0])[0], point, rotations)
    wanted = np.concatenate(
        (np.broadcast_to(start, (len(turns), 1, arm.joint_count)), np.nan_to_num(joints)), axis=1
    )
    weights = _conditioned(prior, _drawn(rng, planned, len(turns)), wanted)
    reached = np.asarray(np.isfinite(joints).all(axis=(1, 2)))
    candidates = Candidates(prior, weights, joints, rotations, reached)
    return Candidates(
        prior, weights, joints, rotations, candidates.possible & _keeps_to_line(arm, candidates, point)
    )


def _joints_on_line(
    arm: Arm, near: NDArray[np.float64], point: NDArray[np.float64], rotations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joints (K, 4, J) at :data:`VIA_PHASES`: the end's the nearest to joints ``near`` (J,), the others' to those."""
    share_left = (1.0 - VIA_PHASES) / (1.0 - APPROACH_PHASE)
    poses = approach_poses(point, rotations, APPROACH_DISTANCE * share_left**2)
    poses = poses @ invert_transform(arm.T_flange_tool)
    count = len(rotations)
    ends = projected(arm, np.tile(near, (count, 1)), poses[:, -1])
    reached = np.isfinite(ends).all(axis=1)
    joints = np.full((count, len(VIA_PHASES), arm.joint_count), np.nan)
    flat = np.repeat(ends[reached], len(VIA_PHASES), axis=0)
    joints[reached] = projected(arm, flat, poses[reached].reshape(-1, 4, 4)).reshape(
        -1, len(VIA_PHASES), arm.joint_count
    )
    return joints


def _drawn(rng: np.random.Generator, planned: TrajectoryDistribution, count: int) -> NDArray[np.float64]:
    """Weights (K, J·B) of draws; the first is the mean, and every second one keeps to the mean's course."""
    eigenvalues, vectors = np.linalg.eigh(planned.weight_covariance)
    noise = rng.standard_normal((count, len(eigenvalues)))
    noise[::2] = 0.0
    spread = (noise * np.sqrt(np.maximum(eigenvalues, 0.0))) @ vectors.T
    return np.asarray(planned.weight_mean.ravel() + spread)


def _conditioned(
    prior: TrajectoryDistribution, weights: NDArray[np.float64], wanted: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights (K, J, B) of draws (K, J·B) that pass the joints ``wanted`` (K, 5, J) at phase 0 and on the line in."""
    phi = prior.basis.derivative(np.concatenate(([0.0], VIA_PHASES)), 0)
    A = np.einsum("pb,de->pdeb", phi, np.eye(prior.dimensions)).reshape(-1, prior.weight_covariance.shape[0])
    cross = prior.weight_covariance @ A.T
    gain = np.linalg.solve(A @ cross + _REGULARISATION * np.eye(len(A)), cross.T)
    missed = wanted.reshape(len(wanted), -1) - weights @ A.T
    return np.asarray((weights + missed @ gain).reshape(len(weights), prior.dimensions, -1))


def _keeps_to_line(arm: Arm, candidates: Candidates, point: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the tool of each (K,) is near its line over the last stretch, does not overshoot, and no joint at a limit."""
    tool = arm.forward_kinematics_tool(candidates.trajectories(_CHECKED))[..., :3, 3] - point
    forward = candidates.rotations[:, None, :, 2]
    along = (tool * forward).sum(axis=-1)
    aside = np.linalg.norm(tool - along[..., None] * forward, axis=-1)
    off = np.where(along >= -CHECKED_DISTANCE, aside, 0.0).max(axis=1)
    within = arm.within_limits(candidates.trajectories(np.linspace(0.0, 1.0, 31)), SMALLEST_MARGIN).all(
        axis=1
    )
    return np.asarray((np.maximum(off, along.max(axis=1)) <= LARGEST_DEVIATION) & within)
