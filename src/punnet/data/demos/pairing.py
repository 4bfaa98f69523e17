"""Boxes that seem to belong to another reach, found from the data alone.

Where the camera looks from one place, the centre of a target's box tells, to a first approximation, where a reach to it
ends: across the view linearly, along it hardly. So the final positions are regressed on the box centres, robustly, and
what lies far off across the view is suspect. If two suspects of one scene fit once their boxes are exchanged, they were
most likely swapped. Berries that hang so close together that a swap moves them by less than the others scatter can't be
told apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.checks import ForwardKinematics
from punnet.data.demos.episode import DemonstrationSet, Episode

__all__ = ["SuspectTarget", "suspect_targets"]

Array = NDArray[np.float64]

FEWEST_TARGETS = 10
LARGEST_DISTANCE = 4.292
"""√ of the 99.99% point of χ² with two degrees of freedom: one sound target in ten thousand lies farther off."""

SMALLEST_SCALE = 0.01
"""Metres that final positions are taken to scatter at least."""

_ABSOLUTE_ROUNDS, _BISQUARE_ROUNDS = 30, 50
_BISQUARE = 4.685  # 95% efficient for Gaussian residuals
_MAD_TO_STD = 1.4826
_SAME_PLACE = 0.01  # metres and elements of the rotation


@dataclass(frozen=True)
class SuspectTarget:
    """A target whose box does not say where its reach ends.

    Parameters
    ----------
    target_id
        The target.
    group
        Its scene.
    residual
        Metres across the view between where the reach ends and where the box says.
    distance
        The same in standard deviations of the sound ones.
    swapped_with
        The target whose box it seems to have; None if no exchange mends it.
    """

    target_id: str
    group: str | None
    residual: float
    distance: float
    swapped_with: str | None = None


@dataclass(frozen=True, eq=False)
class _Fit:
    """Robust regression of ends (N, 3) on box centres (N, 2)."""

    predicted: Array  # (N, 3)
    across: Array  # (2, 3) rows: unit vectors across the view
    scale: Array  # (2,)

    def distance(self, ends: Array, predicted: Array) -> Array:
        return np.asarray(np.linalg.norm((ends - predicted) @ self.across.T / self.scale, axis=-1))


def suspect_targets(
    demonstrations: DemonstrationSet, forward_kinematics: ForwardKinematics | None = None
) -> list[SuspectTarget]:
    """Targets whose box and reach do not seem to belong together, the farthest off first.

    Parameters
    ----------
    demonstrations
        At least ten targets with boxes, photographed from one place; with fewer nothing is said.
    forward_kinematics
        Where the reach ends if only joints were recorded.
    """
    names, groups, centres, ends = _gathered(demonstrations, forward_kinematics)
    if len(names) < FEWEST_TARGETS or not _one_viewpoint(demonstrations):
        return []
    fit = _robust_fit(centres, ends)
    if fit is None:
        return []
    distance = fit.distance(ends, fit.predicted)
    residual = np.linalg.norm((ends - fit.predicted) @ fit.across.T, axis=1)
    suspects = [int(index) for index in np.argsort(-distance) if distance[index] > LARGEST_DISTANCE]
    partner = _partners(suspects, groups, ends, fit)
    return [
        SuspectTarget(
            names[index],
            groups[index],
            float(residual[index]),
            float(distance[index]),
            names[partner[index]] if index in partner else None,
        )
        for index in suspects
    ]


def _gathered(
    demonstrations: DemonstrationSet, forward_kinematics: ForwardKinematics | None
) -> tuple[list[str], list[str | None], Array, Array]:
    """Names, groups, box centres (N, 2) as shares of the picture, and final positions (N, 3), medians over repeats."""
    names: list[str] = []
    groups: list[str | None] = []
    centres, ends = [], []
    for name, indices in demonstrations.targets.items():
        found = [
            (centre, end)
            for episode in (demonstrations[index] for index in indices)
            if (centre := _centre(episode)) is not None
            and (end := _end(episode, forward_kinematics)) is not None
        ]
        if found:
            names.append(name)
            groups.append(demonstrations[indices[0]].group)
            centres.append(np.median([centre for centre, _ in found], axis=0))
            ends.append(np.median([end for _, end in found], axis=0))
    return names, groups, np.asarray(centres).reshape(-1, 2), np.asarray(ends).reshape(-1, 3)


def _centre(episode: Episode) -> Array | None:
    if episode.target is None:
        return None
    box = episode.target.box
    size = episode.home.size if episode.home is not None else None
    shape = np.array([1.0, 1.0]) if size is None else np.array([size[1], size[0]], dtype=np.float64)
    return np.asarray((box[:2] + box[2:]) / 2.0 / shape)


def _end(episode: Episode, forward_kinematics: ForwardKinematics | None) -> Array | None:
    if episode.poses is not None:
        return episode.poses.end[:3]
    if forward_kinematics is None or episode.joints is None:
        return None
    return np.asarray(forward_kinematics(np.asarray(episode.joints.end))[:3, 3])


def _one_viewpoint(demonstrations: DemonstrationSet) -> bool:
    """Whether the known poses of the camera are all the same; unknown ones are taken to be."""
    known = [
        episode.home.T_base_camera
        for episode in demonstrations
        if episode.home is not None and episode.home.T_base_camera is not None
    ]
    return not known or float(np.ptp(np.stack(known), axis=0).max()) < _SAME_PLACE


def _robust_fit(centres: Array, ends: Array) -> _Fit | None:
    """Least absolute residuals first, which outliers hardly move, then Tukey's bisquare, which forgets them."""
    spread = centres.std(axis=0)
    if (spread < 1e-9).any():
        return None
    standard = (centres - centres.mean(axis=0)) / spread
    X = np.column_stack((np.ones(len(centres)), standard))
    weights = np.ones_like(ends)
    for _ in range(_ABSOLUTE_ROUNDS):
        coefficients = _weighted(X, ends, weights)
        weights = 1.0 / np.maximum(np.abs(ends - X @ coefficients), 1e-4)
    for _ in range(_BISQUARE_ROUNDS):
        residual = ends - X @ coefficients
        scale = _scale(residual)
        weights = np.square(np.clip(1.0 - np.square(residual / (_BISQUARE * scale)), 0.0, 1.0)) + 1e-12
        coefficients = _weighted(X, ends, weights)
    predicted = X @ coefficients
    across = np.linalg.svd(coefficients[1:])[2][:2]
    return _Fit(predicted, across, _scale((ends - predicted) @ across.T))


def _weighted(X: Array, Y: Array, weights: Array) -> Array:
    columns = [
        np.linalg.lstsq(X * root[:, None], y * root, rcond=None)[0]
        for y, root in zip(Y.T, np.sqrt(weights).T, strict=True)
    ]
    return np.stack(columns, axis=1)


def _scale(residual: Array) -> Array:
    median = np.median(residual, axis=0)
    return np.maximum(_MAD_TO_STD * np.median(np.abs(residual - median), axis=0), SMALLEST_SCALE)


def _partners(suspects: list[int], groups: list[str | None], ends: Array, fit: _Fit) -> dict[int, int]:
    """Of the suspects of a scene, those that fit when their boxes are exchanged; the best exchange first."""
    found = []
    for i, j in combinations(suspects, 2):
        if groups[i] != groups[j]:
            continue
        swapped = fit.distance(ends[[i, j]], fit.predicted[[j, i]])
        if swapped.max() <= LARGEST_DISTANCE:
            found.append((float(swapped.sum()), i, j))
    partner: dict[int, int] = {}
    for _, i, j in sorted(found):
        if i not in partner and j not in partner:
            partner[i], partner[j] = j, i
    return partner
