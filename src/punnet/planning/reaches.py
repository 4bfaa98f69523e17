"""Reaches to learn from and to be judged on: photographs, targets, and how the arm moved to each.

Movements are weights of one movement primitive in two spaces of seven degrees of freedom each: joints, and the flange's
pose as x, y, z and a quaternion (scalar last, all of one hemisphere), as the thesis predicts them (section 6.2.2).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import DemonstrationSet, Episode, target_picture
from punnet.errors import ConfigurationError, ShapeError
from punnet.movement import GaussianBasis, TrajectoryDistribution, from_quaternion_weights
from punnet.movement.distribution import Space
from punnet.planning.berry_light import UNKNOWN, berry_light
from punnet.planning.orientation_mending import mended
from punnet.planning.reach_fitting import aligned, fit_repeats, reference_quaternion

__all__ = ["DEGREES", "SIDE", "Movements", "Reaches", "Space", "as_distribution", "reaches_from"]

DEGREES = 7
SIDE = 128
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Movements:
    """N Gaussians over the weights of seven degrees of freedom.

    Parameters
    ----------
    mean
        (N, 7, B): radians, or metres and quaternion.
    covariance
        (N, 7·B, 7·B), stacked degree by degree.

    Raises
    ------
    ShapeError
        If the shapes disagree or a number is not finite.
    """

    mean: Array
    covariance: Array

    def __post_init__(self) -> None:
        mean, covariance = np.asarray(self.mean, float), np.asarray(self.covariance, float)
        if mean.ndim != 3 or mean.shape[1] != DEGREES:
            raise ShapeError(f"movements: mean must be (N, {DEGREES}, B), got {mean.shape}")
        size = mean.shape[1] * mean.shape[2]
        if covariance.shape != (len(mean), size, size):
            raise ShapeError(
                f"movements: covariance must be {(len(mean), size, size)}, got {covariance.shape}"
            )
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            raise ShapeError("movements: weights must be finite")
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", covariance)

    def __len__(self) -> int:
        return len(self.mean)

    def __getitem__(self, rows: NDArray[np.int64]) -> Movements:
        return Movements(self.mean[rows], self.covariance[rows])

    @property
    def blocks(self) -> Array:
        """(N, 7, B, B): each degree's own covariance, which is all that the thesis keeps."""
        N, D, B = self.mean.shape
        return np.asarray(np.einsum("ndbdc->ndbc", self.covariance.reshape(N, D, B, D, B)))


@dataclass(frozen=True, eq=False)
class Reaches:
    """P photographs from home, each with a marked target, and the M targets' reaches.

    Parameters
    ----------
    pictures
        (P, 128, 128, 3) uint8, the target's box filled white.
    boxes
        (P, 4) xyxy, divided by the photograph's width and height.
    targets
        (P,) row of the target of each photograph.
    ends
        (P, 7) where the reach of that photograph ended: the flange's position and quaternion. Where only the
        distribution over repeats is known, its mean's.
    target_ids, groups
        (M) names, and the plant or scene of each target.
    joint, pose
        (M) movements in joint and in task space.
    points
        (M, 3) grip point in the base frame, NaN unknown.
    suspects
        (M,) whether the source itself says that box and reach may not belong together.
    lights
        (P,) how brightly each berry is lit (:func:`~punnet.planning.berry_light.berry_light`), NaN unknown; all
        unknown if not given.
    basis
        Of the weights.
    duration
        Seconds that a reach takes.
    name
        Of the set.

    Raises
    ------
    ShapeError
        If shapes disagree; the message names the field.
    """

    pictures: NDArray[np.uint8]
    boxes: Array
    targets: NDArray[np.int64]
    ends: Array
    target_ids: tuple[str, ...]
    groups: tuple[str, ...]
    joint: Movements
    pose: Movements
    points: Array
    suspects: NDArray[np.bool_]
    lights: Array = field(default_factory=lambda: np.zeros(0))
    basis: GaussianBasis = field(default_factory=GaussianBasis)
    duration: float = 1.0
    name: str = "reaches"

    def __post_init__(self) -> None:
        P, M = len(self.pictures), len(self.target_ids)
        if P and not len(self.lights):
            object.__setattr__(self, "lights", np.full(P, UNKNOWN))
        shapes = {
            "pictures": (self.pictures.shape, (P, SIDE, SIDE, 3)),
            "boxes": (self.boxes.shape, (P, 4)),
            "targets": (self.targets.shape, (P,)),
            "ends": (self.ends.shape, (P, DEGREES)),
            "lights": (self.lights.shape, (P,)),
            "groups": ((len(self.groups),), (M,)),
            "joint": (self.joint.mean.shape, (M, DEGREES, self.basis.count)),
            "pose": (self.pose.mean.shape, (M, DEGREES, self.basis.count)),
            "points": (self.points.shape, (M, 3)),
            "suspects": (self.suspects.shape, (M,)),
        }
        for name, (found, wanted) in shapes.items():
            if found != wanted:
                raise ShapeError(f"{self.name}: {name} must be {wanted}, got {found}")
        if P and not (self.targets.min() >= 0 and self.targets.max() < M):
            raise ShapeError(f"{self.name}: targets must name one of {M} rows")

    def __len__(self) -> int:
        return len(self.pictures)

    @property
    def centres(self) -> Array:
        """(P, 2) centres of the boxes, 0 … 1: the condition c of Eq. 5.16."""
        return np.asarray((self.boxes[:, :2] + self.boxes[:, 2:]) / 2.0)

    @property
    def picture_groups(self) -> tuple[str, ...]:
        """(P) plant or scene of each photograph."""
        return tuple(self.groups[target] for target in self.targets)

    def movements(self, space: Space) -> Movements:
        """(M) movements in that space."""
        return self.joint if space == "joint" else self.pose

    def of_groups(self, groups: Iterable[str]) -> Reaches:
        """The targets of these plants or scenes, with their photographs."""
        wanted = set(groups)
        return self.subset([row for row, group in enumerate(self.groups) if group in wanted])

    def subset(self, rows: Iterable[int]) -> Reaches:
        """The targets at ``rows``, with their photographs."""
        kept = np.asarray(list(rows), dtype=np.int64)
        new = np.full(len(self.target_ids), -1)
        new[kept] = np.arange(len(kept))
        seen = new[self.targets] >= 0
        return replace(
            self,
            pictures=self.pictures[seen],
            boxes=self.boxes[seen],
            targets=new[self.targets[seen]],
            ends=self.ends[seen],
            target_ids=tuple(self.target_ids[row] for row in kept),
            groups=tuple(self.groups[row] for row in kept),
            joint=self.joint[kept],
            pose=self.pose[kept],
            points=self.points[kept],
            suspects=self.suspects[kept],
            lights=self.lights[seen],
        )


