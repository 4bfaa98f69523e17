"""Flowers among the trusses: as many as asked for, in front of the gutter, and out of contact."""

import mujoco
import numpy as np
import pytest

from punnet.sim.blossom import add_blossom


@pytest.mark.parametrize("count", [0, 1, 5])
def test_flowers_hang_in_front_of_the_gutter_and_touch_nothing(count):
    spec = mujoco.MjSpec()
    add_blossom(spec, np.random.default_rng(count), count)
    spec.worldbody.add_geom(name="floor", size=(1, 1, 0.1), type=mujoco.mjtGeom.mjGEOM_BOX)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    heads = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH]
    assert len(heads) == count
    for head in heads:
        x, y, z = data.geom_xpos[head]
        assert 0.68 < x < 0.81
        assert -0.45 < y < 0.40
        assert 0.66 < z < 0.95
        assert model.geom_contype[head] == model.geom_conaffinity[head] == 0
