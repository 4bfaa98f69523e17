import mujoco
import numpy as np
import pytest

from punnet.sim.cutting import BLADE_REACH, CUT_ABOVE_CALYX, StemState, apply_cut, stem_states


@pytest.mark.parametrize(
    ("distance", "height", "gripped", "cut"),
    [
        (0.002, 0.015, True, True),
        (0.002, 0.015, False, False),
        (BLADE_REACH + 0.001, 0.015, True, False),
        (0.002, CUT_ABOVE_CALYX[0] - 0.001, True, False),
        (0.002, CUT_ABOVE_CALYX[1] + 0.001, True, False),
    ],
)
def test_the_rule(distance, height, gripped, cut):
    assert StemState(0, distance, height, gripped).can_be_cut is cut


def test_far_from_the_plant_nothing_is_cut(world):
    states = stem_states(world)
    assert len(states) == world.berries
    assert min(state.distance for state in states) > 0.1
    assert apply_cut(world) == []
    assert world.attached().all()


def test_distance_and_height_are_those_of_the_blade(world):
    edge = world.data.site("blade_edge")
    axes = np.array(edge.xmat).reshape(3, 3)
    pose = np.eye(4)
    pose[:3, :3] = axes[:, [1, 2, 0]]  # stem (the berry's z) along the tool's x, as it should be
    pose[:3, 3] = edge.xpos - 0.012 * axes[:, 0] + 0.004 * axes[:, 2]
    joint = world.model.joint(world.planted[0].body)
    address = int(joint.qposadr[0])
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, pose[:3, :3].ravel())
    world.data.qpos[address : address + 7] = (*pose[:3, 3], *quaternion)
    mujoco.mj_forward(world.model, world.data)
    state = stem_states(world)[0]
    assert state.height == pytest.approx(0.012, abs=0.001)
    assert state.distance == pytest.approx(0.004, abs=1e-6)
