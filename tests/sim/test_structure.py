"""The guard's picture of arm and structure against the simulator's own meshes."""

import mujoco
import numpy as np
import pytest

from punnet.robot import HOME, Panda
from punnet.robot.arm_shape import self_clearance, structure_clearance
from punnet.sim.arm import JOINT_NAMES
from punnet.sim.picker import add_picker
from punnet.sim.placed_arm import place_arm
from punnet.sim.structure import structure_boxes
from tests.sim.conftest import small_world

ARM = Panda()
# Bodies along the arm that may touch where they are joined.
PARTS = (
    ("fr3_link0",),
    ("fr3_link1", "fr3_link2"),
    ("fr3_link3", "fr3_link4"),
    ("fr3_link5",),
    ("fr3_link6", "fr3_link7"),
)
CLEARANCE = 0.015  # the guard's own


@pytest.fixture(scope="module")
def arm_alone():
    placed = place_arm(Panda(), with_visuals=False)
    add_picker(placed)
    return placed.spec.compile()


def part_of(model, geom):
    name = model.body(model.geom_bodyid[geom]).name
    return next((part for part, names in enumerate(PARTS) if name in names), len(PARTS))


def test_whatever_meets_by_the_meshes_is_too_near_by_the_spheres(arm_alone):
    model, data = arm_alone, mujoco.MjData(arm_alone)
    solid = np.flatnonzero(model.geom_contype)
    pairs = [(a, b) for a in solid for b in solid if part_of(model, a) + 1 < part_of(model, b)]
    joints = np.random.default_rng(3).uniform(ARM.limits.lower, ARM.limits.upper, (250, 7))
    addresses = [model.joint(name).qposadr[0] for name in JOINT_NAMES]
    fromto = np.zeros(6)
    distance = np.empty(len(joints))
    for row, q in enumerate(joints):
        data.qpos[addresses] = q
        mujoco.mj_kinematics(model, data)
        distance[row] = min(mujoco.mj_geomDistance(model, data, a, b, 0.1, fromto) for a, b in pairs)
    flagged = self_clearance(ARM, joints) < CLEARANCE
    met = distance <= 0.0
    assert met.sum() >= 10
    assert flagged[met].all()
    assert flagged[distance > 0.06].mean() < 0.01  # and not all that cautious


def test_structure_is_the_worlds():
    world = small_world(5)
    boxes = structure_boxes(world)
    names = ("table", "gutter", "bags", "leg0", "leg1", "leg2", "ground", "weigh_cell0", "weigh_cell1")
    assert len(boxes.low) == len(names)
    table = np.flatnonzero(np.isclose(boxes.high[:, 2], 0.0))
    assert len(table) == 1
    assert np.allclose(boxes.low[table[0]], (-0.17, -0.50, -0.04))
    gutter = world.data.geom_xpos[world.model.geom("gutter").id]
    assert ((boxes.low < gutter) & (gutter < boxes.high)).all(axis=1).sum() == 1
    assert structure_clearance(ARM, HOME, boxes) > 0.04
