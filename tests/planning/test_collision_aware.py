import numpy as np
import pytest

from punnet.errors import ConfigurationError, PlanningError
from punnet.movement import TrajectoryDistribution
from punnet.planning import Planner, ProMPDepthPlanner
from punnet.planning.approach import angles_of_approach, comfortable_angles
from punnet.planning.capsules import Capsules
from punnet.planning.collision_aware import CollisionAwarePlanner
from punnet.planning.collision_cost import CHECKED_PHASES, collision_costs
from punnet.planning.observed_scene import ObservedScene
from punnet.planning.straight_candidates import spread_offsets
from punnet.robot import HOME, Panda
from punnet.scene import Frame, Strawberries, Target
from tests.timing import times_as_long

POINT = np.array([0.75, -0.06, 0.70])
FRAME = Frame(np.zeros((480, 640, 3), np.uint8))
PHASES = np.linspace(0.0, 1.0, 101)
ARM = Panda()


@pytest.fixture(scope="module")
def planner():
    return CollisionAwarePlanner(ProMPDepthPlanner.from_bundle())


def target(*neighbours, approach=None):
    """A berry at POINT and others whose picking points are offset from it."""
    points = np.array([POINT, *(POINT + np.array(offset) for offset in neighbours)])
    boxes = np.tile([300.0, 200.0, 320.0, 230.0], (len(points), 1))
    among = Strawberries((480, 640), boxes, picking_points=points)
    return Target(boxes[0], POINT, approach, berry_id=0, among=among)


def tool_of(distribution):
    return ARM.forward_kinematics_tool(distribution.mean(PHASES))


def scene(fruit=(), stems=()):
    def upright(places, length, radius):
        tops = np.array(places, dtype=np.float64).reshape(-1, 3)
        return Capsules(tops, tops - (0.0, 0.0, length), np.full(len(tops), radius))

    return ObservedScene(
        POINT,
        upright(fruit, 0.02, 0.014),
        upright(stems, -0.1, 0.0015),
        np.ones(len(fruit)),
        *[np.zeros((0, 3))] * 2,
    )


def test_it_is_a_planner_named_after_both(planner):
    assert isinstance(planner, Planner)
    assert planner.name == "promp-depth + collision-aware"


def test_alone_it_comes_in_as_planned(planner):
    ours, planned = (p.plan(FRAME, target(), HOME) for p in (planner, planner.planner))
    np.testing.assert_allclose(ours.mean([1.0]), planned.mean([1.0]), atol=1e-6)


@pytest.mark.parametrize(
    "neighbours", [(), ((-0.04, 0.02, 0.0),), ((-0.05, -0.025, 0.03), (-0.02, 0.04, -0.01))]
)
def test_every_reach_starts_at_the_arm_and_ends_straight_at_the_stem(planner, neighbours):
    start = HOME + 0.02
    reach = planner.plan(FRAME, target(*neighbours), start)
    np.testing.assert_allclose(reach.mean([0.0])[0], start, atol=1e-6)
    tool = tool_of(reach)
    np.testing.assert_allclose(tool[-1, :3, 3], POINT, atol=1e-6)
    offset = tool[:, :3, 3] - POINT
    along = offset @ tool[-1, :3, 2]
    last = (PHASES >= 0.7) & (along >= -0.07)
    aside = np.linalg.norm(offset - along[:, None] * tool[-1, :3, 2], axis=1)
    assert aside[last].max() <= 0.0045
    assert ARM.within_limits(reach.mean(PHASES)).all()
    # what is left of the distribution keeps to the line as well
    assert reach.std([1.0]).max() < 1e-4
    # and it says so: its via-points lie on it, none of those of the planned line is left
    assert [via.phase for via in reach.via_points] == [0.0, 0.7, 0.8, 0.9, 1.0]
    for via in reach.via_points:
        np.testing.assert_allclose(reach.mean([via.phase])[0], via.values, atol=1e-5)


def test_it_keeps_a_neighbours_stem_out_of_the_fingers(planner):
    # hangs lower and nearer, a little to the left: its stem is in the way of a straight approach
    comfortable = float(comfortable_angles(POINT)[0])
    forward = np.array([np.cos(comfortable), np.sin(comfortable), 0.0])
    left = np.array([-forward[1], forward[0], 0.0])
    around = target(-0.05 * forward + 0.008 * left - (0.0, 0.0, 0.05))
    ours, planned = (tool_of(p.plan(FRAME, around, HOME))[-1] for p in (planner, planner.planner))
    stem = around.among.picking_points[1, :2]

    def passed_at(tool):
        offset, heading = stem - POINT[:2], tool[:2, 2] / np.linalg.norm(tool[:2, 2])
        return abs(offset[0] * heading[1] - offset[1] * heading[0])

    assert passed_at(planned) < 0.012
    assert passed_at(ours) > 0.017


def test_the_chosen_one_costs_no_more_than_the_planned_one(planner):
    around = target((-0.04, 0.02, 0.0), (-0.06, -0.03, -0.03), (0.0, 0.03, 0.01))
    planned = planner.planner.plan(FRAME, around, HOME)
    from punnet.planning.observed_scene import observe

    candidates = planner.candidates(planned, around, HOME)
    costs = planner.costs(candidates, observe(FRAME, around), planned)
    best = int(np.argmin(costs))
    assert costs[best] < costs[0]
    chosen = planner.plan(FRAME, around, HOME)
    np.testing.assert_allclose(chosen.mean(PHASES), candidates.trajectories(PHASES)[best], atol=1e-9)


