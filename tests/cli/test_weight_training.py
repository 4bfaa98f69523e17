"""``punnet train weight``, ``evaluate weight``, ``reproduce fig-4-12`` and ``train bundle`` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

pytest.importorskip("sklearn")
pytest.importorskip("torch")

from punnet.cli.app import app
from punnet.data.coco import write_coco
from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError
from tests.weight.weighed import weighed_dataset


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("set")
    radii = np.random.default_rng(1).uniform(0.012, 0.019, 36).tolist()
    write_coco(weighed_dataset(folder, radii), folder / "annotations.json")
    return folder


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "small.json"
    path.write_text(json.dumps({"trees": 5, "least_leaf": [1], "feature_share": [0.8], "folds": 2}))
    return path


@pytest.fixture(scope="module")
def trained(data: Path, settings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "forest"
    result = run("train", "weight", "--model", "forest", "--data", data, "--config", settings, "--out", out)
    assert result.exit_code == 0, result.output
    assert "within 20%" in result.stdout
    return out


def test_a_run_is_evaluated_and_gone_on_with(data: Path, settings: Path, trained: Path) -> None:
    again = run(
        *(
            "train",
            "weight",
            "--model",
            "forest",
            "--data",
            data,
            "--config",
            settings,
            "--out",
            trained,
            "--json",
        )
    )
    assert again.exit_code == 0
    assert json.loads(again.stdout)["test"]["parts"]["all"]["berries"] > 0
    shown = run("evaluate", "weight", "--run", trained, "--data", data, "--part", "all")
    assert shown.exit_code == 0
    assert "hold the true weight" in shown.stdout
    other = run("train", "weight", "--model", "forest", "--data", data, "--seed", 3, "--out", trained)
    assert isinstance(other.exception, OutputExistsError)


def test_estimators_are_evaluated_through_any_masks(data: Path) -> None:
    result = run(
        *("evaluate", "weight", "--estimator", "ellipsoid", "--data", data, "--part", "all"),
        *("--masks", "truth", "--masks", "colour", "--json"),
    )
    assert result.exit_code == 0, result.output
    truth, colour = json.loads(result.stdout)["evaluations"]
    assert (truth["masks"], colour["masks"]) == ("truth", "colour")
    assert truth["parts"]["all"]["berries"] == colour["parts"]["all"]["berries"] == 36
    assert truth["parts"]["all"]["pcw"]["0.30"] > 90.0


def test_a_bundle_of_a_run_weighs(data: Path, trained: Path, tmp_path: Path) -> None:
    made = run("train", "bundle", trained, "--out", tmp_path / "mine", "--licence", "Apache-2.0")
    assert made.exit_code == 0, made.output
    assert (
        f"punnet weigh --rgb PHOTO --depth DEPTH --camera CAMERA --estimator {tmp_path / 'mine'}"
        in made.stdout
    )
    found = [
        json.loads(run("evaluate", "weight", *which, "--data", data, "--json").stdout)["evaluations"][0]
        for which in (("--bundle", tmp_path / "mine"), ("--run", trained))
    ]
    assert found[0]["parts"] == found[1]["parts"]


def test_figure_4_12_of_one_model(data: Path, tmp_path: Path) -> None:
    result = run(
        *("reproduce", "fig-4-12", "--data", data, "--model", "forest", "--masks", "colour", "--quick"),
        *("--out", tmp_path / "figure"),
    )
    assert result.exit_code == 0, result.output
    assert "| Random forest |" in result.stdout
    assert "masks of colour |" in result.stdout
    assert {path.name for path in (tmp_path / "figure").iterdir()} >= {
        "fig-4-12.md",
        "fig-4-12.png",
        "fig-4-12.json",
    }


def test_wrong_wishes_are_named(data: Path, trained: Path, settings: Path, tmp_path: Path) -> None:
    def failure(*arguments: object) -> BaseException | None:
        return run(*arguments).exception

    out = tmp_path / "run"
    unknown = failure("train", "weight", "--model", "oak", "--data", data, "--out", out)
    assert isinstance(unknown, ConfigurationError)
    assert "pointnet" in str(unknown)
    nothing = failure("train", "weight", "--model", "gcn", "--data", data, "--config", settings, "--out", out)
    assert isinstance(nothing, ConfigurationError)
    assert "least_leaf" in str(nothing)
    (tmp_path / "list.json").write_text("[1]")
    listed = failure(
        "train",
        "weight",
        "--model",
        "forest",
        "--data",
        data,
        "--config",
        tmp_path / "list.json",
        "--out",
        out,
    )
    assert isinstance(listed, FileFormatError)
    two = failure("evaluate", "weight", "--run", trained, "--bundle", "ellipsoid", "--data", data)
    assert isinstance(two, ConfigurationError)
    part = failure("evaluate", "weight", "--bundle", "ellipsoid", "--data", data, "--part", "best")
    assert isinstance(part, ConfigurationError)
    oak = failure("reproduce", "fig-4-12", "--data", data, "--model", "oak", "--out", tmp_path / "figure")
    assert isinstance(oak, ConfigurationError)
    assert not out.exists()
    assert not (tmp_path / "figure").exists()
