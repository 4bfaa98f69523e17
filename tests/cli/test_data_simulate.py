"""``punnet data simulate``: what it prints, and where it writes."""

import json

import pytest
import typer
from typer.testing import CliRunner

from punnet.cli.data_simulate import simulate
from punnet.errors import ConfigurationError, OutputExistsError


@pytest.fixture
def run():
    app = typer.Typer()
    app.command()(simulate)

    def invoke(*arguments):
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return invoke


def test_json_tells_what_was_made_and_a_second_run_overwrites_nothing(run, tmp_path):
    out = tmp_path / "set"
    result = run("--images", 2, "--seed", 5, "--out", out, "--json")
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert told["images"] == told["made"] == 2
    assert told["plants"] == 1
    assert told["images_per_second"] > 0
    assert told["annotations"] == len(json.loads((out / "annotations.json").read_text())["annotations"])
    before = (out / "annotations.json").stat().st_mtime_ns
    assert isinstance(run("--images", 2, "--seed", 5, "--out", out).exception, OutputExistsError)
    assert (out / "annotations.json").stat().st_mtime_ns == before
    said = run("--images", 2, "--seed", 5, "--out", out, "--force")
    assert said.exit_code == 0
    assert "2 images of 1 plants" in said.stdout


def test_what_cannot_be_is_refused(run, tmp_path):
    assert run("--images", 0, "--out", tmp_path / "a").exit_code == 2
    assert run("--images", 3).exit_code == 2
    wrong = run("--images", 3, "--out", tmp_path / "a", "--backend", "threads")
    assert isinstance(wrong.exception, ConfigurationError)
    assert not (tmp_path / "a").exists()
