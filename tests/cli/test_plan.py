"""``punnet plan``: a reach to a drawn berry."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.movement import JointTrajectory, TrajectoryDistribution
from punnet.robot import HOME, PANDA_LIMITS, Panda, load_arm


def test_reach_from_home_to_the_picking_point(
    punnet, frame_options, frame_folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "reach"
    result = punnet("plan", *frame_options(frame_folder), "--out", out, "--json")
    assert result.code == 0, result.err
    plan = json.loads(result.out)
    trajectory = JointTrajectory.from_json(plan["trajectory"])
    assert trajectory.start == pytest.approx(HOME, abs=1e-6)
    tool = Panda().forward_kinematics_tool(trajectory.end)[:3, 3]
    assert tool == pytest.approx(plan["picking_point"], abs=2e-3)
    # The berry was drawn at (0.75, 0, 0.7); its stem is above it.
    assert plan["picking_point"] == pytest.approx([0.75, 0.0, 0.73], abs=0.025)
    assert PANDA_LIMITS.velocity is not None
    assert (np.abs(trajectory.velocities) <= np.asarray(PANDA_LIMITS.velocity)).all()


def test_files(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "reach"
    result = punnet("plan", *frame_options(frame_folder), "--out", out)
    assert "s reach" in result.out
    assert cv2.imread(str(out / "plan.png")) is not None
    assert (
        TrajectoryDistribution.from_json(json.loads((out / "distribution.json").read_text())).dimensions == 7
    )
    trajectory = JointTrajectory.from_json(json.loads((out / "trajectory.json").read_text()))
    with (out / "plan.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0][0] == "seconds"
    table = np.array(rows[1:], dtype=np.float64)
    assert table.shape[1] == 8
    assert table[-1, 1:] == pytest.approx(trajectory.end, abs=1e-5)
    assert table[-1, 0] == pytest.approx(trajectory.duration, abs=1e-3)


def test_target_box_and_start(punnet, frame_options, frame_folder: Path) -> None:
    options = frame_options(frame_folder)
    box = json.loads(punnet("plan", *options, "--json").out)["box"]
    again = punnet("plan", *options, "--json", "--target", ",".join(f"{value:.0f}" for value in box))
    assert json.loads(again.out)["box"] == box
    punnet("plan", *options, "--target", "1,2,8,9").fails_with("none of the", "in the box")
    punnet("plan", *options, "--target", "9,9,1,1").fails_with("x0 < x1")
    punnet("plan", *options, "--target", "1,2,3").fails_with("--target", "4 numbers")
    punnet("plan", *options, "--start", "0,a,0,0,0,0,0").fails_with("--start", "7 numbers")


def test_no_berry_is_an_error_with_a_reason(punnet, frame_options, bare_frame_folder: Path) -> None:
    punnet("plan", *frame_options(bare_frame_folder)).fails_with("no target", "of 0 berries")


def test_hole_in_the_depth(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "depth.png"
    cv2.imwrite(str(path), np.zeros((480, 640), dtype=np.uint16))
    punnet("plan", *frame_options(frame_folder, depth=path)).fails_with("no target", "0 of those have depth")


def test_reach_of_another_arm(punnet, frame_options, frame_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "reach"
    result = punnet("plan", *frame_options(frame_folder), "--arm", "ur5", "--out", out, "--json")
    assert result.code == 0, result.err
    plan = json.loads(result.out)
    trajectory = JointTrajectory.from_json(plan["trajectory"])
    arm = load_arm("ur5")
    assert trajectory.positions.shape[1] == 6
    assert trajectory.start == pytest.approx(arm.home, abs=1e-6)
    tool = arm.forward_kinematics_tool(trajectory.end)[:3, 3]
    assert tool == pytest.approx(plan["picking_point"], abs=2e-3)
    assert (np.abs(trajectory.velocities) <= arm.limits.velocity).all()
    punnet("plan", *frame_options(frame_folder), "--arm", "ur6").fails_with("no file 'ur6'", "xarm7")
    punnet("plan", *frame_options(frame_folder), "--arm", "ur5", "--start", "0,0").fails_with("6 numbers")
