import mujoco
import numpy as np
import pytest

from punnet.errors import RobotError
from punnet.sim.cluster import ClusterConfig
from punnet.sim.world import TIME_STEP, WorldConfig, build_world
from tests.sim.conftest import small_world
from tests.timing import times_as_long


def test_the_plant_hangs_as_it_was_grown(world):
    grown = np.array([berry.T_base_berry[:3, 3] for berry in world.cluster.berries])
    hanging = world.berry_poses()[:, :3, 3]
    assert np.linalg.norm(hanging - grown, axis=1).max() < 0.012


def test_the_same_seed_gives_the_same_world_after_a_second():
    first, again = small_world(3), small_world(3)
    for _ in range(200):
        first.step()
        again.step()
    assert np.array_equal(first.data.qpos, again.data.qpos)


def test_stems_sway_when_a_berry_is_pushed_and_come_to_rest(world):
    before = world.berry_poses()[0, :3, 3].copy()
    body = world.model.body(world.planted[0].body).id
    world.data.xfrc_applied[body, 1] = 0.05
    for _ in range(100):
        world.step()
    pushed = world.berry_poses()[0, :3, 3].copy()
    assert pushed[1] - before[1] > 0.002
    world.data.xfrc_applied[body] = 0.0
    for _ in range(4000):
        world.step()
    assert np.linalg.norm(world.berry_poses()[0, :3, 3] - before) < 0.004


def test_a_detached_berry_falls(world):
    before = world.berry_poses()[:, 2, 3].copy()
    world.detach(1)
    for _ in range(100):
        world.step()
    fallen = before - world.berry_poses()[:, 2, 3]
    assert fallen[1] > 0.1
    assert np.abs(np.delete(fallen, 1)).max() < 0.02
    assert list(np.flatnonzero(~world.attached())) == [1]


def runs_away(model, data):
    data.qvel[-1] = 1e6


def finds_no_end(model, data):
    data.solver_niter[max(0, data.nisland - 1)] = model.opt.iterations
    data.qpos[-1] += 0.5


@pytest.mark.parametrize("fails", [runs_away, finds_no_end])
def test_a_step_that_fails_is_made_again_by_other_means(world, monkeypatch, fails):
    step, solvers = mujoco.mj_step, []

    def thrown_off(model, data):
        step(model, data)
        solvers.append(model.opt.solver)
        if model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON:
            fails(model, data)

    for _ in range(10):
        world.step()
    before = world.data.time, world.data.qpos.copy()
    monkeypatch.setattr(mujoco, "mj_step", thrown_off)
    world.step()
    assert solvers == [mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtSolver.mjSOL_CG]
    assert world.data.time == pytest.approx(before[0] + TIME_STEP)
    assert np.abs(world.data.qpos - before[1]).max() < 1e-3
    assert world.model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON


def test_what_diverges_all_the_same_is_an_error(world, monkeypatch):
    step = mujoco.mj_step

    def thrown_off(model, data):
        step(model, data)
        data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number = 1
        data.qvel[-1] = np.nan

    monkeypatch.setattr(mujoco, "mj_step", thrown_off)
    with pytest.raises(RobotError, match="diverged"):
        world.step()


def test_physics_outruns_the_clock():
    """A full plant is no dearer than a plain chain of 40 links; benchmarks/simulator.py tells the multiple of real time."""
    world = build_world(5, WorldConfig(cluster=ClusterConfig(), arm_visuals=False))
    link = (
        '<body pos="0 0 -0.02"><joint type="ball" damping="1e-4"/>'
        '<geom type="capsule" size="0.005" fromto="0 0 0 0 0 -0.02" contype="0" conaffinity="0"/>'
    )
    chain = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{40 * link}{40 * '</body>'}</worldbody></mujoco>"
    )
    hanging = mujoco.MjData(chain)

    def grow_on() -> None:
        for _ in range(150):
            world.step()

    def sway() -> None:
        for _ in range(150):
            mujoco.mj_step(chain, hanging)

    assert times_as_long(grow_on, sway, turns=4) < 1
