"""Runs: stopped and gone on with, repeated, refused, ended early."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator  # noqa: E402

from punnet.errors import ConfigurationError, FileFormatError, OutputError, OutputExistsError  # noqa: E402
from punnet.outputs import Interrupted  # noqa: E402
from punnet.train.detector.bundling import network_of_checkpoint  # noqa: E402
from punnet.train.detector.callbacks import Averaging  # noqa: E402
from punnet.train.detector.config import DetectorTraining, Source  # noqa: E402
from punnet.train.detector.module import rate_at  # noqa: E402
from punnet.train.detector.samples import Samples  # noqa: E402
from punnet.train.detector.training import TrainingRun, last_scores, train_detector  # noqa: E402
from tests.train.detector.berries import small_config, small_training, write_set  # noqa: E402

CONFIG = small_config()
# A checkpoint after steps 2, 4 and 5.
FIVE = small_training(steps=5)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_set(tmp_path_factory.mktemp("images") / "set", images=3)


def run_of(folder: Path, images: Path, **changes: Any) -> TrainingRun:
    settings: dict[str, Any] = {"folder": folder, "sources": (Source(images),), "loaders": 0}
    return TrainingRun(**{**settings, **changes})


@pytest.fixture(scope="module")
def straight(images: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five steps without a stop."""
    folder = tmp_path_factory.mktemp("straight") / "run"
    train_detector(CONFIG, FIVE, run_of(folder, images))
    return folder


def stored(folder: Path) -> dict[str, Any]:
    state: dict[str, Any] = torch.load(folder / "checkpoints" / "last.ckpt", weights_only=True)
    return state


def curve(folder: Path) -> dict[str, dict[int, float]]:
    """Losses by name and step, from TensorBoard's files."""
    files = sorted((folder / "tensorboard").glob("events.*"))
    assert files
    values: dict[str, dict[int, float]] = {}
    for file in files:
        events = EventAccumulator(str(file)).Reload()
        for name in events.Tags()["scalars"]:
            values.setdefault(name, {}).update({e.step: e.value for e in events.Scalars(name)})
    return values


def breaking(error: BaseException, at: int) -> Callable[[Samples, int], Any]:
    """How samples are drawn until one of them can't be had."""
    whole = Samples.__getitem__

    def drawn(samples: Samples, index: int) -> Any:
        if index >= at:
            raise error
        return whole(samples, index)

    return drawn


