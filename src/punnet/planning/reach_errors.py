"""How far predicted movements are from demonstrated ones: the measures of section 6.2 of the thesis, and calibration.

* Eq. 5.13 of each degree of freedom: the mean over instants of the squared difference of the means, and the mean over pairs
  of instants of the squared difference of the covariances of one degree.
* Eq. 6.2 at the final point, of the mean and of the mean ± 2σ; the truth is the end of the target's demonstrated mean.
  Joint space goes through the arm's kinematics. Quaternions are scaled to unit length first.
* Coverage: the share of single demonstrations that end inside the predicted 50% and 90% regions of the final position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from punnet.errors import ShapeError
from punnet.geometry import make_transform, quaternion_from_rotation, rotation_from_quaternion
from punnet.movement import GaussianBasis
from punnet.movement.distribution import Space
from punnet.planning.reaches import DEGREES, Movements, Reaches
from punnet.robot import JOINT_NAMES, Arm, Panda

__all__ = ["COORDINATES", "SHARES", "ReachErrors", "join_errors", "reach_errors"]

Array = NDArray[np.float64]
SHARES = (0.5, 0.9)
"""Of which coverage is told."""
COORDINATES: dict[Space, tuple[str, ...]] = {
    "joint": JOINT_NAMES,
    "task": ("x", "y", "z", "q1", "q2", "q3", "q4"),
}
AXES = ("x", "y", "z")
INSTANTS = 150
SMALLEST = 1e-12
CERTAIN = 1e-3  # metres


@dataclass(frozen=True, eq=False)
class ReachErrors:
    """Errors of P predictions.

    Parameters
    ----------
    means, covariances
        (P, 7) the two terms of Eq. 5.13, of each degree of freedom.
    off
        (P, 3) metres, predicted minus true final position of the flange.
    orientation
        (P,) Eq. 6.2.
    wide_position, wide_orientation
        (P,) the same at ±2σ, the mean of both.
    tip
        (P,) metres from the predicted tool to the grip point; NaN where that is not known.
    distance
        (P,) squared Mahalanobis distance of the demonstration's final position.
    scores
        (P, 3) the same by axis, in standard deviations.
    sigma
        (P, 3) predicted standard deviation of the final position, metres.
    suspects
        (P,) whether the source says that box and reach may not belong together.
    """

    means: Array
    covariances: Array
    off: Array
    orientation: Array
    wide_position: Array
    wide_orientation: Array
    tip: Array
    distance: Array
    scores: Array
    sigma: Array
    suspects: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.off)

    @property
    def position(self) -> Array:
        """(P,) metres, Eq. 6.2."""
        return np.asarray(np.linalg.norm(self.off, axis=1))

    @property
    def across(self) -> Array:
        """(P,) metres across the picture: along y and z together; x leads away from the camera."""
        return np.asarray(np.linalg.norm(self.off[:, 1:], axis=1))

    @property
    def exact(self) -> bool:
        """Whether the predicted end is a point, as it is where depth gave it: there is no region then to hold anything."""
        return bool(np.median(self.sigma) < CERTAIN)

    def _coverage(self) -> dict[str, float]:
        return {f"{share:g}": _mean(self.distance < chi2.ppf(share, 3)) for share in SHARES}

    def _coverage_by_axis(self) -> dict[str, dict[str, float]]:
        inside = {share: np.abs(self.scores) < norm.ppf((1 + share) / 2) for share in SHARES}
        return {
            f"{share:g}": {axis: _mean(held[:, row]) for row, axis in enumerate(AXES)}
            for share, held in inside.items()
        }

    def summary(self) -> dict[str, Any]:
        """Means, as plain JSON."""
        sure = ~self.suspects
        known = np.isfinite(self.tip)
        return {
            "reaches": len(self),
            "suspect": int(self.suspects.sum()),
            "position_m": _mean(self.position),
            "position_not_suspect_m": _mean(self.position[sure]),
            "position_median_m": float(np.median(self.position)),
            "along_x_m": _mean(np.abs(self.off[:, 0])),
            "along_x_not_suspect_m": _mean(np.abs(self.off[sure, 0])),
            "across_m": _mean(self.across),
            "across_not_suspect_m": _mean(self.across[sure]),
            "orientation": _mean(self.orientation),
            "orientation_not_suspect": _mean(self.orientation[sure]),
            "position_2_sigma_m": _mean(self.wide_position),
            "orientation_2_sigma": _mean(self.wide_orientation),
            "tool_from_grip_point_m": _mean(self.tip[known]) if known.any() else None,
            "coverage": None if self.exact else self._coverage(),
            "coverage_by_axis": None if self.exact else self._coverage_by_axis(),
            "eq_5_13": (self.means + self.covariances).mean(axis=0).tolist(),
            "eq_5_13_means_only": self.means.mean(axis=0).tolist(),
        }


def reach_errors(found: Movements, reaches: Reaches, space: Space, arm: Arm | None = None) -> ReachErrors:
    """Errors of what was predicted of each photograph of ``reaches``.

    Parameters
    ----------
    found
        (P) movements in ``space``.
    reaches
        What was demonstrated.
    space
        Of ``found``.
    arm
        For joint space, and for the tool's place.

    Raises
    ------
    ShapeError
        If there are not as many predictions as photographs.
    """
    if len(found) != len(reaches):
        raise ShapeError(f"reach errors: {len(found)} predictions of {len(reaches)} photographs")
    arm = arm or Panda()
    true, basis = reaches.movements(space)[reaches.targets], reaches.basis
    means, covariances = _eq_5_13(found, true, basis)
    last = basis.phi([1.0])
    ends = found.mean @ last[0]
    H = np.kron(np.eye(DEGREES), last)
    spread = H @ found.covariance @ H.T
    sigma = np.sqrt(np.maximum(np.einsum("pdd->pd", spread), 0.0))
    truth = (reaches.pose.mean @ last[0])[reaches.targets]
    position, orientation = _place(ends, space, arm)
    off = position - truth[:, :3]
    wide = [_place(ends + sign * 2.0 * sigma, space, arm) for sign in (-1.0, 1.0)]
    region = spread[:, :3, :3] if space == "task" else _through_arm(ends, spread, arm)
    demonstrated = position - reaches.ends[:, :3]
    deviation = np.sqrt(np.einsum("pkk->pk", region) + SMALLEST)
    return ReachErrors(
        means=means,
        covariances=covariances,
        off=off,
        orientation=_apart(orientation, truth[:, 3:]),
        wide_position=np.mean([np.linalg.norm(p - truth[:, :3], axis=1) for p, _ in wide], axis=0),
        wide_orientation=np.mean([_apart(q, truth[:, 3:]) for _, q in wide], axis=0),
        tip=_tip(position, orientation, reaches, arm),
        distance=np.einsum(
            "pk,pkl,pl->p", demonstrated, np.linalg.inv(region + SMALLEST * np.eye(3)), demonstrated
        ),
        scores=demonstrated / deviation,
        sigma=deviation,
        suspects=reaches.suspects[reaches.targets],
    )


def join_errors(parts: Sequence[ReachErrors]) -> ReachErrors:
    """Errors of several folds as one."""
    return ReachErrors(
        **{
            item.name: np.concatenate([getattr(part, item.name) for part in parts])
            for item in fields(ReachErrors)
        }
    )


def _eq_5_13(found: Movements, true: Movements, basis: GaussianBasis) -> tuple[Array, Array]:
    """Both terms (P, 7); ‖ΦΔΦᵀ‖²_F = tr(GΔGΔ) with G = ΦᵀΦ."""
    phi = basis.phi(np.linspace(0.0, 1.0, INSTANTS))
    gram = phi.T @ phi
    off = found.mean - true.mean
    means = np.einsum("pdb,bc,pdc->pd", off, gram, off) / INSTANTS
    weighted = gram @ (found.blocks - true.blocks)
    return means, np.einsum("pdbc,pdcb->pd", weighted, weighted) / INSTANTS**2


def _place(ends: Array, space: Space, arm: Arm) -> tuple[Array, Array]:
    """Flange's position (P, 3) and unit quaternion (P, 4) at ends (P, 7)."""
    if space == "task":
        lengths = np.maximum(np.linalg.norm(ends[:, 3:], axis=1, keepdims=True), SMALLEST)
        return ends[:, :3], ends[:, 3:] / lengths
    poses = arm.forward_kinematics(ends)
    return poses[:, :3, 3], quaternion_from_rotation(poses[:, :3, :3])


def _apart(found: Array, true: Array) -> Array:
    """(P,) Eq. 6.2 of quaternions (P, 4)."""
    unit = true / np.linalg.norm(true, axis=1, keepdims=True)
    return np.asarray(np.minimum(np.linalg.norm(unit - found, axis=1), np.linalg.norm(unit + found, axis=1)))


def _through_arm(joints: Array, spread: Array, arm: Arm) -> Array:
    """Covariance (P, 3, 3) of the flange's position, of joints (P, 7) with covariance (P, 7, 7)."""
    jacobian = arm.jacobian(joints)[:, :3]
    return np.asarray(jacobian @ spread @ jacobian.transpose(0, 2, 1))


def _tip(position: Array, orientation: Array, reaches: Reaches, arm: Arm) -> Array:
    tool = make_transform(rotation_from_quaternion(orientation), position) @ arm.T_flange_tool
    return np.asarray(np.linalg.norm(tool[:, :3, 3] - reaches.points[reaches.targets], axis=1))


def _mean(values: NDArray[Any]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
