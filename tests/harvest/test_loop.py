"""The loop on a real simulated plant, and with one part made to fail at a time."""

from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import BundleError, ConfigurationError, PlanningError
from punnet.harvest.attempts import Outcome, Phase
from punnet.harvest.config import HarvestConfig
from punnet.harvest.deciding import Order, Plan
from punnet.harvest.order import DEFAULT_ORDER, order_of
from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.seeing import Look, Perceive, Weigh
from punnet.movement import JointTrajectory
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.robot import CutResult, GripResult, MotionResult
from punnet.sim.cluster import ClusterConfig
from punnet.sim.ripeness import RipenessStage
from punnet.sim.world import WorldConfig

PLANT = ClusterConfig(
    trusses=(2, 2),
    berries=(1, 2),
    stage_shares={RipenessStage.RIPE: 0.7, RipenessStage.GREEN: 0.3},
    canopy_leaves=(2, 2),
    hanging_leaves=(0, 0),
)

THREE_RIPE = 5  # the seed of a plant of three ripe berries


def a_session(seed=6, perception="oracle", **harvest):
    world = WorldConfig(cluster=PLANT, arm_visuals=False)
    return Session(Scenario(seed, perception, world, HarvestConfig(**harvest)))


@pytest.fixture(scope="module", params=["oracle", *sorted({"colour", SIMULATION_DETECTOR})])
def harvested(request):
    with a_session(perception=request.param) as session:
        yield session, session.run()


def test_every_ripe_berry_ends_in_a_punnet_and_no_other(harvested):
    session, _ = harvested
    fates = session.fates()
    assert sum(fate.pluckable for fate in fates) >= 1
    assert all(fate.success for fate in fates if fate.pluckable)
    assert not any(fate.wrongly_picked for fate in fates)
    assert not any(fate.damaged for fate in fates if fate.detached)


def test_the_run_tells_what_the_world_knows(harvested):
    session, run = harvested
    assert len(run.picked) == sum(fate.punnet is not None for fate in session.fates())
    assert sum(run.punnet_weights) == pytest.approx(
        sum(fate.mass for fate in session.fates() if fate.punnet is not None), abs=1.0
    )
    for attempt in run.picked:
        assert attempt.weighed == pytest.approx(session.truth_of[attempt.number], abs=1.0)
        assert attempt.phase is Phase.VERIFY
        assert attempt.punnet == attempt.meant_for
        assert attempt.seconds_simulated > 3.0
        assert attempt.distribution is not None


def test_weights_by_eye_are_near_the_truth(harvested):
    session, run = harvested
    errors = [abs(a.estimate - session.truth_of[a.number]) / session.truth_of[a.number] for a in run.picked]
    assert np.mean(errors) < 0.25


@pytest.mark.parametrize(
    ("name", "result", "phase", "reason"),
    [
        ("grip", GripResult(False, 0.0, "nothing between the pads"), Phase.GRIP, "nothing between"),
        ("cut", CutResult(False, "blade 12 mm from the stem"), Phase.CUT, "12 mm"),
    ],
)
def test_a_step_that_fails_is_named_and_tried_again_then_left(name, result, phase, reason):
    with a_session(attempts=2) as session:
        ripe = sum(fate.pluckable for fate in session.fates())
        setattr(session.robot, name, lambda: result)
        run = session.run()
        assert len(run.attempts) == 2 * ripe
        assert {attempt.phase for attempt in run.attempts} == {phase}
        assert all(reason in attempt.reason for attempt in run.attempts)
        assert session.world.attached().all()


def test_a_berry_lost_on_the_way_is_not_in_the_punnet():
    with a_session(attempts=1) as session:
        session.robot.weigh_punnet = lambda punnet: 0.2
        run = session.run()
        assert run.attempts
        assert not run.picked
        assert all("lost" in attempt.reason for attempt in run.attempts)
        assert run.punnet_weights == [0.2, 0.0]
        assert run.punnets_full == [False, False]