def test_a_stopped_run_ends_as_one_that_was_not(
    straight: Path, images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Samples come from a process of their own, which works ahead: none of what it prepared may be lost or seen twice.
    run = run_of(tmp_path / "run", images, loaders=1)
    with monkeypatch.context() as patched:
        patched.setattr(Samples, "__getitem__", breaking(RuntimeError("the lights went out"), at=2))
        with pytest.raises(RuntimeError, match="lights"):
            train_detector(CONFIG, FIVE, run)
    assert stored(run.folder)["global_step"] == 2
    train_detector(CONFIG, FIVE, run)
    one, other = stored(straight), stored(run.folder)
    assert one["global_step"] == other["global_step"] == 5
    for part in ("state_dict", "current_model_state"):
        assert one[part].keys() == other[part].keys()
        for name, value in one[part].items():
            torch.testing.assert_close(value, other[part][name], rtol=0, atol=1e-6, msg=f"{part} {name}")
    before, after = curve(straight), curve(run.folder)
    assert sorted(before["loss"]) == [1, 3]
    for name in before:
        assert before[name].keys() == after[name].keys()
        for step, value in before[name].items():
            assert after[name][step] == pytest.approx(value, abs=1e-6), (name, step)


def test_every_term_is_logged_and_the_sum_is_eq_3_1(straight: Path) -> None:
    logged = curve(straight)
    weights = small_training().loss
    names = [name for name in logged if name.startswith("loss/")]
    assert {name.removeprefix("loss/") for name in names} == set(vars(weights))
    for step, total in logged["loss"].items():
        summed = sum(getattr(weights, name.removeprefix("loss/")) * logged[name][step] for name in names)
        assert total == pytest.approx(summed, rel=1e-5)


def test_the_seed_decides(straight: Path, images: Path, tmp_path: Path) -> None:
    other = run_of(tmp_path / "other", images)
    train_detector(CONFIG, replace(FIVE, steps=2, seed=1), other)
    assert curve(straight)["loss"][1] != curve(other.folder)["loss"][1]


def test_a_finished_run_is_left_as_it_is(straight: Path, images: Path) -> None:
    before = (straight / "checkpoints" / "last.ckpt").read_bytes()
    lines: list[str] = []
    train_detector(CONFIG, FIVE, run_of(straight, images), lines.append)
    assert (straight / "checkpoints" / "last.ckpt").read_bytes() == before
    assert lines == []


def test_another_configuration_in_the_folder_is_a_fault(straight: Path, images: Path) -> None:
    with pytest.raises(OutputExistsError, match="with other training"):
        train_detector(CONFIG, replace(FIVE, seed=5), run_of(straight, images))
    with pytest.raises(OutputExistsError, match="with other detector"):
        train_detector(small_config(channels=16), FIVE, run_of(straight, images))
    with pytest.raises(OutputExistsError, match="with other sources"):
        train_detector(CONFIG, FIVE, run_of(straight, images, sources=(Source(images, 2.0),)))


def test_a_bad_start_leaves_no_claim_behind(images: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(FileFormatError):
        train_detector(CONFIG, small_training(), run_of(folder, tmp_path / "nowhere"))
    with pytest.raises(ConfigurationError, match="not a checkpoint"):
        train_detector(CONFIG, small_training(), run_of(folder, images, start=images / "0.png"))
    bare = write_set(tmp_path / "bare", berries=0)
    with pytest.raises(ConfigurationError, match="no berry with a mask"):
        train_detector(CONFIG, small_training(), run_of(folder, images, validation=Source(bare)))
    assert not folder.exists()
    folder.mkdir()
    (folder / "config.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"config\.json: not readable as JSON"):
        train_detector(CONFIG, small_training(), run_of(folder, images))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        train_detector(CONFIG, small_training(), run_of(tmp_path / "file" / "run", images))


def test_a_damaged_checkpoint_is_told(straight: Path, images: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    (folder / "checkpoints").mkdir(parents=True)
    (folder / "config.json").write_bytes((straight / "config.json").read_bytes())
    whole = (straight / "checkpoints" / "last.ckpt").read_bytes()
    (folder / "checkpoints" / "last.ckpt").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ConfigurationError, match=r"last\.ckpt: damaged"):
        train_detector(CONFIG, FIVE, run_of(folder, images))


def test_another_runs_weights_are_a_start(straight: Path, images: Path, tmp_path: Path) -> None:
    start = straight / "checkpoints" / "last.ckpt"
    run = run_of(tmp_path / "run", images, start=start)
    # The first step of warm-up is so small that the weights stay where they started.
    train_detector(CONFIG, small_training(steps=1, learning_rate=1e-12, averaging=0.0), run)
    started = stored(run.folder)["state_dict"]
    for name, value in stored(straight)["state_dict"].items():
        if "running" not in name and "num_batches" not in name:
            torch.testing.assert_close(value, started[name], rtol=0, atol=1e-6, msg=name)
    with pytest.raises(ConfigurationError, match="not a checkpoint of this detector"):
        train_detector(
            small_config(channels=16), small_training(), run_of(tmp_path / "wide", images, start=start)
        )


def test_training_ends_early_and_validation_is_told(images: Path, tmp_path: Path) -> None:
    run = run_of(tmp_path / "run", images, validation=Source(images), validation_images=1)
    lines: list[str] = []
    # Nothing is learned at such a rate, so the second validation is no better than the first.
    training = small_training(steps=40, validate_every=1, patience=2, learning_rate=1e-12)
    train_detector(CONFIG, training, run, lines.append)
    validations = [json.loads(line) for line in (run.folder / "validation.jsonl").read_text().splitlines()]
    assert [one["step"] for one in validations] == [1, 2, 3]
    assert stored(run.folder)["global_step"] == 3
    assert last_scores(run.folder) == validations[-1]
    assert 0 <= validations[-1]["validation/mask_ap"] <= 1
    assert 0 <= validations[-1]["validation/mean_mask_ap0.5"] <= 1
    assert sum("on validation" in line for line in lines) == 3
    assert "validation/mask_ap" in curve(run.folder)


def test_ctrl_c_says_what_is_kept(images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Where the tests run in the background, Ctrl-C is ignored; here it is not.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    whole = Samples.__getitem__

    def pressed(samples: Samples, index: int) -> Any:
        if index == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return whole(samples, index)

    monkeypatch.setattr(Samples, "__getitem__", pressed)
    run = run_of(tmp_path / "run", images)
    try:
        with pytest.raises(Interrupted) as caught:
            train_detector(CONFIG, small_training(steps=20), run)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert caught.value.kept == run.folder / "checkpoints" / "last.ckpt"
    assert caught.value.kept.is_file()


def test_what_is_exported_is_the_average(straight: Path) -> None:
    state = stored(straight)
    network = network_of_checkpoint(straight / "checkpoints" / "last.ckpt")
    name = "heads.box_predictor.cls_score.weight"
    assert torch.equal(network.state_dict()[name], state["state_dict"][f"network.{name}"])
    assert not torch.equal(network.state_dict()[name], state["current_model_state"][f"network.{name}"])


def test_the_rate_rises_and_falls() -> None:
    training = DetectorTraining(steps=100, warm_up=10)
    rates = np.array([rate_at(step, training) for step in range(101)])
    assert rates[0] == pytest.approx(0.1)
    assert rates[9] == pytest.approx(1.0)
    assert (np.diff(rates[:10]) > 0).all()
    assert (np.diff(rates[10:]) <= 0).all()
    assert rates[100] == pytest.approx(0.01)
    assert rate_at(5, DetectorTraining(steps=3, warm_up=0)) == pytest.approx(0.01)


def test_the_average_of_a_short_run_leaves_its_start_behind() -> None:
    from torch.optim.swa_utils import AveragedModel

    def average_after(steps: int, decay: float) -> float:
        weight = torch.nn.Linear(1, 1, bias=False)
        torch.nn.init.zeros_(weight.weight)
        average = AveragedModel(weight, **Averaging(decay)._kwargs)
        average.update_parameters(weight)
        torch.nn.init.ones_(weight.weight)
        for _ in range(steps):
            average.update_parameters(weight)
        return float(average.module.weight.detach())

    # After 300 steps a decay of .998 alone would leave .998³⁰⁰ = 55% of the start.
    assert average_after(300, 0.998) > 0.99
    # In the long run the decay is the one that was asked for.
    assert average_after(2, 0.0) == pytest.approx(1.0)
    assert average_after(50, 0.1) == pytest.approx(1 - 0.1**50)
    kept = np.prod([min(0.9, (1 + n) / (10 + n)) for n in range(1, 201)])
    assert average_after(200, 0.9) == pytest.approx(1 - kept)
    assert average_after(5, 0.998) == pytest.approx(1 - np.prod([(1 + n) / (10 + n) for n in range(1, 6)]))