def test_an_approach_that_is_asked_for_is_kept_nearly(planner):
    yaw, _ = comfortable_angles(POINT)
    asked = np.array([np.cos(yaw + 0.3), np.sin(yaw + 0.3), 0.0])
    reach = planner.plan(FRAME, target((-0.04, 0.02, 0.0), approach=asked), HOME)
    got = angles_of_approach(tool_of(reach)[-1, :3, 2])
    assert abs(got[0] - (yaw + 0.3)) < np.deg2rad(9)


def test_the_same_target_gives_the_same_reach(planner):
    around = target((-0.04, 0.02, 0.0))
    one, two = (planner.plan(FRAME, around, HOME).mean(PHASES) for _ in range(2))
    np.testing.assert_array_equal(one, two)


class Fixed:
    name = "fixed"

    def __init__(self, distribution):
        self.distribution = distribution

    def plan(self, frame, target, start):
        if isinstance(self.distribution, Exception):
            raise self.distribution
        return self.distribution


def test_what_cannot_be_chosen_among_is_handed_on_or_refused(planner):
    planned = planner.planner.plan(FRAME, target(), HOME)
    no_depth = Target(np.array([0.0, 0.0, 5.0, 5.0]))
    assert CollisionAwarePlanner(Fixed(planned)).plan(FRAME, no_depth, HOME) is planned
    far = Target(no_depth.box, np.array([2.0, 0.0, 0.7]))
    assert CollisionAwarePlanner(Fixed(planned)).plan(FRAME, far, HOME) is planned
    with pytest.raises(PlanningError, match="no depth"):
        CollisionAwarePlanner(Fixed(PlanningError("no depth"))).plan(FRAME, target(), HOME)
    poses = TrajectoryDistribution(planned.basis, np.zeros((6, 8)), np.eye(48), space="task")
    with pytest.raises(PlanningError, match="7 joints"):
        CollisionAwarePlanner(Fixed(poses)).plan(FRAME, target(), HOME)
    for settings in ({"draws": 0}, {"broadening": 0.0}):
        with pytest.raises(ConfigurationError):
            CollisionAwarePlanner(planner.planner, **settings)


def straight_poses(height=0.0, aside=0.0):
    """Flange poses (1, T, 4, 4) of a tool that comes in level along +x."""
    T = np.tile(np.eye(4), (1, len(CHECKED_PHASES), 1, 1))
    T[..., :3, :3] = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]
    T[..., :3, 3] = POINT + np.array([0.0, aside, height])
    T[..., 0, 3] -= 0.19 + 0.3 * (1.0 - CHECKED_PHASES)
    return T


def test_what_the_tool_meets_costs_and_what_it_passes_does_not():
    free = collision_costs(scene(fruit=[(-0.05, 0.15, 0.0)], stems=[(-0.05, 0.15, -0.05)]), straight_poses())
    assert free.total[0] == 0.0
    assert collision_costs(scene(fruit=[(-0.05, 0.022, 0.01)]), straight_poses()).fruit[0] > 1.0
    between = collision_costs(scene(stems=[(-0.04, 0.005, -0.05)]), straight_poses()).stems[0]
    beside = collision_costs(scene(stems=[(-0.04, 0.040, -0.05)]), straight_poses()).stems[0]
    assert between > 1.0 > beside
    # a fruit below the fingers is in nobody's way, its stem is
    assert collision_costs(scene(fruit=[(-0.10, 0.0, -0.08)]), straight_poses()).fruit[0] == 0.0
    assert collision_costs(scene(), straight_poses(height=-1.0)).hard[0] > 1.0


def test_a_stem_between_the_fingers_costs_more_than_one_that_they_brush(planner):
    planned = planner.planner.plan(FRAME, target(), HOME)
    poses = ARM.forward_kinematics(planned.mean(CHECKED_PHASES))[None]
    end = ARM.forward_kinematics_tool(planned.mean([1.0])[0])
    behind = end[:3, 3] - 0.04 * end[:3, 2] - (0.0, 0.0, 0.05) - POINT

    def cost(aside):
        return float(collision_costs(scene(stems=[behind + aside * end[:3, 1]]), poses).total[0])

    assert cost(0.0) > 4.0 * cost(0.021) > 0.0  # in the middle; beside a finger


def test_turns_fill_their_box():
    halves = np.array([0.6, 0.2, 0.1, 0.005])
    turns = spread_offsets(64, halves)
    assert not turns[0].any()
    assert (np.abs(turns) <= halves).all()
    for axis, half in enumerate(halves):
        counts, _ = np.histogram(turns[:, axis], bins=8, range=(-half, half))
        assert counts.min() >= 5


def test_sixty_four_reaches_are_judged_in_time(planner):
    around = target(*(np.random.default_rng(1).uniform(-0.1, 0.1, (10, 3))))
    planned = planner.planner.plan(FRAME, around, HOME)
    from punnet.planning.observed_scene import observe

    def judge():
        planner.costs(planner.candidates(planned, around, HOME), observe(FRAME, around), planned)

    arms = np.tile(HOME, (64, len(PHASES), 1))
    # Five to ten times as long as forward kinematics of as many arms; milliseconds are for benchmarks/collision_choice.py.
    assert times_as_long(judge, lambda: ARM.forward_kinematics(arms)) < 20


def test_where_a_neighbours_stem_is_caught_from_every_side_there_is_no_free_approach(planner):
    # low berries all around the front: whichever way the tool turns, a stem is between the fingers
    angles = np.deg2rad(np.arange(-60.0, 61.0, 10.0)) + float(comfortable_angles(POINT)[0])
    ring = [(-0.03 * np.cos(a), -0.03 * np.sin(a), -0.05) for a in angles]
    with pytest.raises(PlanningError, match="no free approach"):
        planner.plan(FRAME, target(*ring), HOME)
