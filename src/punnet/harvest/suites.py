"""The plants of the harvest benchmark: five suites, each a kind of plant and of light, the same for the same seed for ever.

A suite has a version. Whatever changes its plants (a draw, the grower, the light) raises it, and figures of different
versions are not compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.robot import HOME, T_FLANGE_CAMERA, Panda
from punnet.sim.cluster import Cluster, ClusterConfig, grow_cluster
from punnet.sim.demonstrations import WORKSPACE
from punnet.sim.demonstrations_scene import grow_scene
from punnet.sim.lighting import Light
from punnet.sim.ripeness import RipenessStage
from punnet.sim.truss import TrussStyle
from punnet.sim.world import WorldConfig

__all__ = ["SUITES", "Suite", "covered_shares", "suite_of", "touching_group"]

Draw = Callable[[np.random.Generator], ClusterConfig]
Accept = Callable[[Cluster], bool]

_LAYOUTS = 3000
_TOUCHING = 0.004  # metres between two skins that count as touching: they sway that much
_IN_FRONT = 0.015  # metres nearer to the camera
_DISC = 64  # points of a berry's outline that are looked at
_UNRIPE = {RipenessStage.GREEN: 0.45, RipenessStage.WHITE: 0.25, RipenessStage.TURNING: 0.30}


@dataclass(frozen=True)
class Suite:
    """A kind of plant, in a light.

    Parameters
    ----------
    name, about
        What ``--suite`` takes, and what it is.
    version
        Of its plants.
    stream
        Sets the random numbers of suites apart.
    lay_out
        From a generator to the seed of a world and what it grows.
    light
        What it is seen in.
    """

    name: str
    about: str
    version: int
    stream: int
    lay_out: Callable[[np.random.Generator], tuple[int, ClusterConfig]]
    light: Light = "day"

    @property
    def label(self) -> str:
        """Name and version, as results carry it."""
        return f"{self.name}/{self.version}"

    def plant(self, seed: int, world: WorldConfig | None = None) -> tuple[int, WorldConfig]:
        """Seed and config for :func:`punnet.sim.world.build_world` of the suite's plant of ``seed``.

        ``world`` tells what does not belong to the plant, as whether the arm is drawn.
        """
        rng = np.random.default_rng((self.stream, seed))
        world_seed, cluster = self.lay_out(rng)
        return world_seed, replace(world or WorldConfig(), cluster=cluster, light=self.light)


def suite_of(name: str) -> Suite:
    """The suite of that name.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if name not in SUITES:
        raise ConfigurationError(f"benchmark: no suite '{name}'; there are {', '.join(SUITES)}")
    return SUITES[name]


def _drawn(draw: Draw, accept: Accept) -> Callable[[np.random.Generator], tuple[int, ClusterConfig]]:
    """Draw configs and seeds until the plant that grows of them is accepted."""

    def lay_out(rng: np.random.Generator) -> tuple[int, ClusterConfig]:
        for _ in range(_LAYOUTS):
            config, seed = draw(rng), int(rng.integers(2**31))
            # build_world draws the plant first, so it grows this very cluster
            if accept(grow_cluster(np.random.default_rng(seed), config)):
                return seed, config
        raise ConfigurationError(f"benchmark: none of {_LAYOUTS} plants is of this suite; report the seed")

    return lay_out


def _has_ripe(cluster: Cluster) -> bool:
    """Whether at least one ripe berry hangs before the arm."""
    calyxes = [berry.T_base_berry[:3, 3] for berry in cluster.berries if berry.berry.stage.pluckable]
    return any(bool(((place > WORKSPACE[0]) & (place < WORKSPACE[1])).all()) for place in calyxes)


def _easy(rng: np.random.Generator) -> ClusterConfig:
    """Two or three trusses of one or two berries, wide apart, hardly a leaf among them."""
    return ClusterConfig(trusses=(2, 3), berries=(1, 2), clearance=1.5, hanging_leaves=(0, 1))


def _clustered(rng: np.random.Generator) -> ClusterConfig:
    """One to three trusses from nearly one place, the fruit stalks short: the berries hang against each other."""
    trusses = int(rng.integers(1, 4))
    middle, half_width = rng.uniform(-0.16, 0.06), 0.012 * trusses
    return ClusterConfig(
        trusses=(trusses, trusses),
        berries=(3, 4),
        clearance=0.8,
        across=(middle - half_width, middle + half_width),
        hanging_leaves=(0, 2),
        style=TrussStyle(peduncle_length=(0.10, 0.15), pedicel_length=(0.045, 0.08), spread=0.45),
    )


