"""Faults put into a running harvest: each ends in a recovery or in a safe stop, with the reason in the journal."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from punnet.errors import KinematicsError, OutputError, PlanningError, RobotError
from punnet.harvest.attempts import Outcome, Phase
from punnet.harvest.eyes import Eyes
from punnet.harvest.failures import Failure, Recovery
from punnet.harvest.loop import Harvester
from punnet.harvest.scenario import Scenario, Session
from punnet.robot import HOME, NOTHING_HELD, TOO_THICK, CutResult, GripResult, MotionResult
from punnet.sim.world import WorldConfig
from tests.harvest.kinematic import ARM, KinematicRobot, a_harvester


class Listing:
    """A journal that remembers what it was told."""

    def __init__(self):
        self.failures = []
        self.ended = []

    def begin(self, attempt): ...

    def end(self, attempt):
        self.ended.append(attempt.number)

    def failed(self, phase, failure, reason, recovery):
        self.failures.append((phase, failure, recovery))


@pytest.fixture(scope="module")
def two_berries():
    """One look at a simulated plant, and two ripe berries in it."""
    with Session(Scenario(6, "oracle", WorldConfig(arm_visuals=False))) as session:
        frame = session.robot.look()
        berries = session.harvester._parts.eyes._detector.detect(frame)
        points = berries.picking_points[berries.pluckable]
        rows = np.flatnonzero(berries.pluckable)[np.argsort(points[:, 1])[[0, -1]]]
        return frame, berries[rows]


@dataclass
class Running:
    """A harvest about to begin."""

    robot: KinematicRobot
    harvester: Harvester

    def run(self):
        return self.harvester.run()


@pytest.fixture
def session(two_berries):
    robot = KinematicRobot(*two_berries)
    harvester = a_harvester(robot)
    harvester.journal = Listing()
    return Running(robot, harvester)


def exchanged(session, **parts):
    """Other parts than the harvester was built with."""
    harvester = session.harvester
    harvester._parts = replace(harvester._parts, **parts)
    for phase, step in harvester._steps.items():
        harvester._steps[phase] = type(step)(harvester._parts)


def failing(part, method, number, fault):
    """From call ``number`` on, counted from 1, ``fault`` says what the method does: an error to raise, or a function."""
    original = getattr(part, method)
    calls = []

    def call(*arguments, **options):
        calls.append(1)
        if number(len(calls)):
            if isinstance(fault, BaseException):
                raise fault
            return fault(original, *arguments, **options)
        return original(*arguments, **options)

    setattr(part, method, call)


def once(count):
    """The third look, from home; the second is on the way to the first berry."""
    return count == 3


def on_the_way(count):
    return count == 2


def always(count):
    return count >= 2


def is_safely_home(session):
    return np.abs(session.robot.joints() - HOME).max() < 1e-3 and session.robot.held is None


class Camera:
    """Faults of frames, all of the last good one."""

    def __init__(self):
        self.good = None

    def late(self, look):
        frame = look()
        return replace(frame, timestamp=frame.timestamp - 2.0)

    def frozen(self, look):
        look()
        return self.good

    def torn(self, look):
        frame = look()
        rgb, depth = frame.rgb.copy(), frame.depth.copy()
        rgb[240:], depth[240:] = self.good.rgb[240:], self.good.depth[240:]
        return replace(frame, rgb=rgb, depth=depth)

    def without_depth(self, look):
        frame = look()
        return replace(frame, depth=np.zeros_like(frame.depth))


CAMERA_FAULTS = [
    ("missing", Failure.NO_FRAME),
    ("late", Failure.LATE_FRAME),
    ("frozen", Failure.FROZEN_FRAME),
    ("torn", Failure.TORN_FRAME),
    ("without_depth", Failure.NO_DEPTH),
]


def with_camera_fault(session, kind, when):
    camera, look, calls = Camera(), session.robot.look, []
    fault = None if kind == "missing" else getattr(camera, kind)

    def faulty():
        calls.append(1)
        if not when(len(calls)):
            camera.good = look()
            return camera.good
        if fault is None:
            raise TimeoutError("no frame within 5 s")
        return fault(look)

    session.robot.look = faulty


@pytest.mark.parametrize(("kind", "failure"), CAMERA_FAULTS)
def test_one_bad_frame_is_looked_over(session, kind, failure):
    with_camera_fault(session, kind, once)
    run = session.run()
    assert session.harvester.journal.failures == [(Phase.LOOK, failure, Recovery.LOOK_AGAIN)]
    assert len(run.picked) == 2
    assert run.stopped is None


@pytest.mark.parametrize(("kind", "failure"), CAMERA_FAULTS)
def test_a_bad_frame_on_the_way_is_done_without(session, kind, failure):
    told = []
    exchanged(session, tell=lambda line, attempt: told.append(line))
    with_camera_fault(session, kind, on_the_way)
    run = session.run()
    assert any(f"goes on without a look on the way: {failure.text}" in line for line in told)
    assert len(run.picked) == 2
    assert session.harvester.journal.failures == []


def moved(robot, by):
    """Before the second look, on the way, the berry that hangs nearest to the tool moves ``by`` metres to the left."""

    def look(original):
        points = robot.berries.picking_points.copy()
        nearest = np.argmin(np.linalg.norm(points - robot.tool(), axis=1))
        points[nearest, 1] += by
        robot.berries = robot.berries.with_fields(picking_points=points)
        return original()

    return look


def test_a_berry_that_moved_is_found_where_it_is_by_now(session):
    failing(session.robot, "look", on_the_way, moved(session.robot, 0.018))
    run = session.run()
    assert len(run.picked) == len(run.attempts) == 2  # the pads reach 12 mm
    assert run.attempts[0].shift == pytest.approx([0.0, 0.018, 0.0])
    assert not run.attempts[1].shift.any()


def unseen(robot):
    """At a look on the way the eyes find nothing where the berry should be, and find it again later."""

    def look(original):
        frame = original()
        robot.veiled = robot.time
        return frame

    return look


class BlinkingEyes:
    """Sees what hangs but for the look that the robot calls veiled."""

    name = "blinking"

    def __init__(self, robot):
        self._robot = robot

    def detect(self, frame):
        if frame.timestamp == getattr(self._robot, "veiled", None):
            return self._robot.berries[[]]
        return self._robot.berries[sorted(self._robot.hanging)]


def test_a_berry_that_is_not_seen_again_on_the_way_is_left_for_later(session):
    robot = session.robot
    exchanged(session, eyes=Eyes(session.harvester._parts.robot, BlinkingEyes(robot)))
    failing(robot, "look", on_the_way, unseen(robot))
    run = session.run()
    assert run.attempts[0].failure is Failure.NOT_CONFIRMED
    assert not run.attempts[0].confirmed
    assert len(run.picked) == 2
    assert session.harvester.journal.failures == [(Phase.REACH, Failure.NOT_CONFIRMED, Recovery.SECOND_VIEW)]


@pytest.mark.parametrize(("thick", "picked_first"), [(1, True), (2, False)])
def test_with_a_fruit_between_the_pads_it_grips_higher_once(session, thick, picked_first):
    robot, grip, heights = session.robot, session.robot.grip, []

    def gripping():
        heights.append(robot.tool()[2])
        return GripResult(False, 0.02, TOO_THICK) if len(heights) <= thick else grip()

    robot.grip = gripping
    run = session.run()
    assert heights[1] - heights[0] == pytest.approx(0.009, abs=1e-4)
    assert (run.attempts[0].outcome is Outcome.PICKED) == picked_first
    assert len(run.picked) == 2
    if not picked_first:
        assert run.attempts[0].failure is Failure.FRUIT_GRIPPED


def test_from_the_sides_it_finds_what_home_does_not_show(session):
    robot, look, looked_from = session.robot, session.robot.look, {}

    def looking():
        frame = look()
        looked_from[frame.timestamp] = robot.joints()
        return frame

    robot.look = looking

    class FromTheSide:
        name = "side"

        def detect(self, frame):
            at_home = np.abs(looked_from[frame.timestamp] - HOME).max() < 0.05
            return robot.berries[sorted(robot.hanging - ({1} if at_home else set()))]

    told = []
    exchanged(
        session,
        eyes=Eyes(session.harvester._parts.robot, FromTheSide()),
        tell=lambda line, attempt: told.append(line),
    )
    run = session.run()
    assert len(run.picked) == 2
    assert [attempt.second_view for attempt in run.attempts] == [False, True]
    assert (
        told.count("looks at the plant from another side") == 3
    )  # once for the berry, and two that find no more


def test_after_a_miss_the_fingers_go_in_wider(session):
    robot, openings, grips = session.robot, [], []
    release, grip = robot.release, robot.grip

    def noted(opening=1.0):
        openings.append(opening)
        release(opening)

    def missing():
        grips.append(openings[-1])
        return GripResult(False, 0.0, NOTHING_HELD) if len(grips) <= 3 else grip()

    robot.release, robot.grip = noted, missing
    run = session.run()
    assert len(run.picked) == 2
    usual = session.harvester.config.opening
    assert sorted(grips) == [usual] * 4 + [pytest.approx(1.6 * usual)]  # twice deeper at the first try


def test_carrying_is_broken_off_when_a_neighbour_is_dragged_along(session):
    robot, limited = session.robot, []
    follow = robot.follow

    def dragging(trajectory, force_limit=None):
        limited.extend([trajectory] if force_limit is not None else [])
        if force_limit is not None and len(limited) == 2:  # the reach is the first
            robot._joints = trajectory.positions[len(trajectory.positions) // 2]
            return MotionResult(False, "pushed a fruit: with 9.0 N")
        return follow(trajectory, force_limit)

    robot.follow = dragging
    run = session.run()
    first = run.attempts[0]
    assert (first.failure, first.carried) == (Failure.LOST, "pushed a fruit: with 9.0 N")
    assert run.stopped is None  # the arm is home, and goes on with the next
    assert len(run.picked) == 1


def test_a_berry_that_is_pressed_while_it_is_lowered_is_let_go_there(session):
    robot, limited = session.robot, []
    follow = robot.follow

    def pressing(trajectory, force_limit=None):
        limited.extend([force_limit] if force_limit is not None else [])
        if force_limit is not None and len(limited) == 3:  # after the reach, and the way to the punnet
            robot._joints = trajectory.positions[len(trajectory.positions) // 2]
            return MotionResult(False, "pushed a fruit: with 4.2 N")
        return follow(trajectory, force_limit)

    robot.follow = pressing
    run = session.run()
    assert run.attempts[0].carried is None
    assert len(run.picked) == 2
    assert limited[2] < limited[1]


@pytest.fixture
def pushed_ahead(session):
    """The first berry hangs 15 mm ahead of where it was seen, as if the tool had pushed it: how deep each grip was, metres."""
    robot, depths, begins = session.robot, [], []
    grip = robot.grip

    def farther():
        T = ARM.forward_kinematics_tool(robot.joints())
        begins.append(T)
        depths.append(float((T[:3, 3] - begins[0][:3, 3]) @ T[:3, 2]))
        if len(robot.hanging) < 2:
            return grip()
        if depths[-1] < 0.010:
            return GripResult(False, 0.0, NOTHING_HELD)
        distance = np.linalg.norm(robot.berries.picking_points - robot.tool(), axis=1)
        robot.held = int(np.argmin(distance))
        return GripResult(True, 0.002)

    robot.grip = farther
    return depths


def test_after_the_pads_met_they_grip_deeper(session, pushed_ahead):
    run = session.run()
    assert pushed_ahead[:2] == [0.0, pytest.approx(0.016, abs=1e-4)]
    assert [attempt.outcome for attempt in run.attempts] == [Outcome.PICKED] * 2


def test_a_stem_that_slips_from_the_pads_is_gripped_deeper_and_cut(session, pushed_ahead):
    robot, cut = session.robot, session.robot.cut
    grip, grips = robot.grip, []

    def at_the_tips():
        grips.append(grip())
        return GripResult(True, 0.002) if len(grips) == 1 else grips[-1]

    robot.grip = at_the_tips
    robot.cut = lambda: cut() if len(grips) > 1 else CutResult(False, "no stem between the pads")
    run = session.run()
    assert pushed_ahead[:3] == [0.0, 0.0, pytest.approx(0.016, abs=1e-4)]
    assert [attempt.outcome for attempt in run.attempts] == [Outcome.PICKED] * 2


def test_a_stem_that_is_held_and_not_cut_is_left(session):
    robot, cut, cuts = session.robot, session.robot.cut, []

    def too_high():
        cuts.append(robot.time)
        return CutResult(False, "blade at a wrong height: 34 mm") if len(cuts) == 1 else cut()

    robot.cut = too_high
    run = session.run()
    assert run.attempts[0].failure is Failure.NOT_CUT
    assert run.attempts[0].reason == "the stem was not cut: blade at a wrong height: 34 mm"


def test_they_do_not_where_another_stem_was_seen_ahead(session, pushed_ahead):
    robot = session.robot
    points = robot.berries.picking_points.copy()
    points[1] = points[0] + (0.03, 0.0, 0.0)
    robot.berries = robot.berries.with_fields(picking_points=points)
    run = session.run()
    assert run.attempts[0].failure is Failure.NOT_GRIPPED
    assert pushed_ahead[0] == 0.0


@pytest.mark.parametrize(
    ("ripeness", "score", "left"),
    [(0.7, 1.0, {1}), (0.85, 0.6, {1}), (0.85, 0.7, set())],
    ids=["unripe", "nearly ripe and unsure", "nearly ripe and sure"],
)
def test_what_is_not_ripe_enough_is_left(session, ripeness, score, left):
    robot = session.robot
    robot.berries = robot.berries.with_fields(
        ripeness=np.array([0.95, ripeness]), scores=np.array([0.7, score])
    )
    exchanged(session, config=replace(session.harvester.config, least_ripeness=0.9))
    run = session.run()
    assert len(run.picked) == 2 - len(left)
    assert robot.hanging == left


def test_what_two_looks_differ_by_noise_moves_nothing(session):
    failing(session.robot, "look", on_the_way, moved(session.robot, 0.004))
    assert not session.run().attempts[0].shift.any()


def test_without_the_look_on_the_way_a_berry_that_moved_is_missed_at_first(session):
    harvester = session.harvester
    exchanged(session, config=replace(harvester.config, look_on_the_way=0.0))
    harvester._parts.motions._config = harvester._parts.config
    failing(session.robot, "follow", lambda count: count == 1, shaken(session.robot))
    run = session.run()
    assert run.attempts[0].failure is Failure.NOT_GRIPPED
    assert len(run.picked) == 2


def shaken(robot):
    def follow(original, trajectory, force_limit=None):
        robot.berries = robot.berries.with_fields(
            picking_points=robot.berries.picking_points + np.array([0.0, 0.018, 0.0])
        )
        return original(trajectory, force_limit)

    return follow


@pytest.mark.parametrize(("kind", "failure"), CAMERA_FAULTS)
def test_a_camera_that_stays_bad_stops_the_harvest(session, kind, failure):
    with_camera_fault(session, kind, always)
    run = session.run()
    recoveries = [recovery for _, _, recovery in session.harvester.journal.failures]
    assert recoveries == [Recovery.LOOK_AGAIN, Recovery.LOOK_AGAIN, Recovery.STOP]
    assert failure.text in run.stopped
    assert len(run.picked) == 1
    assert run.home
    assert is_safely_home(session)


@pytest.mark.parametrize("failure", [Failure.DETECTOR_FAULT, Failure.SCALE_FAULT])
def test_a_detector_or_a_scale_that_raises(session, failure):
    parts, error = session.harvester._parts, RuntimeError("out of memory")
    if failure is Failure.DETECTOR_FAULT:
        failing(parts.eyes._detector, "detect", once, error)
    else:
        failing(parts.scale, "estimate", lambda count: count == 2, error)
    run = session.run()
    ((_, named, recovery),) = session.harvester.journal.failures
    assert (named, recovery) == (failure, Recovery.LOOK_AGAIN)
    assert len(run.picked) == 2


def test_a_detector_that_keeps_raising_stops_the_harvest(session):
    failing(
        session.harvester._parts.eyes._detector,
        "detect",
        lambda count: True,
        RuntimeError("weights are gone"),
    )
    run = session.run()
    assert "the detector failed: RuntimeError: weights are gone" in run.stopped
    assert is_safely_home(session)


class NaNPlan:
    """A distribution whose mean is not finite."""

    def mean(self, phases):
        return np.full((len(phases), 7), np.nan)


@pytest.mark.parametrize(
    ("fault", "failure"),
    [
        (lambda plan, *arguments: NaNPlan(), Failure.PLAN_NOT_FINITE),
        (PlanningError("out of reach: no posture of the arm"), Failure.OUT_OF_REACH),
        (PlanningError("no straight approach: berry 1"), Failure.NO_APPROACH),
        (KinematicsError("no inverse kinematics"), Failure.PLANNER_FAULT),
        (ZeroDivisionError("division by zero"), Failure.PLANNER_FAULT),
    ],
    ids=["nan", "reach", "approach", "kinematics", "anything"],
)
def test_a_planner_that_fails_costs_that_berry_at_most(session, fault, failure):
    failing(session.harvester._parts.planner, "plan", lambda count: count == 1, fault)
    run = session.run()
    assert session.harvester.journal.failures[0][:2] == (Phase.PLAN, failure)
    assert run.attempts[0].outcome is Outcome.SKIPPED
    assert len(run.picked) == (1 if failure.recovery is Recovery.SET_ASIDE else 2)
    assert run.stopped is None


def test_a_plan_beyond_the_joint_limits_is_not_begun(session):
    plan = session.harvester._parts.planner.plan

    class Shifted:
        def __init__(self, distribution):
            self._distribution = distribution

        def mean(self, phases):
            mean = self._distribution.mean(phases).copy()
            mean[:, 3] += np.linspace(0.0, 3.0, len(mean))
            return mean

    session.harvester._parts.planner.plan = lambda *arguments: Shifted(plan(*arguments))
    session.harvester.journal.end = lambda attempt: None
    run = session.run()
    assert run.attempts
    assert {attempt.failure for attempt in run.attempts} == {Failure.NO_KINEMATICS}
    assert {attempt.phase for attempt in run.attempts} == {Phase.CHECK}
    assert len(session.robot.hanging) == 2


def test_no_inverse_kinematics_over_the_punnet(session):
    failing(
        session.harvester._parts.motions, "carry", lambda count: count == 1, KinematicsError("no solution")
    )
    run = session.run()
    assert session.harvester.journal.failures[0][:2] == (Phase.PLACE, Failure.NO_KINEMATICS)
    assert "no solution" in run.attempts[0].reason
    assert len(run.picked) == 1
    assert run.stopped is None
    assert is_safely_home(session)


def stalled(follow, trajectory, force_limit=None):
    return MotionResult(False, "arm held up: it does not follow its trajectory")


def test_an_arm_that_stalls_once_is_backed_out(session):
    # The first motion of the pick; the way home works again.
    failing(session.robot, "follow", lambda count: count == 1, stalled)
    run = session.run()
    assert session.harvester.journal.failures[0] == (Phase.REACH, Failure.HELD_UP, Recovery.OTHER_SIDE)
    assert len(run.picked) == 2
    assert is_safely_home(session)


def test_an_arm_that_stalls_for_good_is_left_where_it_is(session):
    failing(session.robot, "follow", always, stalled)
    run = session.run()
    assert run.stopped.startswith("the arm does not get home: arm held up")
    assert not run.home
    assert session.harvester.journal.failures == [
        (Phase.REACH, Failure.HELD_UP, Recovery.OTHER_SIDE),
        (Phase.REACH, Failure.NOT_HOME, Recovery.STOP),
    ]


def test_a_robot_whose_driver_fails_stops_the_harvest(session):
    failing(session.robot, "grip", lambda count: count == 1, RobotError("gripper: no answer"))
    run = session.run()
    assert run.stopped == "the robot failed: gripper: no answer"
    assert run.attempts[0].failure is Failure.ROBOT_FAULT
    assert is_safely_home(session)


def punnet_gone(number, after):
    """Punnet ``number`` is taken away, with what is in it, once ``after`` weighings were made."""

    def weigh(original, punnet):
        return -35.0 if punnet == number else original(punnet)

    return lambda count: count >= after, weigh


def test_a_punnet_that_is_gone_is_noticed_before_the_berry_is_dropped(session):
    failing(session.robot, "weigh_punnet", *punnet_gone(0, 1))
    run = session.run()
    assert [attempt.punnet for attempt in run.picked] == [1, 1]
    assert run.punnet_weights[0] == 0.0
    assert run.stopped is None


def test_a_punnet_taken_with_the_berry_in_it(session):
    failing(session.robot, "weigh_punnet", *punnet_gone(0, 2))
    run = session.run()
    assert session.harvester.journal.failures[0][:2] == (Phase.VERIFY, Failure.PUNNET_MISSING)
    assert run.attempts[0].outcome is Outcome.FAILED
    assert [attempt.punnet for attempt in run.picked] == [1]


def test_without_any_punnet_nothing_more_is_picked(session):
    failing(session.robot, "weigh_punnet", lambda count: True, lambda original, punnet: -35.0)
    run = session.run()
    assert run.picked == []
    assert run.attempts[0].failure is Failure.PUNNET_MISSING
    assert {attempt.failure for attempt in run.attempts[1:]} == {Failure.PUNNETS_FULL}
    assert is_safely_home(session)


def test_a_weigh_cell_that_reads_nonsense_stops_the_harvest(session):
    failing(session.robot, "weigh_punnet", lambda count: count >= 2, lambda original, punnet: float("nan"))
    run = session.run()
    assert "the weigh cell reads nonsense: punnet 1 reads nan g" in run.stopped
    assert is_safely_home(session)


def test_without_weigh_cells_the_drop_is_believed(session):
    failing(session.robot, "weigh_punnet", lambda count: True, lambda original, punnet: None)
    run = session.run()
    assert len(run.picked) == 2
    assert np.isnan([attempt.weighed for attempt in run.picked]).all()
    assert run.punnet_weights[0] == pytest.approx(sum(a.estimate for a in run.picked), rel=0.2)


def test_a_log_that_is_full_stops_the_harvest(session):
    failing(session.harvester.journal, "end", lambda count: True, OutputError("log: No space left on device"))
    run = session.run()
    assert run.stopped == "log: No space left on device"
    assert len(run.attempts) == 1
    assert is_safely_home(session)


def test_a_log_that_can_not_be_begun_moves_nothing(session):
    failing(
        session.harvester.journal, "begin", lambda count: True, OutputError("log: No space left on device")
    )
    followed = []
    failing(session.robot, "follow", lambda count: True, lambda follow, *a: followed.append(1) or follow(*a))
    run = session.run()
    assert "No space left" in run.stopped
    assert followed == []