def as_distribution(
    basis: GaussianBasis, mean: Array, covariance: Array, space: Space, duration: float = 1.0
) -> TrajectoryDistribution:
    """Weights (7, B), (7·B, 7·B) of one movement as a distribution; poses on the sphere, in a chart of their own.

    Raises
    ------
    ShapeError
        If a predicted quaternion comes so near zero that it has no direction.
    """
    if space == "task":
        return from_quaternion_weights(basis, mean, covariance, duration=duration)
    return TrajectoryDistribution(basis, mean, covariance, duration=duration)


def reaches_from(demonstrations: DemonstrationSet, basis: GaussianBasis | None = None) -> Reaches:
    """Photographs and movements of demonstrations: repeats of a target are fitted together (Eq. 5.1 to 5.7).

    Where the source kept weights in place of trajectories, they are taken to ``basis``, orientations that its averaging
    spoilt from the joints (:mod:`punnet.planning.orientation_mending`).

    Parameters
    ----------
    demonstrations
        With a home photograph, the target's box, joints and poses in every episode.
    basis
        Eight well-conditioned functions if not given.

    Raises
    ------
    ConfigurationError
        If an episode lacks one of them, or the arm has no seven joints; the message names it.
    """
    basis = basis or GaussianBasis()
    for episode in demonstrations:
        _require_whole(demonstrations.name, episode)
    if not len(demonstrations):
        raise ConfigurationError(f"{demonstrations.name}: no demonstrations in it")
    episodes = [mended(episode) for episode in demonstrations]
    rows = list(demonstrations.targets.items())
    reference = reference_quaternion(episodes)
    fitted = [fit_repeats([episodes[i] for i in indices], basis, reference) for _, indices in rows]
    order = [(index, row) for row, (_, indices) in enumerate(rows) for index in indices]
    pictures, boxes, lights, ends = zip(
        *(_picture(episodes[index], reference) for index, _ in order), strict=True
    )
    firsts = [episodes[indices[0]] for _, indices in rows]
    durations = [e.movement.duration for e in episodes if e.movement.clock == "seconds"]
    return Reaches(
        pictures=np.array(pictures, dtype=np.uint8),
        boxes=np.array(boxes),
        targets=np.array([row for _, row in order], dtype=np.int64),
        ends=np.array(ends),
        target_ids=tuple(name for name, _ in rows),
        groups=tuple(e.target_id if e.group is None else e.group for e in firsts),
        joint=Movements(np.array([f[0] for f in fitted]), np.array([f[1] for f in fitted])),
        pose=Movements(np.array([f[2] for f in fitted]), np.array([f[3] for f in fitted])),
        points=np.array([_point(e) for e in firsts]),
        lights=np.array(lights),
        suspects=np.array([bool(e.extra.get("suspect_pairing", False)) for e in firsts]),
        basis=basis,
        duration=float(np.mean(durations)) if durations else 1.0,
        name=demonstrations.name,
    )


def _require_whole(name: str, episode: Episode) -> None:
    missing = [
        what
        for what, found in (
            ("photograph", episode.home),
            ("target box", episode.target),
            ("joints", episode.joints),
            ("poses", episode.poses),
        )
        if found is None
    ]
    if missing:
        raise ConfigurationError(
            f"{name}: episode '{episode.id}' has no {', no '.join(missing)}; a planner learns from episodes with all four"
        )
    assert episode.joints is not None
    if episode.joints.values.shape[1] != DEGREES:
        raise ConfigurationError(
            f"{name}: episode '{episode.id}' is of an arm with {episode.joints.values.shape[1]} joints; "
            f"the planner's networks are for {DEGREES}"
        )


def _picture(episode: Episode, reference: Array) -> tuple[NDArray[np.uint8], Array, float, Array]:
    """What the network sees, the box, how the berry is lit, and where the reach ended."""
    assert episode.home is not None
    assert episode.target is not None
    assert episode.poses is not None
    rgb = episode.home.rgb()
    height, width = rgb.shape[:2]
    box = episode.target.box / np.array([width, height, width, height])
    end = aligned(episode.poses.end[None], reference)[0]
    return target_picture(rgb, episode.target.box, SIDE), box, berry_light(rgb, episode.target.box), end


def _point(episode: Episode) -> Array:
    point = None if episode.target is None else episode.target.picking_point
    return np.full(3, np.nan) if point is None else np.asarray(point)
