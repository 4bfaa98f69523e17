"""``punnet train`` as a user types it."""

from __future__ import annotations

import importlib.util
import json
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from punnet.cli.train import read_source
from punnet.errors import ConfigurationError, FileFormatError
from tests.commands import require_understood
from tests.train.detector.berries import SMALL, write_set

TRAINING = {"steps": 2, "batch": 1, "crop": [64, 96], "warm_up": 1, "validate_every": 1, "averaging": 0.5}


@pytest.fixture
def images(tmp_path: Path) -> Path:
    return write_set(tmp_path / "set")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.json"
    path.write_text(json.dumps({"detector": SMALL, "training": TRAINING}))
    return path


def test_train_bundle_detect(punnet, images: Path, config: Path, tmp_path: Path) -> None:
    run, model, found = tmp_path / "run", tmp_path / "model", tmp_path / "found"
    command = ["train", "detector", "--config", config, "--data", f"{images},weight=2,scale=0.8-1.2"]
    said = punnet(*command, "--validation", images, "--out", run, "--threads", 1)
    assert said.code == 0, said.err
    assert said.out.strip() == (
        f"trained: {run}/checkpoints/last.ckpt; make a model of it with: punnet train bundle {run} --out MODEL"
    )
    lines = said.err.splitlines()
    assert lines, "progress is told"
    assert all(line.startswith("  step ") for line in lines), said.err
    (tmp_path / "scores.json").write_text('{"mask_ap": 0.5}')
    terms = ["--licence", "CC-BY-4.0", "--restriction", "for berries", "--citation", "Somebody"]
    results = ["--results", f"mine={tmp_path / 'scores.json'}"]
    said = punnet("train", "bundle", run, "--out", model, *terms, *results).out
    assert "use it with: punnet detect PHOTO" in said
    require_understood(said.partition("use it with: ")[2])
    manifest = json.loads((model / "manifest.json").read_text())
    assert manifest["licence"] == "CC-BY-4.0"
    assert manifest["results"] == {"mine": {"mask_ap": 0.5}}
    punnet("train", "bundle", run, "--out", model).fails_with("exists", "--force")
    assert punnet("detect", images / "0.png", "--detector", model, "--out", found).code == 0
    assert found.is_dir()


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--data", "nowhere"], 1, "nowhere: no such file or folder"),
        (["--data", "EMPTY"], 1, "no image in this set"),
        (["--data", "SET,wieght=2"], 1, "no option 'wieght'"),
        (["--data", "SET,weight=-1"], 1, "weight must be positive"),
        (["--data", "SET,scale=2"], 1, "two numbers are needed"),
        (["--data", "SET,split=nowhere.json:train"], 1, "nowhere.json"),
        (["--data", "SET", "--config", "nowhere.json"], 1, "neither a JSON file nor one of"),
        (["--data", "SET", "--config", "BAD"], 1, "no field stepps"),
        (["--data", "SET", "--steps", "0"], 2, "--steps"),
        (["--data", "SET", "--start", "SET/0.png"], 1, "not a checkpoint"),
        (["--data", "SET", "--start", "nowhere"], 1, "neither a checkpoint nor a detector's bundle: nowhere"),
        (["--data", "SET", "--start", "sim-fast"], 1, "holds another network (channels 64, not 8"),
        (["--data", "SET,ignore=blue"], 1, "no stage 'blue'; there are green"),
        ([], 2, "--data"),
    ],
)
def test_bad_input_is_told_and_leaves_nothing(
    punnet, arguments: list[str], code: int, said: str, images: Path, config: Path, tmp_path: Path
) -> None:
    empty = write_set(tmp_path / "empty", images=0)
    bad = tmp_path / "bad.json"
    bad.write_text('{"training": {"stepps": 3}}')
    places = {"SET": str(images), "EMPTY": str(empty), "BAD": str(bad)}
    for name, place in places.items():
        arguments = [argument.replace(name, place) for argument in arguments]
    if "--config" not in arguments:
        arguments = [*arguments, "--config", str(config)]
    result = punnet("train", "detector", *arguments, "--out", tmp_path / "run")
    assert result.code == code
    assert said in result.err
    assert "Traceback" not in result.err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere"], "not the folder of a training run; nowhere/config.json: no such file"),
        (["nowhere", "--results", "scores"], "NAME=FILE.json"),
        (["nowhere", "--results", "mine=nowhere.json"], "nowhere.json: no such file"),
    ],
)
def test_bad_bundles_are_told(punnet, arguments: list[str], said: str, tmp_path: Path) -> None:
    punnet("train", "bundle", *arguments, "--out", tmp_path / "model").fails_with(said)
    assert not (tmp_path / "model").exists()


def test_without_pytorch_the_command_says_what_to_install(
    punnet, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    find = importlib.util.find_spec

    def without(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name in ("torch", "lightning") else find(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", without)
    for command in (["detector", "--data", "x"], ["bundle", "x"]):
        result = punnet("train", *command, "--out", tmp_path / "out")
        result.fails_with("training needs torch, lightning", "pip install 'punnet[train]'")


def test_a_gpu_that_is_not_there_is_told(
    punnet, images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    run = tmp_path / "run"
    punnet("train", "detector", "--data", images, "--out", run, "--accelerator", "gpu").fails_with(
        "sees no GPU here"
    )
    assert not run.exists()


def test_sources_are_read_as_written(tmp_path: Path) -> None:
    split = tmp_path / "split.json"
    split.write_text('{"parts": {"train": ["a.png", "b.png"], "test": ["c.png"]}}')
    source = read_source(f"berries, ripe/all,weight=2.5,scale=0.3-0.6,split={split}:test")
    assert source.path == Path("berries, ripe/all")
    assert source.weight == 2.5
    assert source.scale == (0.3, 0.6)
    assert source.images == ("c.png",)
    train, test = (read_source(f"strawdi,split=strawdi:{part}").images for part in ("train", "test"))
    assert train is not None
    assert test is not None
    assert (len(train), len(test)) == (160, 40)
    assert not set(train) & set(test)
    for bad in (f"x,split={split}:validation", f"x,split={split}", "x,scale=a-b", "x,weight=heavy"):
        with pytest.raises((ConfigurationError, FileFormatError)):
            read_source(bad)
