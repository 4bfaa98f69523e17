"""Baselines, and measuring on groups left out."""

from pathlib import Path

import numpy as np
import pytest

from punnet.data.demos import read_demos
from punnet.errors import ConfigurationError
from punnet.planning import DeepProMPPlanner
from punnet.planning.reaches import Reaches, reaches_from
from punnet.train.planner.baselines import BASELINES, baseline, fused
from punnet.train.planner.comparison import leave_groups_out, measure, usable_baselines
from punnet.train.planner.config import PlannerConfig
from punnet.train.planner.full import FullConfig


@pytest.fixture(scope="module")
def reaches(reach_demonstrations) -> Reaches:
    return reaches_from(reach_demonstrations)


def left_out(planner, reaches: Reaches, folder: Path, seeds=(0,), space="task") -> dict:
    return leave_groups_out(
        planner, reaches, space=space, seeds=seeds, folder=folder, progress=lambda line: None
    ).to_json()


def test_every_baseline_is_measured_on_plants_left_out(reaches: Reaches, tmp_path: Path) -> None:
    assert usable_baselines(reaches) == list(BASELINES)
    found = {name: left_out(name, reaches, tmp_path) for name in BASELINES}
    assert all(result["reaches"] == 45 for result in found.values())
    assert found["constant"]["position_m"] > 2 * found["ridge-1"]["position_m"]
    assert found["ridge-1"]["position_m"] < 0.06
    assert found["gp"]["position_m"] < 0.06
    # Depth ends at the stem.
    assert found["promp-depth"]["tool_from_grip_point_m"] < 1e-4
    assert found["promp-depth"]["coverage"] is None


def test_nearest_takes_the_nearest_target(reaches: Reaches) -> None:
    found = baseline("nearest", reaches, "joint").predict(reaches)
    np.testing.assert_array_equal(found.mean, reaches.joint.mean[reaches.targets])


def test_seeds_are_averaged_and_their_spread_told(reaches: Reaches, tmp_path: Path) -> None:
    short = PlannerConfig(
        kind="cvae",
        space="task",
        tuned=False,
        trunk=((16, 8),),
        reconstruction_epochs=1,
        epochs=2,
        batch=64,
    )
    found = left_out(short, reaches, tmp_path, seeds=(0, 1))
    assert found["seeds"] == 2
    assert found["spread"]["position_m"] >= 0
    again = left_out(short, reaches, tmp_path, seeds=(0, 1))  # from what is kept
    assert again == found


def test_a_trained_planner_and_depth(reaches: Reaches, reach_run: Path) -> None:
    planner = DeepProMPPlanner.from_bundle(reach_run)
    alone = measure(planner.model, reaches).to_json()
    with_depth = measure(fused(planner), reaches).to_json()
    assert alone["planner"] == "full-task"
    assert with_depth["tool_from_grip_point_m"] < 1e-4 < alone["tool_from_grip_point_m"]


def test_what_can_not_be_measured_is_said(reaches: Reaches, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="nothing can be left out"):
        left_out(FullConfig(), reaches.of_groups(["plant 0"]), tmp_path)
    with pytest.raises(ConfigurationError, match="no baseline 'best'"):
        baseline("best", reaches, "task")


def test_real_reaches_as_they_were_measured_before(shared_data: Path, tmp_path: Path) -> None:
    """What others' code gave on the same 75: constant .19 m, ridge .046 and .044 m, its sure ones .036 and .035."""
    real = reaches_from(read_demos(shared_data / "reach"))
    assert "promp-depth" not in usable_baselines(real)
    with pytest.raises(ConfigurationError, match="where each berry hangs"):
        baseline("promp-depth", real, "task")
    found = {name: left_out(name, real, tmp_path) for name in ("constant", "ridge-1", "ridge-2")}
    assert found["constant"]["position_m"] == pytest.approx(0.19, abs=0.01)
    assert found["ridge-1"]["position_m"] == pytest.approx(0.046, abs=0.0015)
    assert found["ridge-2"]["position_m"] == pytest.approx(0.044, abs=0.0015)
    assert found["ridge-1"]["position_not_suspect_m"] == pytest.approx(0.036, abs=0.0015)
    assert found["ridge-2"]["position_not_suspect_m"] == pytest.approx(0.035, abs=0.0015)
