"""What labelled images are made for: which plants are grown, and what the camera aims at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from punnet.errors import ConfigurationError
from punnet.sim.cluster import Cluster, ClusterConfig
from punnet.sim.lighting import Light
from punnet.sim.ripeness import RipenessStage
from punnet.sim.truss import TrussStyle

__all__ = ["DATASET_1", "MOST_BERRIES", "NIGHT", "PROTOCOLS", "VARIED", "Protocol", "protocol_of"]

MOST_BERRIES = 12


@dataclass(frozen=True)
class Protocol:
    """A kind of data set.

    Parameters
    ----------
    name
        What ``--protocol`` takes.
    images
        How many there are unless told otherwise.
    stream
        Sets the random numbers of protocols apart: plants of one are none of another's, though the seed be the same.
    group
        What the names of its plants begin with.
    draw_config
        Draws what kind of plant to grow.
    accepts
        Whether a plant will do; another is grown if not.
    draw_targets
        Draws which berries (indices) the camera may aim at.
    light
        ``day``: light from anywhere; ``lamp``: at night, by a lamp beside the camera.
    """

    name: str
    images: int
    stream: tuple[int, ...]
    group: str
    draw_config: Callable[[np.random.Generator], ClusterConfig]
    accepts: Callable[[Cluster], bool]
    draw_targets: Callable[[np.random.Generator, Cluster], tuple[int, ...]]
    light: Light = "day"


def protocol_of(name: str) -> Protocol:
    """The protocol of that name.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if name not in PROTOCOLS:
        raise ConfigurationError(f"simulate: no protocol '{name}'; there are {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]


def _draw_varied(rng: np.random.Generator) -> ClusterConfig:
    """A plant: how many trusses and berries, how dense, how leafy, how ripe."""
    shares_of_all = {
        RipenessStage.GREEN: 0.20,
        RipenessStage.WHITE: 0.10,
        RipenessStage.TURNING: 0.13,
        RipenessStage.RIPE: 0.45,
        RipenessStage.OVERRIPE: 0.06,
        RipenessStage.ROTTEN: 0.06,
    }
    trusses = int(rng.integers(1, 5))
    most = min(int(rng.integers(1, 7)), MOST_BERRIES // trusses)
    half_width = trusses * rng.uniform(0.006, 0.038)
    hanging, canopy = int(rng.integers(0, 8)), int(rng.integers(6, 35))
    shares = {stage: share * rng.gamma(1.5) for stage, share in shares_of_all.items()}
    return ClusterConfig(
        trusses=(trusses, trusses),
        berries=(max(1, most - 2), most),
        stage_shares=shares,
        across=(-0.09 - half_width, -0.09 + half_width),
        canopy_leaves=(canopy, canopy),
        hanging_leaves=(hanging, hanging),
        **_draw_stature(rng),
    )


def _draw_dataset_1(rng: np.random.Generator) -> ClusterConfig:
    """A set of one to three berries on one truss, seldom two, most of them ripe."""
    trusses = 1 + int(rng.random() < 0.1)
    berries = int(rng.choice((1, 2, 3), p=(0.70, 0.25, 0.05)))
    half_width = trusses * rng.uniform(0.012, 0.038)
    hanging, canopy = int(rng.integers(0, 4)), int(rng.integers(6, 35))
    return ClusterConfig(
        trusses=(trusses, trusses),
        berries=(berries, berries),
        stage_shares={
            RipenessStage.GREEN: 0.22,
            RipenessStage.WHITE: 0.13,
            RipenessStage.TURNING: 0.15,
            RipenessStage.RIPE: 0.50,
        },
        across=(-0.09 - half_width, -0.09 + half_width),
        canopy_leaves=(canopy, canopy),
        hanging_leaves=(hanging, hanging),
        **_draw_stature(rng),
    )


def _draw_stature(rng: np.random.Generator) -> dict[str, Any]:
    """How trusses grow, how close berries hang, and how far out of the vertical."""
    shortest = rng.uniform(0.02, 0.06)
    return {
        "clearance": float(rng.uniform(0.75, 1.3)),
        "style": TrussStyle(
            peduncle_length=(0.07, 0.17),
            pedicel_length=(shortest, shortest + 0.06),
            peduncle_radius=float(rng.uniform(0.0012, 0.0020)),
            pedicel_radius=float(rng.uniform(0.0008, 0.0012)),
        ),
        "tilt": float(rng.uniform(0.05, 0.15) if rng.random() < 0.5 else rng.uniform(0.15, 0.6)),
    }


def _has_berries(cluster: Cluster) -> bool:
    return bool(cluster.berries)


def _ripe(cluster: Cluster) -> list[int]:
    return [berry.index for berry in cluster.berries if berry.berry.stage.pluckable]


def _has_ripe_berries(cluster: Cluster) -> bool:
    return bool(_ripe(cluster))


def _any_berry(rng: np.random.Generator, cluster: Cluster) -> tuple[int, ...]:
    return tuple(range(len(cluster.berries)))


def _one_ripe_berry(rng: np.random.Generator, cluster: Cluster) -> tuple[int, ...]:
    return (int(rng.choice(_ripe(cluster))),)


VARIED = Protocol("varied", 300, (), "plant", _draw_varied, _has_berries, _any_berry)
"""Plants as different as can be, each view aiming at any berry: what detectors are trained on."""

DATASET_1 = Protocol("dataset-1", 532 * 3, (1,), "set", _draw_dataset_1, _has_ripe_berries, _one_ripe_berry)
"""The thesis' Dataset-1 (section 3.3.1): 532 sets of a few berries, most of them ripe, each taken from three distances, the
nearest showing one ripe berry: about 1,900 weighed berries in 1,596 images."""

NIGHT = Protocol("night", 300, (2,), "night", _draw_varied, _has_berries, _any_berry, "lamp")
"""The plants of :data:`VARIED`, at night under a lamp beside a camera with its gain up."""

PROTOCOLS = {protocol.name: protocol for protocol in (VARIED, DATASET_1, NIGHT)}
