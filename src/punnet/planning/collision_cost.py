"""What a reach would run into: a cost for each of many reaches, from what was observed.

A thing costs by how far the tool comes into its margin, at the worst moment. What the tool may brush (stems, leaves)
costs less than fruit, what would damage the machine (structure) much more. A stem between the fingers costs most of
what grows: once they have closed it can't get out, and its berry is dragged along until the picked one is lost. So it
is with a leaf.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.planning.capsules import Capsules, segment_distances
from punnet.planning.observed_scene import ObservedScene
from punnet.planning.promp_depth import APPROACH_PHASE
from punnet.planning.tool_shape import ARM, CARRIED, OPENING, SLOT, SOLID, placed

__all__ = ["CHECKED_PHASES", "CollisionCosts", "collision_costs", "stems_caught"]

CHECKED_PHASES = np.concatenate((np.linspace(0.34, 0.66, 5), np.linspace(APPROACH_PHASE, 1.0, 9)))
"""Phases at which the tool is looked at; before them it is far from any plant."""
_APPROACHING = CHECKED_PHASES >= APPROACH_PHASE
_LEAVING = CHECKED_PHASES >= 0.75

FRUIT_MARGIN, STEM_MARGIN = 0.010, 0.006
"""Metres: where a berry or a stem hangs is not known better, and they sway."""
DEEPEST = 3.0
"""Margins beyond which it does not matter how much deeper it goes."""

_WEIGHTS = {
    "fruit": 1.0,
    "opening": 0.5,
    "carried": 0.3,
    "slot": 1.5,
    "caught": 6.0,
    "brushed": 0.1,
    "soft": 1.0,
    "leaf": 3.0,
    "hard": 20.0,
}
_POINTS = 4  # a capsule, for what is kept as cells
_IN_SLOT = 8


@dataclass(frozen=True, eq=False)
class CollisionCosts:
    """(K,) each, weighted: fruit that the tool or the carried berry meets, stems, soft and hard things."""

    fruit: NDArray[np.float64]
    stems: NDArray[np.float64]
    soft: NDArray[np.float64]
    hard: NDArray[np.float64]

    @property
    def total(self) -> NDArray[np.float64]:
        """Sum (K,)."""
        return np.asarray(self.fruit + self.stems + self.soft + self.hard)


def collision_costs(scene: ObservedScene, T_base_flange: NDArray[np.float64]) -> CollisionCosts:
    """Costs of K reaches, whose flange is at (K, T, 4, 4) at the T :data:`CHECKED_PHASES`."""
    T = T_base_flange.copy()
    T[..., :3, 3] -= scene.origin
    fruit = (
        _WEIGHTS["fruit"] * _depths(scene.fruit, SOLID, T, FRUIT_MARGIN, scene.care)
        + _WEIGHTS["slot"] * _depths(scene.fruit, SLOT, T, FRUIT_MARGIN, scene.care)
        + _WEIGHTS["opening"] * _depths(scene.fruit, OPENING, T[:, _APPROACHING], FRUIT_MARGIN, scene.care)
        + _WEIGHTS["carried"] * _depths(scene.fruit, CARRIED, T[:, _LEAVING], FRUIT_MARGIN, scene.care)
    )
    stems = _WEIGHTS["caught"] * stems_caught(scene, T_base_flange) + _WEIGHTS["brushed"] * (
        _depths(scene.stems, SOLID, T, STEM_MARGIN)
        + _depths(scene.stems, CARRIED, T[:, _LEAVING], STEM_MARGIN)
    )
    solid = placed(SOLID, T).points(_POINTS)
    arm = placed(ARM, T).points(_POINTS)
    gripped = placed(SLOT, T[:, -1]).points(_IN_SLOT)
    soft = scene.soft_at(solid).mean(axis=(1, 2, 3))
    leaf = scene.soft_at(gripped).mean(axis=(1, 2))
    hard = scene.hard_at(solid).mean(axis=(1, 2, 3)) + scene.hard_at(arm).mean(axis=(1, 2, 3))
    return CollisionCosts(
        fruit, stems, _WEIGHTS["soft"] * soft + _WEIGHTS["leaf"] * leaf, _WEIGHTS["hard"] * hard
    )


def stems_caught(scene: ObservedScene, T_base_flange: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K,) how deep neighbours' stems are between the fingers, in margins, of K reaches as in :func:`collision_costs`."""
    T = T_base_flange.copy()
    T[..., :3, 3] -= scene.origin
    return _depths(scene.stems, SLOT, T, STEM_MARGIN)


def _depths(
    things: Capsules,
    tool: Capsules,
    T: NDArray[np.float64],
    margin: float,
    care: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """How deep, in margins, the tool comes at the worst moment, summed over the things, each with its care: (K,)."""
    if not len(things):
        return np.zeros(len(T))
    at = placed(tool, T)
    distance = segment_distances(at.starts.reshape(-1, 3), at.ends.reshape(-1, 3), things.starts, things.ends)
    distance = distance.reshape(*at.starts.shape[:-1], len(things)) - things.radii - at.radii[:, None]
    nearest = distance.min(axis=(1, 2))
    depth = np.clip(1.0 - nearest / margin, 0.0, DEEPEST)
    return np.asarray((depth if care is None else depth * care).sum(axis=-1))
