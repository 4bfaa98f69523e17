"""A run: what it writes, that a finished one is not trained again, bundles, and figure 4.12."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")
pytest.importorskip("torch")

from punnet.bundle import load_bundle
from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError
from punnet.train.detector.bundling import Terms
from punnet.train.weight.bundling import bundle_weight_run
from punnet.train.weight.figure_4_12 import (
    claim_folder,
    reproduce_figure_4_12,
    table_4_12,
    write_figure,
)
from punnet.train.weight.forest import FOREST, PlainForestConfig
from punnet.train.weight.training import WeightRun, load_run, read_config, train_weight_model
from punnet.weight.ellipsoid import EllipsoidEstimator
from punnet.weight.learned import LearnedWeightEstimator
from punnet.weight.sample_split import split_groups
from punnet.weight.samples import MissedBerry, join_samples
from tests.train.weight.domes import domes

SAMPLES = domes(90)
CONFIG = PlainForestConfig(trees=10, least_leaf=(1,), feature_share=(0.6,), folds=3)


def train(folder: Path, said: list[str] | None = None, *, seed: int = 0, extra: bool = False) -> WeightRun:
    others = replace(domes(20, 9), groups=tuple(f"other {n}" for n in range(20)))
    return train_weight_model(
        FOREST,
        CONFIG,
        SAMPLES,
        data=["domes"],
        folder=folder,
        seed=seed,
        progress=(said if said is not None else []).append,
        extra=others if extra else None,
        extra_data=["others"] if extra else [],
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> WeightRun:
    return train(tmp_path_factory.mktemp("runs") / "forest", extra=True)


def test_a_run_says_what_it_was_made_of_and_what_it_is_worth(run: WeightRun) -> None:
    settings = json.loads((run.folder / "run.json").read_text())
    assert settings["model"] == "forest"
    assert (settings["data"], settings["extra"]) == (["domes"], ["others"])
    assert sum(settings["berries"].values()) == 110
    assert settings["config"]["trees"] == 10
    assert run.results["test"]["parts"]["all"]["berries"] == settings["berries"]["test"]
    assert np.isfinite(run.model().predict(SAMPLES.observations[:3])).all()


def test_a_detector_s_berries_are_learnt_from_in_the_part_of_their_plant(tmp_path: Path) -> None:
    """Its masks are half of what is learnt from; no plant of the test is among them, and it has its own results."""
    others = replace(domes(20, 9), groups=tuple(f"other {n}" for n in range(20)))
    run = train_weight_model(
        FOREST,
        CONFIG,
        SAMPLES,
        data=["domes"],
        folder=tmp_path / "run",
        seed=0,
        progress=lambda line: None,
        extra=others,
        extra_data=["others"],
        detected={"eyes": join_samples([SAMPLES, others])},
    )
    plain = split_groups(SAMPLES)
    assert run.settings["masks"] == ["truth", "eyes"]
    assert run.settings["berries"]["train"] == 2 * (len(plain.train) + len(others))
    assert run.settings["berries"]["test"] == len(plain.test)
    assert run.results["test, masks of eyes"]["masks"] == "eyes"
    assert run.results["test, masks of eyes"]["parts"] == run.results["test"]["parts"]


def test_a_finished_run_is_not_trained_again(run: WeightRun) -> None:
    before = (run.folder / "model" / "model.onnx").stat().st_mtime_ns
    said: list[str] = []
    train(run.folder, said, extra=True)
    assert "trained already" in said[0]
    assert (run.folder / "model" / "model.onnx").stat().st_mtime_ns == before


def test_another_run_or_folder_is_left_alone(run: WeightRun, tmp_path: Path) -> None:
    with pytest.raises(OutputExistsError, match="other seed"):
        train(run.folder, seed=1, extra=True)
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(OutputExistsError, match="no weight run"):
        train(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_stopped_run_is_no_model_but_goes_on(tmp_path: Path) -> None:
    def stop(line: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_weight_model(
            FOREST, CONFIG, SAMPLES, data=["domes"], folder=tmp_path / "run", seed=0, progress=stop
        )
    with pytest.raises(FileFormatError, match="was stopped"):
        load_run(tmp_path / "run")
    assert train(tmp_path / "run").results["test"]["parts"]["all"]["berries"] > 0


def test_extra_plants_must_be_others(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="learnt from besides"):
        train_weight_model(
            FOREST, CONFIG, SAMPLES, data=["a"], folder=tmp_path / "run", seed=0, progress=str, extra=SAMPLES
        )


def test_settings_by_name() -> None:
    assert read_config(FOREST, {"trees": 3}).trees == 3
    with pytest.raises(ConfigurationError, match="no field tree"):
        read_config(FOREST, {"tree": 3})


def test_a_bundle_weighs_as_the_run_does(run: WeightRun, tmp_path: Path) -> None:
    manifest = bundle_weight_run(
        run.folder, tmp_path / "mine", name="mine", terms=Terms(), results={"more": {}}
    )
    assert manifest.kind == "weight"
    assert manifest.command == "punnet train weight --model forest --data domes --extra others --seed 0"
    assert manifest.results["run"]["test"]["parts"]["all"]["berries"] > 0
    estimator = LearnedWeightEstimator.from_bundle(load_bundle(tmp_path / "mine", kind="weight"))
    np.testing.assert_array_equal(
        estimator.weigh(list(SAMPLES.observations)).grams, run.model().predict(SAMPLES.observations)
    )


def test_figure_4_12_has_a_row_a_model_and_says_what_failed(tmp_path: Path) -> None:
    claim_folder(tmp_path / "figure")
    blind = replace(
        SAMPLES.subset(range(45)),
        missed=tuple(MissedBerry("not found", 20.0, name, 0.0, 0, 0) for name in SAMPLES.groups[45:]),
    )
    times = iter(range(100))
    figure = reproduce_figure_4_12(
        {"truth": SAMPLES, "eyes": blind},
        data="domes",
        folder=tmp_path / "figure",
        seed=0,
        models=("forest", "unheard-of"),
        bundles={"geometry": EllipsoidEstimator()},
        progress=str,
        clock=lambda: float(next(times)),
    )
    assert list(figure.failed) == ["unheard-of"]
    assert [row.name for row in figure.rows] == ["forest", "ellipsoid"]
    assert figure.rows[0].seconds == 1.0
    table = table_4_12(figure)
    assert table.rows[0][0] == "Random forest"
    assert table.rows[0][2].endswith("/ 28.3")
    assert table.rows[0][1] == str(figure.rows[0].learnt)
    seen, missed = (figure.rows[0].evaluations[name].whole for name in ("truth", "eyes"))
    assert missed.pcw[0.30] < seen.pcw[0.30], "berries that the detector misses count as wrong"
    write_figure(figure, tmp_path / "figure")
    assert (tmp_path / "figure" / "fig-4-12.md").read_text().startswith("| model |")
    assert (tmp_path / "figure" / "fig-4-12.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "figure" / "fig-4-12.json").read_text())["failed"].keys() == {"unheard-of"}
    claim_folder(tmp_path / "figure")
    with pytest.raises(OutputExistsError, match="no figure"):
        claim_folder(tmp_path)
