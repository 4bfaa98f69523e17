from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from punnet.errors import ConfigurationError
from punnet.outputs import Interrupted
from punnet.train.loops import BatchDraws
from punnet.train.weight import deep_training
from punnet.train.weight.deep_module import Curve, relative_loss
from punnet.train.weight.hgnn import HGNN, HGNNConfig
from punnet.train.weight.pointnet import POINTNET, PointNetConfig
from tests.train.weight.domes import domes

TRAIN, VALIDATION = domes(24), domes(8, seed=9)
SMALL = PointNetConfig(
    epochs=3, batch=8, points=32, pool=64, first=(16,), second=(32,), head=(16,), transforms="none"
)


def fit(folder: Path, config: Any = SMALL, **changes: Any) -> Any:
    settings = {"train": TRAIN, "validation": VALIDATION, "seed": 0, "progress": lambda line: None, **changes}
    folder.mkdir(exist_ok=True)
    train, validation = settings.pop("train"), settings.pop("validation")
    return POINTNET.fit(train, validation, config, folder=folder, **settings)


def test_a_seed_gives_one_model_and_another_seed_another(tmp_path: Path) -> None:
    first, again = fit(tmp_path / "a"), fit(tmp_path / "b")
    other = fit(tmp_path / "c", seed=1)
    seen = VALIDATION.observations
    np.testing.assert_array_equal(first.predict(seen), again.predict(seen))
    assert np.abs(first.predict(seen) - other.predict(seen)).max() > 1e-3


def test_a_stopped_training_goes_on_as_if_it_had_not_been(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = fit(tmp_path / "whole")
    told: list[str] = []
    original = Curve.on_train_epoch_start

    def interrupted(curve: Curve, trainer: Any, module: Any) -> None:
        if trainer.current_epoch == 2:
            raise KeyboardInterrupt
        original(curve, trainer, module)

    monkeypatch.setattr(Curve, "on_train_epoch_start", interrupted)
    with pytest.raises(Interrupted) as stopped:
        fit(tmp_path / "parts", progress=told.append)
    monkeypatch.setattr(Curve, "on_train_epoch_start", original)
    assert stopped.value.kept == tmp_path / "parts" / "last.ckpt"
    assert len(told) == 2
    resumed = fit(tmp_path / "parts", progress=told.append)
    assert len(told) == 3
    np.testing.assert_array_equal(
        resumed.predict(VALIDATION.observations), whole.predict(VALIDATION.observations)
    )
    assert [dict(epoch) for epoch in resumed.curve] == [dict(epoch) for epoch in whole.curve]


def test_a_finished_training_is_not_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = fit(tmp_path / "run")
    monkeypatch.setattr(deep_training, "_trainer", None)
    again = fit(tmp_path / "run")
    np.testing.assert_array_equal(
        again.predict(VALIDATION.observations), first.predict(VALIDATION.observations)
    )


def test_another_training_in_the_folder_is_refused(tmp_path: Path) -> None:
    fit(tmp_path / "run")
    with pytest.raises(ConfigurationError, match="another seed"):
        fit(tmp_path / "run", seed=4)
    with pytest.raises(ConfigurationError, match="another train"):
        fit(tmp_path / "run", train=domes(12, seed=2))
    with pytest.raises(ConfigurationError, match="another config, model"):
        HGNN.fit(TRAIN, VALIDATION, HGNNConfig(), seed=0, progress=lambda line: None, folder=tmp_path / "run")


def test_too_few_berries_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="at least 2 berries"):
        fit(tmp_path / "run", train=TRAIN.subset([0]))
    with pytest.raises(ConfigurationError, match="1 to validate"):
        fit(tmp_path / "run", validation=TRAIN.subset([]))


def test_a_damaged_checkpoint_is_said(tmp_path: Path) -> None:
    fit(tmp_path / "run")
    (tmp_path / "run" / "best.ckpt").write_bytes(b"nothing")
    with pytest.raises(ConfigurationError, match=r"best\.ckpt: not a checkpoint"):
        fit(tmp_path / "run")


def test_training_learns_and_stops_when_validation_is_flat(tmp_path: Path) -> None:
    config = PointNetConfig(
        epochs=60, batch=16, points=64, pool=128, first=(32,), second=(64,), head=(32,),
        transforms="none", patience=6, learning_rate=3e-3,
    )  # fmt: skip
    model = fit(tmp_path / "run", config, train=domes(128), validation=domes(32, seed=9))
    losses = [epoch["loss"] for epoch in model.curve]
    mape = min(epoch["mape"] for epoch in model.curve)
    constant = np.abs(np.median(TRAIN.grams) / VALIDATION.grams - 1).mean()
    assert mape < 0.5 * constant
    best = int(np.argmin(losses))
    assert len(losses) == 60 or len(losses) == best + 1 + 6
    held_out = domes(20, seed=11)
    assert np.abs(model.predict(held_out.observations) / held_out.grams - 1).mean() < 0.5 * constant


def test_the_kept_weights_are_those_of_the_best_epoch(tmp_path: Path) -> None:
    model = fit(tmp_path / "run")
    errors = np.abs(model.predict(VALIDATION.observations) / VALIDATION.grams - 1)
    best = min(model.curve, key=lambda epoch: epoch["loss"])
    assert errors.mean() == pytest.approx(best["mape"], rel=1e-3)


@pytest.mark.parametrize(("share", "steps"), [(1.0, 9), (1 / 3, 3), (0.0, 0)])
def test_statistics_stay_as_they_are_after_a_share_of_the_steps(
    tmp_path: Path, share: float, steps: int
) -> None:
    model = fit(tmp_path / "run", replace(SMALL, settled=share))
    kept = torch.load(tmp_path / "run" / "last.ckpt", weights_only=True)["state_dict"]
    assert {int(value) for name, value in kept.items() if name.endswith("num_batches_tracked")} == {steps}
    assert np.isfinite(model.predict(VALIDATION.observations)).all()


def test_the_loss_is_of_the_relative_error() -> None:
    grams = torch.tensor([10.0, 40.0])
    heavy = relative_loss(torch.tensor([10.0, 44.0]), grams, 0.1)
    light = relative_loss(torch.tensor([11.0, 40.0]), grams, 0.1)
    torch.testing.assert_close(heavy, light)
    assert float(heavy) == pytest.approx(0.25)
    far = relative_loss(torch.tensor([20.0]), torch.tensor([10.0]), 0.1)
    assert float(far) == pytest.approx(9.5)


def test_an_epoch_holds_each_berry_once_and_depends_on_seed_and_epoch_alone() -> None:
    draws = BatchDraws(20, 6, seed=1)
    epoch = list(draws)
    assert len(epoch) == len(draws) == 3
    berries = np.concatenate([chosen for _, chosen in epoch])
    assert len(set(berries.tolist())) == 18
    again = list(BatchDraws(20, 6, seed=1))
    assert all(a[0] == b[0] and (a[1] == b[1]).all() for a, b in zip(epoch, again, strict=True))
    draws.set_epoch(1)
    assert not (np.concatenate([chosen for _, chosen in draws]) == berries).all()
    assert len(BatchDraws(3, 6, seed=1)) == 1
