from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from punnet.bundle import write_bundle
from punnet.errors import BundleError, ConfigurationError, FileFormatError, PlanningError
from punnet.movement import GaussianBasis, TrajectoryDistribution
from punnet.planning import Planner, ProMPDepthPlanner
from punnet.robot import HOME, Panda
from punnet.scene import Frame, Target

WORKSPACE = np.array([[0.70, -0.22, 0.58], [0.80, 0.18, 0.86]])
PHASES = np.linspace(0.0, 1.0, 301)
NOTHING = Frame(rgb=np.zeros((1, 1, 3), dtype=np.uint8))
BOX = np.array([0.0, 0.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def planner() -> ProMPDepthPlanner:
    return ProMPDepthPlanner.from_bundle()


def line_in(planner: ProMPDepthPlanner, plan: TrajectoryDistribution) -> tuple[NDArray[np.float64], ...]:
    """How far the mean's tool is along its final z axis and beside it, relative to where it ends."""
    poses = planner.arm.forward_kinematics_tool(plan.mean(PHASES))
    offsets = poses[:, :3, 3] - poses[-1, :3, 3]
    along = offsets @ poses[-1, :3, 2]
    return along, np.linalg.norm(offsets - along[:, None] * poses[-1, :3, 2], axis=1)


@pytest.mark.parametrize("start_std", [0.0, 0.1])
def test_reaches_berries_of_the_workspace_straight_and_exactly(
    planner: ProMPDepthPlanner, start_std: float
) -> None:
    """At least 99% of 200 berries planned; each plan exact, straight, inside the limits, from the start."""
    rng, refused = np.random.default_rng(7), []
    for point in rng.uniform(WORKSPACE[0], WORKSPACE[1], (200 if start_std == 0.0 else 50, 3)):
        start = HOME + rng.normal(0.0, 1.0, 7) * start_std
        try:
            plan = planner.plan(NOTHING, Target(BOX, picking_point=point), start)
        except PlanningError as error:
            refused.append(str(error))
            continue
        ends = plan.mean([0.0, 1.0])
        np.testing.assert_allclose(ends[0], start, atol=1e-7)
        assert np.linalg.norm(planner.arm.forward_kinematics_tool(ends[1])[:3, 3] - point) < 5e-4
        along, aside = line_in(planner, plan)
        assert aside[(along >= -0.07) & (PHASES >= 0.7)].max() < 0.004
        # Before the approach the tool stays behind it: it does not swing through the plant.
        assert along[PHASES < 0.69].max() < -0.075
        assert planner.arm.within_limits(plan.mean(PHASES)).all()
    assert len(refused) <= (2 if start_std == 0.0 else 0), refused


def test_variance_is_left_on_the_way_and_none_at_the_berry(planner: ProMPDepthPlanner) -> None:
    target = Target(BOX, picking_point=np.array([0.75, 0.0, 0.7]))
    plan = planner.plan(NOTHING, target, HOME)
    std = plan.std([0.0, 0.35, 0.7, 1.0])
    assert (std[[0, 2, 3]] < 1e-6).all()
    assert (std[1] > 0.005).all()
    samples = plan.sample(np.random.default_rng(0), 20, PHASES)
    tips = planner.arm.forward_kinematics_tool(samples[:, -1])[:, :3, 3]
    np.testing.assert_allclose(tips, np.tile(target.picking_point, (20, 1)), atol=1e-4)  # type: ignore[arg-type]


def test_an_asked_approach_is_kept(planner: ProMPDepthPlanner) -> None:
    direction = np.array([np.cos(0.3), np.sin(0.3), -0.1])
    direction /= np.linalg.norm(direction)
    target = Target(BOX, picking_point=np.array([0.74, 0.08, 0.7]), approach=direction)
    plan = planner.plan(NOTHING, target, HOME)
    tool = planner.arm.forward_kinematics_tool(plan.mean([1.0])[0])
    np.testing.assert_allclose(tool[:3, 2], direction, atol=1e-6)
    assert tool[2, 0] > 0.9  # its x axis is still up


def test_same_input_same_plan(planner: ProMPDepthPlanner) -> None:
    target = Target(BOX, picking_point=np.array([0.72, -0.1, 0.65]))
    first, second = (planner.plan(NOTHING, target, HOME) for _ in range(2))
    np.testing.assert_array_equal(first.weight_mean, second.weight_mean)


@pytest.mark.parametrize(
    ("target", "start", "reason"),
    [
        (Target(BOX, berry_id=4), HOME, "no depth: berry 4"),
        (
            Target(BOX, picking_point=np.array([1.6, 0.0, 0.7]), berry_id=2),
            HOME,
            r"out of reach: .*berry 2 at \(1.600",
        ),
        (Target(BOX, picking_point=np.array([0.75, 0.0, 0.7])), HOME[:6], "start: 7 joint angles"),
        (
            Target(BOX, picking_point=np.array([0.75, 0.0, 0.7]), approach=np.array([0.0, 0.0, -1.0])),
            HOME,
            "approach of berry 0",
        ),
    ],
)
def test_refusals_say_why(
    planner: ProMPDepthPlanner, target: Target, start: NDArray[np.float64], reason: str
) -> None:
    with pytest.raises(PlanningError, match=reason):
        planner.plan(NOTHING, target, start)


def test_is_a_planner_and_checks_its_distribution(planner: ProMPDepthPlanner) -> None:
    assert isinstance(planner, Planner)
    task = TrajectoryDistribution(GaussianBasis(), np.zeros((6, 8)), np.eye(48), space="task")
    with pytest.raises(ConfigurationError, match="7 joints"):
        ProMPDepthPlanner(task, Panda())


def test_bundles_of_another_kind_or_content_are_refused(tmp_path: Path) -> None:
    details = {"name": "x", "licence": "none", "command": "none"}
    write_bundle(tmp_path / "net", kind="detector", files={}, **details)  # type: ignore[arg-type]
    with pytest.raises(BundleError, match="of kind 'detector'; 'promp' is needed"):
        ProMPDepthPlanner.from_bundle(tmp_path / "net")
    write_bundle(tmp_path / "odd", kind="promp", files={"promp.json": {}}, **details)  # type: ignore[arg-type]
    with pytest.raises(FileFormatError, match="schema"):
        ProMPDepthPlanner.from_bundle(tmp_path / "odd")
