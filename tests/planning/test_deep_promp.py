"""Planners that learned from photographs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.errors import BundleError, ConfigurationError, PlanningError
from punnet.geometry import make_transform
from punnet.planning import DeepProMPPlanner, FusedPlanner, Planner, ProMPDepthPlanner, planner_named
from punnet.planning.learned import planner_bundle
from punnet.robot import HOME, Panda
from punnet.scene import Frame, Target

ARM = Panda()


@pytest.fixture(scope="module")
def planner(reach_run: Path) -> DeepProMPPlanner:
    return DeepProMPPlanner.from_bundle(reach_run)


@pytest.fixture(scope="module")
def seen(reach_demonstrations) -> tuple[Frame, Target, np.ndarray]:
    """A photograph from home, the berry in it, and where the flange ended."""
    episode = reach_demonstrations[0]
    return episode.home.frame(), episode.target, episode.poses.end[:3]


def flange(joints: np.ndarray) -> np.ndarray:
    return ARM.forward_kinematics(joints)[:3, 3]


@pytest.mark.parametrize("model", ["", ":full-joint"])
def test_a_box_in_a_photograph_is_enough(reach_run: Path, model: str, seen) -> None:
    frame, target, end = seen
    source = f"{reach_run}{model}" if not model else f"{reach_run / 'bundle'}{model}"
    planner = DeepProMPPlanner.from_bundle(source)
    assert isinstance(planner, Planner)
    colours_only = Frame(rgb=frame.rgb)
    planned = planner.plan(colours_only, Target(box=target.box), HOME)
    assert planned.space == "joint"
    np.testing.assert_allclose(planned.mean([0.0])[0], HOME, atol=1e-6)
    assert np.linalg.norm(flange(planned.mean([1.0])[0]) - end) < 0.06
    assert np.linalg.eigvalsh(planned.weight_covariance).min() > -1e-10


def test_joints_follow_the_predicted_poses_and_are_as_unsure(planner: DeepProMPPlanner, seen) -> None:
    frame, target, _ = seen
    predicted, planned = planner.distribution(frame, target), planner.plan(frame, target, HOME)
    assert predicted.chart is not None
    phases = np.array([0.8, 0.9, 1.0])
    poses = predicted.chart.poses(predicted.mean(phases))
    np.testing.assert_allclose(
        ARM.forward_kinematics(planned.mean(phases))[:, :3, 3], poses[:, :3, 3], atol=2e-3
    )
    draws = planned.sample(np.random.default_rng(0), 400, [1.0])[:, 0]
    spread = ARM.forward_kinematics(draws)[:, :3, 3].std(axis=0)
    np.testing.assert_allclose(spread, predicted.std([1.0])[0, :3], rtol=0.35)


def test_fused_ends_at_the_point_that_depth_gave(planner: DeepProMPPlanner, seen) -> None:
    frame, target, _ = seen
    planned = FusedPlanner(planner).plan(frame, target, HOME)
    tool = ARM.forward_kinematics_tool(planned.mean([1.0])[0])[:3, 3]
    np.testing.assert_allclose(tool, target.picking_point, atol=1e-5)
    with pytest.raises(PlanningError, match="no depth"):
        FusedPlanner(planner).plan(frame, replace(target, picking_point=None), HOME)


def test_from_elsewhere_the_picking_point_stands_in_for_the_box(planner: DeepProMPPlanner, seen) -> None:
    frame, target, end = seen
    moved = make_transform(np.eye(3), np.array([0.1, 0.0, 0.0])) @ frame.T_base_camera
    elsewhere = Frame(rgb=frame.rgb, camera=frame.camera, T_base_camera=moved)
    nonsense = replace(target, box=np.array([0.0, 0.0, 9.0, 9.0]))
    planned = planner.plan(elsewhere, nonsense, HOME)
    assert np.linalg.norm(flange(planned.mean([1.0])[0]) - end) < 0.06
    with pytest.raises(PlanningError, match="not taken from where"):
        planner.plan(elsewhere, replace(nonsense, picking_point=None), HOME)
    behind = replace(nonsense, picking_point=np.array([-0.5, 0.0, 0.7]))
    with pytest.raises(PlanningError, match="behind"):
        planner.plan(elsewhere, behind, HOME)
    # What fused makes of it: the reaches of all demonstrations.
    tool = ARM.forward_kinematics_tool(FusedPlanner(planner).plan(elsewhere, nonsense, HOME).mean([1.0])[0])
    np.testing.assert_allclose(tool[:3, 3], target.picking_point, atol=1e-5)


@pytest.mark.parametrize("box", [[400, 10, 420, 30], [50, 50, 50, 90], [-30, -30, -5, -5], [90, 60, 40, 80]])
def test_a_box_without_pixels_is_said(planner: DeepProMPPlanner, seen, box) -> None:
    with pytest.raises(PlanningError, match="holds no pixel"):
        planner.plan(seen[0], Target(box=np.array(box, dtype=float)), HOME)


@pytest.mark.parametrize("shape", [(1, 1), (7, 900), (1080, 1920)])
def test_photographs_of_any_size(planner: DeepProMPPlanner, shape) -> None:
    height, width = shape
    frame = Frame(rgb=np.zeros((height, width, 3), dtype=np.uint8))
    middle = Target(box=np.array([0.0, 0.0, width, height]))
    planned = planner.distribution(frame, middle)
    np.testing.assert_allclose(
        planned.mean([1.0]),
        planner.distribution(
            Frame(rgb=np.zeros((64, 64, 3), dtype=np.uint8)), Target(box=np.array([0, 0, 64, 64.0]))
        ).mean([1.0]),
    )


@pytest.mark.parametrize("start", [[0.0] * 6, [np.nan] * 7])
def test_start_is_checked(planner: DeepProMPPlanner, seen, start) -> None:
    with pytest.raises(PlanningError, match="7 joint angles"):
        planner.plan(seen[0], seen[1], start)


def test_a_bundle_of_another_arm_is_refused(reach_run: Path) -> None:
    model, settings, _ = planner_bundle(reach_run)
    fewer = replace(
        settings.demonstrated,
        weight_mean=settings.demonstrated.weight_mean[:6],
        weight_covariance=settings.demonstrated.weight_covariance[:48, :48],
        names=settings.demonstrated.names[:6],
        observation_std=np.zeros(6),
    )
    with pytest.raises(BundleError, match="6 joints, this one has 7"):
        DeepProMPPlanner(model, fewer)


def test_models_of_a_bundle_by_name(reach_run: Path) -> None:
    model, settings, manifest = planner_bundle(reach_run / "bundle")
    assert (model.name, list(settings.models)) == ("full-task", ["full-task", "full-joint"])
    assert manifest.results["run"]["full-task"]["left_out"]["position_m"] < 0.1
    with pytest.raises(BundleError, match="no model 'cvae-task'"):
        planner_bundle(f"{reach_run / 'bundle'}:cvae-task")
    with pytest.raises(BundleError, match="kind"):
        planner_bundle("sim-fast")


def test_by_name(reach_run: Path) -> None:
    assert isinstance(planner_named("promp-depth"), ProMPDepthPlanner)
    found = planner_named("fused", bundle=reach_run)
    assert isinstance(found, FusedPlanner)
    assert found.name == "fused"
    with pytest.raises(ConfigurationError, match="no planner 'best'"):
        planner_named("best")


def test_home_is_where_demonstrations_start(planner: DeepProMPPlanner) -> None:
    np.testing.assert_allclose(planner.home, HOME, atol=0.02)
