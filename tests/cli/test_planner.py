"""``punnet train planner``, ``evaluate planner``, ``plan --planner`` and ``train bundle`` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("sklearn")
pytest.importorskip("torch")

from punnet.data.demos import DemonstrationSet
from punnet.data.demos.punnet_writer import write_punnet_folder
from punnet.movement import JointTrajectory
from punnet.robot import HOME, Panda
from punnet.train.planner import chapter_6


@pytest.fixture(scope="module")
def demos(reach_demonstrations, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demos") / "made"
    write_punnet_folder(reach_demonstrations, folder)
    return folder


@pytest.fixture
def photograph(reach_demonstrations, tmp_path: Path) -> tuple[Path, str]:
    """A photograph from home and the target's box as ``--target`` takes it."""
    episode = reach_demonstrations[0]
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.ascontiguousarray(episode.home.rgb()[:, :, ::-1]))
    return path, ",".join(f"{value:.1f}" for value in episode.target.box)


def test_full_by_default_and_a_finished_run_is_only_read(
    punnet, demos: Path, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = punnet("train", "planner", "--data", demos)
    assert result.code == 0, result.err
    assert "mm and" in result.out
    run = tmp_path / "runs" / "full-task"
    assert sorted(file.name for file in (run / "bundle").iterdir()) == [
        "full-task.onnx",
        "manifest.json",
        "planner.json",
    ]
    again = punnet("train", "planner", "--data", demos, "--json")
    assert "trained already" in again.err
    assert json.loads(again.out)["results"]["full-task"]["left_out"]["position_m"] < 0.1
    punnet("train", "planner", "--data", demos, "--seed", 9).fails_with("other seed")


def test_a_network_and_full_in_one_bundle(punnet, demos: Path, photograph, tmp_path: Path) -> None:
    settings = tmp_path / "small.json"
    settings.write_text(
        json.dumps(
            {"trunk": [[16, 8]], "reconstruction_epochs": 1, "epochs": 2, "tuning_epochs": 1, "batch": 45}
        )
    )
    run, bundle = tmp_path / "run", tmp_path / "mine"
    result = punnet(
        *("train", "planner", "--data", demos, "--kind", "full", "--kind", "cvae", "--config", settings),
        *("--unlabelled", photograph[0].parent, "--out", run),
    )
    assert result.code == 0, result.err
    assert "l-cvae-task: loss reconstruction" in result.out
    result = punnet("train", "bundle", run, "--out", bundle, "--licence", "CC0-1.0")
    assert result.code == 0, result.err
    manifest = json.loads((bundle / "manifest.json").read_text())
    assert manifest["kind"] == "planner"
    assert manifest["licence"] == "CC0-1.0"
    assert "--kind full --kind cvae --space task --data made --seed 0" in manifest["command"]
    assert manifest["data"]["targets"] == 15
    measured = punnet(
        *(
            "evaluate",
            "planner",
            "--data",
            demos,
            "--planner",
            bundle,
            "--planner",
            f"{bundle}:l-cvae-task",
            "--json",
        )
    )
    names = [one["planner"] for one in json.loads(measured.out)["planners"]]
    assert names == ["full-task", "fused", "l-cvae-task", "fused"]


def test_what_training_refuses(punnet, demos: Path, tmp_path: Path) -> None:
    punnet("train", "planner", "--data", demos, "--kind", "best", "--out", tmp_path / "a").fails_with(
        "no kind 'best'", "full, direct"
    )
    punnet("train", "planner", "--data", tmp_path / "none", "--out", tmp_path / "a").fails_with("none")
    (tmp_path / "empty").mkdir()
    punnet(
        "train", "planner", "--data", demos, "--unlabelled", tmp_path / "empty", "--out", tmp_path / "a"
    ).fails_with("no PNG or JPEG")
    punnet(
        "train", "planner", "--data", demos, "--kind", "full", "--kind", "full", "--out", tmp_path / "a"
    ).fails_with("each planner once")


def test_evaluate_tells_a_table(punnet, demos: Path) -> None:
    result = punnet("evaluate", "planner", "--data", demos, "--baselines", "--kind", "full")
    assert result.code == 0, result.err
    for name in (
        "constant-task",
        "ridge-2-task",
        "gp-task",
        "promp-depth",
        "full-task",
        "45 reaches to 15 targets",
    ):
        assert name in result.out
    punnet("evaluate", "planner", "--data", demos).fails_with("nothing to measure")


def test_plan_from_one_photograph(punnet, reach_run: Path, photograph, tmp_path: Path) -> None:
    path, box = photograph
    result = punnet("plan", "--rgb", path, "--target", box, "--planner", reach_run, "--space", "task")
    assert result.code == 0, result.err
    assert "deep-promp: the flange ends at" in result.out
    written = tmp_path / "a-reach"
    assert json.loads((written / "distribution.json").read_text())["space"] == "task"
    assert (written / "plan.csv").read_text().startswith("seconds,panda_joint1_rad")
    trajectory = JointTrajectory.from_json(json.loads((written / "trajectory.json").read_text()))
    np.testing.assert_allclose(trajectory.start, HOME, atol=0.02)
    for model in ("full-task", "full-joint"):
        plan = punnet(
            *("plan", "--rgb", path, "--target", box, "--planner-bundle", f"{reach_run / 'bundle'}:{model}"),
            *("--planner", "deep-promp", "--json"),
        )
        assert plan.code == 0, plan.err
        found = json.loads(plan.out)
        assert (found["planner"], found["picking_point"], found["out"]) == ("deep-promp", None, None)
        end = Panda().forward_kinematics(JointTrajectory.from_json(found["trajectory"]).end)[:3, 3]
        assert 0.4 < end[0] < 0.75
    again = punnet("plan", "--rgb", path, "--target", box, "--planner", reach_run)
    again.fails_with("a-reach", "--force")


def test_what_plan_refuses(punnet, reach_run: Path, photograph, tmp_path: Path) -> None:
    path, box = photograph
    punnet("plan", "--rgb", path, "--target", box, "--planner", "fused").fails_with("needs --depth")
    punnet("plan", "--rgb", path, "--target", box, "--depth", path).fails_with("belong together")
    punnet("plan", "--rgb", path, "--target", "900,10,990,60", "--planner", reach_run).fails_with(
        "holds no pixel"
    )
    punnet("plan", "--rgb", path, "--target", "9,9,4,4", "--planner", reach_run).fails_with("x0 < x1")
    punnet("plan", "--rgb", path, "--target", box, "--planner", tmp_path / "no").fails_with(
        "neither a folder nor"
    )


def test_chapter_6_refuses_at_once(punnet, demos: Path, tmp_path: Path) -> None:
    runs = ("--runs", tmp_path / "runs", "--quick")
    punnet("reproduce", "table-6-1", "--data", tmp_path / "gone", *runs).fails_with(
        "gone: no such file or folder"
    )
    punnet("reproduce", "table-6-1", "--unseen", tmp_path / "gone", *runs).fails_with(
        "gone: no such file or folder"
    )
    punnet("reproduce", "fig-6-9", "--out", tmp_path / "fig.txt", *runs).fails_with(
        "fig.txt", "ends in .png or"
    )
    assert not (tmp_path / "runs").exists()  # nothing was simulated before


def test_chapter_6_from_one_set_of_networks(
    punnet, reach_demonstrations, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        chapter_6,
        "QUICK",
        {"reconstruction_epochs": 1, "epochs": 2, "tuning_epochs": 1, "trunk": [[8, 8]], "batch": 30},
    )
    for name, plants in (("learnt", ("plant 0", "plant 1", "plant 2")), ("unseen", ("plant 3", "plant 4"))):
        chosen = tuple(episode for episode in reach_demonstrations if episode.group in plants)
        write_punnet_folder(DemonstrationSet(chosen, name=name), tmp_path / name)
    options = (
        "--data",
        tmp_path / "learnt",
        "--unseen",
        tmp_path / "unseen",
        "--runs",
        tmp_path / "runs",
        "--quick",
    )
    first = punnet("reproduce", "table-6-3", *options)
    assert first.code == 0, first.err
    assert "| cvae-task |" in first.out
    assert "/ 0.02" in first.out
    assert "6 targets on plants not seen" in first.err
    again = punnet("reproduce", "table-6-1", *options, "--json")
    assert again.code == 0, again.err
    assert "epoch" not in again.err  # trained already
    assert json.loads(again.out)["settings"]
    drawn = punnet("reproduce", "fig-6-9", *options)
    assert drawn.code == 0, drawn.err
    assert cv2.imread(drawn.out.split()[-1]) is not None
    # These were never simulated, so no world can be built for them.
    punnet("reproduce", "fig-6-12", *options, "--before", tmp_path / "unseen").fails_with("no simulated set")
    same = (*options[:2], "--unseen", tmp_path / "learnt", "--runs", tmp_path / "other", "--quick")
    punnet("reproduce", "table-6-3", *same).fails_with("plant 0")
