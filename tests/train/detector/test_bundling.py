"""From a run to a model that needs no PyTorch."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from punnet.bundle import load_bundle  # noqa: E402
from punnet.errors import ConfigurationError, OutputExistsError  # noqa: E402
from punnet.perception import LearnedDetector  # noqa: E402
from punnet.perception.decoding import decode_detections  # noqa: E402
from punnet.perception.evaluation import EVALUATION_SCHEMA  # noqa: E402
from punnet.perception.learned import prepare  # noqa: E402
from punnet.scene import Frame  # noqa: E402
from punnet.train.detector.bundling import Terms, bundle_run, network_of_checkpoint  # noqa: E402
from punnet.train.detector.config import Source  # noqa: E402
from punnet.train.detector.export import rounded  # noqa: E402
from punnet.train.detector.training import TrainingRun, train_detector  # noqa: E402
from punnet.train.detector.validation import TorchNetwork, score_network  # noqa: E402
from tests.train.detector.berries import draw_scene, small_config, small_training, write_set  # noqa: E402


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundling")
    images = write_set(folder / "set")
    training = small_training(steps=1, validate_every=1)
    train_detector(small_config(), training, TrainingRun(folder / "run", (Source(images),), loaders=0))
    return folder / "run"


EVALUATION = {
    "schema": EVALUATION_SCHEMA,
    "images": 3,
    "classes": [
        {
            "class": "pluckable",
            "truths": 7,
            "mask_ap": {"0.5": 0.123456, "0.9": None},
            "mask_ap_50_95": 1 / 3,
            "keypoint_ap": {"0.1": 1},
            "curves": [0.5] * 101,
        }
    ],
    "worst": ["a.jpg"],
}
TERMS = Terms("CC-BY-4.0", "for berries only", "Somebody, 2026")


@pytest.fixture(scope="module")
def model(run: Path) -> Path:
    folder = run.with_name("model")
    bundle_run(run, folder, name="mine", terms=TERMS, results={"set": {"ap": 0.1}, "measured": EVALUATION})
    return folder


def test_a_bundle_finds_what_its_checkpoint_finds(run: Path, model: Path) -> None:
    manifest = load_bundle(model, kind="detector").manifest
    assert (manifest.kind, manifest.name, manifest.licence) == ("detector", "mine", "CC-BY-4.0")
    assert (manifest.restriction, manifest.citation) == ("for berries only", "Somebody, 2026")
    assert manifest.results["set"] == {"ap": 0.1}
    (scores,) = manifest.results["measured"].pop("classes")
    assert manifest.results["measured"] == {"images": 3}
    assert scores["mask_ap"] == {"0.5": 0.1235, "0.9": None}
    assert scores["mask_ap_50_95"] == 0.3333
    assert scores.keys() == {"class", "truths", "mask_ap", "mask_ap_50_95", "keypoint_ap"}
    assert manifest.seed == 0
    assert manifest.data["run"]["training"]["steps"] == 1
    detector = LearnedDetector.from_bundle(model, threads=1, score_threshold=0.06)
    image, _ = draw_scene(np.random.default_rng(5), 1, berries=3)
    found = detector.detect(Frame(rgb=image))
    assert len(found) > 0
    network = TorchNetwork(rounded(network_of_checkpoint(run / "checkpoints" / "last.ckpt")))
    pixels, size = prepare(image, detector.settings.longest_side, detector.settings.stride)
    settings = detector.settings
    expected = decode_detections(
        network.run(pixels, 0.06),
        size,
        size,
        settings.mask_threshold,
        settings.keypoint_sigmas,
        least_score=0.06,
    )
    assert len(found) == len(expected)
    np.testing.assert_allclose(found.boxes, expected.boxes, atol=0.1)
    np.testing.assert_allclose(found.scores, expected.scores, atol=1e-4)


def test_bundles_are_not_replaced_unasked(
    run: Path, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = {"name": "another", "terms": Terms(), "results": {}}
    with monkeypatch.context() as patched:
        patched.setattr(
            "punnet.train.detector.bundling.network_of_checkpoint", None
        )  # refused before any work
        with pytest.raises(OutputExistsError, match="--force"):
            bundle_run(run, model, **arguments)  # type: ignore[arg-type]
        (tmp_path / "thesis.tex").write_text("three years of work")
        with pytest.raises(OutputExistsError, match="not made by punnet"):
            bundle_run(run, tmp_path, **arguments, force=True)  # type: ignore[arg-type]
    copied = shutil.copytree(model, tmp_path / "model")
    bundle_run(run, copied, **arguments, force=True)  # type: ignore[arg-type]
    assert load_bundle(copied).manifest.name == "another"


def test_what_is_no_run_is_said(run: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="not the folder of a training run"):
        bundle_run(tmp_path, tmp_path / "model", name="mine", terms=Terms(), results={})
    begun = tmp_path / "begun"
    begun.mkdir()
    (begun / "config.json").write_bytes((run / "config.json").read_bytes())
    with pytest.raises(ConfigurationError, match="no such checkpoint"):
        bundle_run(begun, tmp_path / "model", name="mine", terms=Terms(), results={})
    last = begun / "checkpoints" / "last.ckpt"
    last.parent.mkdir()
    for content in (b"", b"no checkpoint at all", (run / "checkpoints" / "last.ckpt").read_bytes()[:5000]):
        last.write_bytes(content)
        with pytest.raises(ConfigurationError, match="not a checkpoint of a detector"):
            bundle_run(begun, tmp_path / "model", name="mine", terms=Terms(), results={})
    assert not (tmp_path / "model").exists()


def test_a_checkpoint_that_would_run_code_is_refused(tmp_path: Path) -> None:
    torch.save({"hyper_parameters": {"detector": Path("x")}, "state_dict": {}}, tmp_path / "last.ckpt")
    with pytest.raises(ConfigurationError, match="not a checkpoint of a detector"):
        network_of_checkpoint(tmp_path / "last.ckpt")


def test_scores_of_a_network_are_those_of_its_detections(run: Path) -> None:
    from punnet.data.formats import read_dataset

    settings = json.loads((run / "config.json").read_text())
    images = read_dataset(settings["sources"][0]["path"]).images
    scores = score_network(network_of_checkpoint(run / "checkpoints" / "last.ckpt"), images)
    assert 0 <= scores["mean"].mask_ap_mean <= 1