def test_full_punnets_take_no_more():
    with a_session(seed=THREE_RIPE, attempts=1, punnet_berries=1) as session:
        run = session.run()
        assert [attempt.punnet for attempt in run.picked] == [0, 1]
        assert run.punnets_full == [True, True]
        left = run.attempts[2:]
        assert left
        assert all(a.outcome is Outcome.SKIPPED and "all punnets are full" in a.reason for a in left)


def test_a_berry_that_does_not_fit_waits_for_one_that_does():
    with a_session(seed=THREE_RIPE, nominal_punnet=60.0, attempts=2) as session:
        parts, situation = session.harvester._parts, session.harvester._situation
        for step in (Look(parts), Perceive(parts), Weigh(parts)):
            step.do(situation)
        frame, berries = situation.seen
        first, second = order_of(DEFAULT_ORDER)(frame, berries)[:2]
        grams = np.full(len(berries), 40.0)
        grams[second] = 12.0
        situation.berries = berries.with_fields(
            weights=grams, weight_intervals=grams[:, None] * np.array([0.95, 1.05])
        )
        for punnet in (0, 1):
            parts.packer.observe(punnet, 50.0)
        order = Order(parts)
        assert order.do(situation) is Phase.PLAN
        assert (situation.in_hand.row, situation.in_hand.meant_for) == (second, 0)
        situation.memory.learn(situation.in_hand)
        situation.memory.learn(situation.in_hand)
        order.do(situation)
        assert (situation.in_hand.row, situation.in_hand.meant_for) == (
            first,
            0,
        )  # none fits: the best of them


def test_a_berry_out_of_reach_is_skipped_with_the_reason():
    with a_session() as session:
        with_planner(session, Refusing())
        run = session.run()
        assert run.attempts
        assert all(a.outcome is Outcome.SKIPPED and "out of reach" in a.reason for a in run.attempts)


def with_planner(session, planner):
    harvester = session.harvester
    harvester._parts = replace(harvester._parts, planner=planner)
    harvester._steps[Phase.PLAN] = Plan(harvester._parts)


class Refusing:
    name = "refusing"

    def plan(self, frame, target, start):
        raise PlanningError("out of reach: no posture brings the tool there")


def test_an_arm_that_is_held_up_ends_the_run_safely():
    with a_session() as session:
        follow = session.robot.follow

        def held_up(trajectory: JointTrajectory, force_limit: float | None = None) -> MotionResult:
            if session.robot.time > 4.0:
                return MotionResult(False, "arm held up")
            return follow(trajectory, force_limit)

        session.robot.follow = held_up
        run = session.run()
        assert "held up" in run.stopped
        assert run.attempts[-1].outcome is Outcome.FAILED


def test_an_interrupt_keeps_what_was_done():
    with a_session() as session:
        looks = []
        look = session.robot.look

        def interrupted():
            looks.append(1)
            if len(looks) == 3:  # the second is on the way
                raise KeyboardInterrupt
            return look()

        session.robot.look = interrupted
        run = session.run()
        assert run.interrupted
        assert len(run.picked) == 1
        assert run.punnet_weights[0] > 3.0


def test_without_ripe_berries_nothing_is_touched():
    green = ClusterConfig(
        trusses=(1, 1), berries=(2, 2), stage_shares={RipenessStage.GREEN: 1.0}, canopy_leaves=(0, 0)
    )
    with Session(Scenario(1, "oracle", WorldConfig(cluster=green, arm_visuals=False))) as session:
        run = session.run()
        assert run.attempts == []
        assert session.world.attached().all()


@pytest.mark.parametrize(
    "bad",
    [
        {"speed": 0.0},
        {"careful_speed": 1.5},
        {"attempts": 0},
        {"side_views": 4},
        {"least_ripeness": 2.0},
        {"opening": 0.0},
    ],
)
def test_impossible_settings_are_refused(bad):
    with pytest.raises(ConfigurationError, match="harvest"):
        HarvestConfig(**bad)


def test_impossible_scenarios_are_refused():
    with pytest.raises(ConfigurationError, match="seed"):
        Scenario(-1)
    with pytest.raises(BundleError, match="eyes closed"):
        Session(Scenario(1, "eyes closed"))
