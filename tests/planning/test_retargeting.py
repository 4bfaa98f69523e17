from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import BundleError, PlanningError
from punnet.movement import retime
from punnet.planning import DeepProMPPlanner, FusedPlanner, ProMPDepthPlanner
from punnet.planning.retargeting import retargeted
from punnet.robot import HOME, MotionGuard, Panda, load_arm
from punnet.scene import Frame, Target

POINTS = [[0.75, 0.0, 0.7], [0.72, 0.12, 0.78], [0.74, -0.12, 0.66]]
FRAME = Frame(rgb=np.zeros((48, 64, 3), dtype=np.uint8))


@pytest.fixture(scope="module", params=["ur5", "xarm7"])
def arm(request):
    return load_arm(request.param)


def test_flange_goes_where_it_was_demonstrated(arm):
    panda = Panda()
    demonstrated = ProMPDepthPlanner.from_bundle().promp
    other = retargeted(demonstrated, panda, arm)
    phases = np.linspace(0.0, 1.0, 7)
    assert other.dimensions == arm.joint_count
    assert other.names == arm.limits.joint_names
    assert other.duration == pytest.approx(demonstrated.duration)
    ways = [
        a.forward_kinematics(d.sample(np.random.default_rng(1), 300, phases))[..., :3, 3]
        for a, d in ((panda, demonstrated), (arm, other))
    ]
    assert np.abs(ways[0].mean(axis=0) - ways[1].mean(axis=0)).max() < 0.01
    spread, other_spread = (way.std(axis=0) for way in ways)
    assert (np.abs(spread - other_spread) < 0.005 + 0.3 * spread).all()


def test_same_question_has_the_same_answer(arm):
    demonstrated = ProMPDepthPlanner.from_bundle().promp
    once, again = (retargeted(demonstrated, Panda(), arm) for _ in range(2))
    assert (once.weight_mean == again.weight_mean).all()


def test_onto_itself_nothing_is_changed():
    demonstrated = ProMPDepthPlanner.from_bundle().promp
    same = retargeted(demonstrated, Panda(), Panda())
    phases = np.linspace(0.0, 1.0, 5)
    panda = Panda()
    before, after = (panda.forward_kinematics(d.mean(phases))[:, :3, 3] for d in (demonstrated, same))
    assert np.abs(before - after).max() < 0.01


@pytest.mark.parametrize("point", POINTS)
def test_planned_reaches_are_the_arm_s_to_execute(arm, point):
    planner = ProMPDepthPlanner.from_bundle(arm=arm)
    reach = planner.plan(FRAME, Target(np.array([3.0, 4.0, 20.0, 30.0]), np.array(point)), arm.home)
    path = reach.mean(np.linspace(0.0, 1.0, 150))
    path[0] = arm.home
    assert np.abs(arm.forward_kinematics_tool(path[-1])[:3, 3] - point).max() < 0.003
    trajectory = retime(path, arm.limits, speed=0.5)
    assert MotionGuard(arm).refusal(trajectory, arm.home) is None


def test_fused_plans_for_it_too(arm):
    planner = FusedPlanner.from_bundle(arm=arm)
    reach = planner.plan(FRAME, Target(np.array([3.0, 4.0, 20.0, 30.0]), np.array(POINTS[0])), arm.home)
    assert np.abs(arm.forward_kinematics_tool(reach.mean([1.0])[0])[:3, 3] - POINTS[0]).max() < 0.003


def test_arm_that_can_not_follow_is_told_where(six_joints_far):
    with pytest.raises(PlanningError, match=r"can follow \d+ of 200 .* Mount it nearer"):
        ProMPDepthPlanner.from_bundle(arm=six_joints_far)


@pytest.fixture
def six_joints_far():
    ur5 = load_arm("ur5")
    T = ur5.T_base_foot.copy()
    T[0, 3] -= 0.4
    return replace(ur5, T_base_foot=T)


def test_distribution_of_another_arm_is_refused():
    promp = ProMPDepthPlanner.from_bundle().promp
    with pytest.raises(PlanningError, match="over 6 joints is needed"):
        retargeted(promp, load_arm("ur5"), Panda())


def test_model_of_joints_is_refused_for_another_arm(reach_run):
    joint_bundle = f"{reach_run / 'bundle'}:full-joint"
    assert DeepProMPPlanner.from_bundle(joint_bundle).space == "joint"
    with pytest.raises(BundleError, match="another arm"):
        DeepProMPPlanner.from_bundle(joint_bundle, arm=load_arm("ur5"))


def test_start_of_another_arm_is_refused():
    planner = ProMPDepthPlanner.from_bundle(arm=load_arm("ur5"))
    with pytest.raises(PlanningError, match="6 joint angles"):
        planner.plan(FRAME, Target(np.array([3.0, 4.0, 20.0, 30.0]), np.array(POINTS[0])), HOME)
