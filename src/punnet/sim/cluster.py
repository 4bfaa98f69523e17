"""A cluster, laid out: which berries hang where. Pure geometry; ``plant.py`` writes it into the world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.geometry import make_transform, rotation_from_vector
from punnet.sim.berry import Berry, make_berry
from punnet.sim.ripeness import RipenessStage
from punnet.sim.truss import Truss, TrussStyle, grow_truss

__all__ = ["STUB_LENGTH", "Cluster", "ClusterConfig", "HangingBerry", "HangingTruss", "grow_cluster"]

STUB_LENGTH = 0.036
"""Metres of stem above the calyx that move as one with the berry; the cut goes through it."""

_ATTEMPTS = 60


def _stage_shares() -> dict[RipenessStage, float]:
    return {
        RipenessStage.GREEN: 0.22,
        RipenessStage.WHITE: 0.12,
        RipenessStage.TURNING: 0.14,
        RipenessStage.RIPE: 0.46,
        RipenessStage.OVERRIPE: 0.06,
    }


@dataclass(frozen=True)
class ClusterConfig:
    """What kind of plant to grow.

    Parameters
    ----------
    trusses
        Least and most trusses.
    berries
        Least and most berries a truss.
    stage_shares
        Probability of each ripeness stage; need not add up to one.
    clearance
        Least distance between two berries' centres over the sum of their radii; below 1 they may touch.
    across
        Range of y (metres, base frame) in which trusses leave the gutter.
    front
        Range of x of the gutter's lip where they leave it.
    lip_height
        Range of z where they leave it.
    canopy_leaves, hanging_leaves
        Leaves above the gutter, and leaves that hang among the trusses: (least, most).
    veils
        Leaves that hang close before berries, ripe ones first, and hide a part of them: (least, most).
    style
        How trusses grow.
    tilt
        Spread (radians) of how far a berry hangs out of the vertical.
    """

    trusses: tuple[int, int] = (3, 3)
    berries: tuple[int, int] = (2, 4)
    stage_shares: dict[RipenessStage, float] = field(default_factory=_stage_shares)
    clearance: float = 1.25
    across: tuple[float, float] = (-0.24, 0.06)
    front: tuple[float, float] = (0.785, 0.80)
    lip_height: tuple[float, float] = (0.90, 0.915)
    canopy_leaves: tuple[int, int] = (26, 34)
    hanging_leaves: tuple[int, int] = (2, 4)
    veils: tuple[int, int] = (0, 0)
    style: TrussStyle = field(default_factory=TrussStyle)
    tilt: float = 0.09

    def __post_init__(self) -> None:
        for name in ("trusses", "berries", "canopy_leaves", "hanging_leaves", "veils"):
            low, high = getattr(self, name)
            if not 0 <= low <= high:
                raise ConfigurationError(f"cluster: {name} must be 0 ≤ least ≤ most, got ({low}, {high})")
        if self.berries[0] < 1:
            raise ConfigurationError("cluster: a truss has at least one berry")
        if (
            not self.stage_shares
            or min(self.stage_shares.values()) < 0
            or sum(self.stage_shares.values()) <= 0
        ):
            raise ConfigurationError("cluster: stage_shares must be ≥ 0 and not all zero")


@dataclass(frozen=True, eq=False)
class HangingBerry:
    """A berry in place: ``T_base_berry`` (4, 4) has its origin at the calyx, z along the stem upwards."""

    index: int
    berry: Berry
    T_base_berry: NDArray[np.float64]

    @property
    def centre(self) -> NDArray[np.float64]:
        """Centre of the fruit, (3,) in the base frame."""
        return self.T_base_berry[:3, :3] @ np.asarray(self.berry.centre) + self.T_base_berry[:3, 3]

    @property
    def radius(self) -> float:
        """Largest half-axis of the fruit, metres."""
        return float(np.max(self.berry.semi_axes))


@dataclass(frozen=True, eq=False)
class HangingTruss:
    """A truss and the berries at its tips, in the same order."""

    truss: Truss
    berries: tuple[HangingBerry, ...]


@dataclass(frozen=True, eq=False)
class Cluster:
    """All trusses that hang in front of the robot."""

    config: ClusterConfig
    trusses: tuple[HangingTruss, ...]

    @property
    def berries(self) -> tuple[HangingBerry, ...]:
        """All berries, by index."""
        return tuple(berry for truss in self.trusses for berry in truss.berries)


def grow_cluster(rng: np.random.Generator, config: ClusterConfig | None = None) -> Cluster:
    """Lay out a cluster, never the same twice; berries keep the clearance that ``config`` asks for.

    A truss that finds no room after many tries is grown with one berry less, so a crowded config gives fewer berries
    rather than berries inside each other.
    """
    config = config or ClusterConfig()
    count = int(rng.integers(config.trusses[0], config.trusses[1], endpoint=True))
    places = _spread(rng, config.across, count)
    placed: list[HangingBerry] = []
    trusses = []
    for place in places:
        anchor = np.array([rng.uniform(*config.front), place, rng.uniform(*config.lip_height)])
        wanted = int(rng.integers(config.berries[0], config.berries[1], endpoint=True))
        truss = _grow_with_room(rng, config, anchor, wanted, placed)
        if truss is not None:
            trusses.append(truss)
            placed.extend(truss.berries)
    return Cluster(config, tuple(trusses))


def _spread(rng: np.random.Generator, across: tuple[float, float], count: int) -> NDArray[np.float64]:
    """``count`` places over a range, evenly with jitter."""
    width = (across[1] - across[0]) / max(count, 1)
    return across[0] + width * (np.arange(count) + 0.5 + rng.uniform(-0.25, 0.25, count))


def _grow_with_room(
    rng: np.random.Generator,
    config: ClusterConfig,
    anchor: NDArray[np.float64],
    wanted: int,
    placed: list[HangingBerry],
) -> HangingTruss | None:
    stages = list(config.stage_shares)
    shares = np.array([config.stage_shares[stage] for stage in stages])
    for berries in range(wanted, 0, -1):
        fruit = [
            make_berry(rng, stages[rng.choice(len(stages), p=shares / shares.sum())]) for _ in range(berries)
        ]
        for _ in range(_ATTEMPTS):
            truss = grow_truss(rng, anchor, berries, config.style)
            hanging = [
                _hang(rng, fruit[number], truss.hanging_point(number), len(placed) + number, config.tilt)
                for number in range(berries)
            ]
            if _have_room(hanging, placed, truss, config.clearance):
                return HangingTruss(truss, tuple(hanging))
    return None


def _hang(
    rng: np.random.Generator, berry: Berry, hanging_point: NDArray[np.float64], index: int, tilt: float
) -> HangingBerry:
    lean = rng.normal(0.0, tilt, 2)
    turn = rotation_from_vector((0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)))
    rotation = rotation_from_vector((lean[0], lean[1], 0.0)) @ turn
    calyx = hanging_point - rotation[:, 2] * STUB_LENGTH
    return HangingBerry(index, berry, make_transform(rotation, calyx))


def _have_room(
    hanging: list[HangingBerry], placed: list[HangingBerry], truss: Truss, clearance: float
) -> bool:
    """No berry within the clearance of another, and no stem through a berry of its own truss."""
    everyone = placed + hanging
    for number, one in enumerate(hanging):
        for other in everyone[: len(placed) + number]:
            if np.linalg.norm(one.centre - other.centre) < clearance * (one.radius + other.radius):
                return False
    middles = np.array([(link.start + link.end) / 2.0 for link in truss.links])
    stubs = np.array([b.T_base_berry[:3, 3] + b.T_base_berry[:3, 2] * STUB_LENGTH / 2.0 for b in hanging])
    points = np.concatenate([middles, stubs])
    return all(np.linalg.norm(points - berry.centre, axis=1).min() > berry.radius * 0.95 for berry in hanging)