def _is_clustered(cluster: Cluster) -> bool:
    group = touching_group(cluster)
    return (
        3 <= len(group) <= 12
        and any(cluster.berries[i].berry.stage.pluckable for i in group)
        and _has_ripe(cluster)
    )


def _occluded(rng: np.random.Generator) -> ClusterConfig:
    """Three or four trusses one behind another, two in five berries ripe, with leaves hanging before the ripe ones."""
    shares = {stage: 0.6 * share for stage, share in _UNRIPE.items()} | {RipenessStage.RIPE: 0.4}
    return ClusterConfig(
        trusses=(3, 4),
        berries=(2, 4),
        stage_shares=shares,
        clearance=1.05,
        across=(-0.18, 0.06),
        hanging_leaves=(2, 4),
        veils=(2, 3),
    )


def _is_occluded(cluster: Cluster) -> bool:
    """Some ripe berry is hidden by unripe fruit by a fifth or more, and none of the ripe ones all but wholly."""
    ripe = np.array([berry.berry.stage.pluckable for berry in cluster.berries], dtype=np.bool_)
    if not _has_ripe(cluster):
        return False
    return bool(
        (covered_shares(cluster, by=~ripe)[ripe] > 0.2).any() and (covered_shares(cluster)[ripe] < 0.85).all()
    )


def _night(rng: np.random.Generator) -> ClusterConfig:
    """The demo's plants."""
    return ClusterConfig()


def _thesis(rng: np.random.Generator) -> tuple[int, ClusterConfig]:
    """The ``single`` scene of the demonstrations: one ripe berry, well seen and in reach, among unripe ones and leaves."""
    scene = grow_scene(rng, "single")
    return scene.world_seed, scene.config


def touching_group(cluster: Cluster) -> tuple[int, ...]:
    """Indices of the largest group of berries that hang skin to skin, as laid out."""
    count = len(cluster.berries)
    centres = np.array([berry.centre for berry in cluster.berries]).reshape(count, 3)
    axes = np.array([berry.berry.semi_axes for berry in cluster.berries]).reshape(count, 3)
    reach = np.stack((axes[:, :2].mean(axis=1),) * 2 + (axes[:, 2],), axis=1)  # they hang upright
    apart = centres[:, None] - centres
    scaled = np.linalg.norm(apart / (reach[:, None] + reach + _TOUCHING), axis=-1)
    near = scaled < 1.0
    best: tuple[int, ...] = ()
    left = set(range(count))
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = {int(j) for i in edge for j in np.flatnonzero(near[i])} - group
        left -= group
        best = max(best, tuple(sorted(group)), key=len)
    return best


def covered_shares(cluster: Cluster, by: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """(N,) share of each berry's outline that nearer berries hide from the camera at home; ``by`` (N,): only those."""
    eye = (Panda().forward_kinematics(HOME) @ T_FLANGE_CAMERA)[:3, 3]
    count = len(cluster.berries)
    centres = np.array([berry.centre for berry in cluster.berries]).reshape(count, 3)
    radii = np.array([float(np.mean(berry.berry.semi_axes)) for berry in cluster.berries])
    distance = np.linalg.norm(centres - eye, axis=1)
    hides = np.ones(count, dtype=np.bool_) if by is None else by
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(_DISC)
    disc = np.sqrt((np.arange(_DISC) + 0.5) / _DISC)[:, None] * np.stack((np.cos(turn), np.sin(turn)), axis=1)
    shares = np.zeros(count)
    for index in range(count):
        nearer = np.flatnonzero(hides & (distance < distance[index] - _IN_FRONT))
        if not len(nearer):
            continue
        forward = (centres[index] - eye) / distance[index]
        side = np.cross(forward, (0.0, 0.0, 1.0))
        side /= np.linalg.norm(side)
        plane = disc[:, :1] * side + disc[:, 1:] * np.cross(side, forward)
        rays = centres[index] + radii[index] * plane - eye
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        to_other = centres[nearer] - eye
        along = rays @ to_other.T
        missed = np.square(to_other).sum(axis=1) - np.square(along)
        shares[index] = (missed < np.square(radii[nearer])).any(axis=1).mean()
    return shares


SUITES = {
    suite.name: suite
    for suite in (
        Suite("easy", "few berries, wide apart", 1, 11, _drawn(_easy, _has_ripe)),
        Suite("thesis", "one ripe berry among unripe ones and leaves", 1, 12, _thesis),
        Suite("clustered", "3 to 12 berries touching", 1, 13, _drawn(_clustered, _is_clustered)),
        Suite("occluded", "leaves and unripe berries in front", 1, 14, _drawn(_occluded, _is_occluded)),
        Suite("night", "lamp light and a noisy camera", 1, 15, _drawn(_night, _has_ripe), "lamp"),
    )
}
