"""What in the simulated world must not be run into, as a motion guard takes it."""

from __future__ import annotations

import mujoco
import numpy as np

from punnet.robot import Boxes
from punnet.sim.layers import STRUCTURE
from punnet.sim.world import World

__all__ = ["structure_boxes"]

_FAR = 10.0
_THICK = 1.0


def structure_boxes(world: World) -> Boxes:
    """Table, weigh cells, gutter with bags and legs, and the ground, as boxes in the base frame.

    The punnets' walls, which have no names, are left out: the tool reaches in between them.
    """
    model, data = world.model, world.data
    low, high = [], []
    for geom in range(model.ngeom):
        solid = (model.geom_contype[geom], model.geom_conaffinity[geom]) == STRUCTURE
        if not solid or not model.geom(geom).name:
            continue
        centre = data.geom_xpos[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE.value:
            low.append(centre - np.array([_FAR, _FAR, _THICK]))
            high.append(centre + np.array([_FAR, _FAR, 0.0]))
            continue
        rotation = data.geom_xmat[geom].reshape(3, 3)
        middle = centre + rotation @ model.geom_aabb[geom, :3]
        half = np.abs(rotation) @ model.geom_aabb[geom, 3:]
        low.append(middle - half)
        high.append(middle + half)
    return Boxes(np.array(low).reshape(-1, 3), np.array(high).reshape(-1, 3))
