"""A training starts from a bundle as well as from a checkpoint, and says why it can't from others."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from punnet.bundle import load_bundle  # noqa: E402
from punnet.errors import ConfigurationError  # noqa: E402
from punnet.perception.learned import MODEL_FILE  # noqa: E402
from punnet.perception.network import Network  # noqa: E402
from punnet.train.detector.bundling import Terms, bundle_run, network_of_checkpoint  # noqa: E402
from punnet.train.detector.config import DetectorConfig, Source  # noqa: E402
from punnet.train.detector.export import rounded, weights_of_onnx  # noqa: E402
from punnet.train.detector.module import DetectorModule  # noqa: E402
from punnet.train.detector.starting import describe_start, load_weights  # noqa: E402
from punnet.train.detector.training import TrainingRun, train_detector  # noqa: E402
from punnet.train.detector.validation import TorchNetwork  # noqa: E402
from tests.train.detector.berries import draw_scene, small_config, small_training, write_set  # noqa: E402

LAST = Path("checkpoints") / "last.ckpt"
TERMS = Terms("CC-BY-NC-4.0", "for berries only", "Somebody, 2026")


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_set(tmp_path_factory.mktemp("images") / "set")


@pytest.fixture(scope="module")
def run(images: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("starting") / "run"
    training = small_training(steps=1, validate_every=1)
    train_detector(small_config(), training, TrainingRun(folder, (Source(images),), loaders=0))
    return folder


@pytest.fixture(scope="module")
def model(run: Path) -> Path:
    folder = run.with_name("model")
    bundle_run(run, folder, name="mine", terms=TERMS, results={})
    return folder


def module_of(config: DetectorConfig) -> DetectorModule:
    torch.manual_seed(7)
    return DetectorModule(config, small_training())


def image() -> Any:
    return draw_scene(np.random.default_rng(5), 1, berries=3)[0][None]


def test_a_bundle_gives_back_every_weight(run: Path, model: Path) -> None:
    module = module_of(small_config())
    load_weights(module, model)
    expected = rounded(network_of_checkpoint(run / LAST)).state_dict()
    found = module.network.state_dict()
    names = [name for name in expected if not name.endswith("num_batches_tracked")]
    assert any("running_var" in name for name in names)
    for name in names:
        assert torch.equal(found[name], expected[name]), name


def test_equal_weights_are_stored_once_and_given_back_to_all(model: Path) -> None:
    # Biases begin as zeros and stay equal if a layer's gradient does: the exporter then keeps one array for all.
    stored = weights_of_onnx(model / MODEL_FILE)
    wanted = module_of(small_config()).network.state_dict()
    assert set(stored) == {name for name in wanted if not name.endswith("num_batches_tracked")}


@pytest.mark.parametrize("name", ["sim-fast", "field-fast"])
def test_a_shipped_bundle_goes_on_as_what_it_is(name: str) -> None:
    manifest = load_bundle(name).manifest
    made = {"fine_channels": 0, **manifest.data["run"]["detector"], "pretrained": False}
    module = module_of(DetectorConfig.for_backbone(made.pop("backbone"), **made))
    load_weights(module, name)
    pixels = np.zeros((1, 192, 256, 3), np.uint8)
    pixels[:, 48:144, 64:192] = image()
    one = TorchNetwork(module.network).run(pixels, 0.05)
    other = Network(load_bundle(name).path(MODEL_FILE), threads=1).run(pixels, 0.05)
    assert len(one) == len(other) > 0
    for part in ("boxes", "regions", "masks", "heatmaps", "visibility", "ripeness", "scores"):
        np.testing.assert_allclose(getattr(one, part), getattr(other, part), atol=2e-3, err_msg=part)


def test_a_run_from_a_bundle_begins_where_it_ended_and_keeps_its_terms(
    images: Path, model: Path, tmp_path: Path
) -> None:
    # The first step of warm-up is so small that the weights stay where they started.
    training = small_training(steps=1, learning_rate=1e-12, averaging=0.0)
    folder = tmp_path / "run"
    train_detector(
        small_config(), training, TrainingRun(folder, (Source(images),), start=str(model), loaders=0)
    )
    started = torch.load(folder / LAST, weights_only=True)["state_dict"]
    for name, value in weights_of_onnx(model / MODEL_FILE).items():
        if "running" not in name:
            torch.testing.assert_close(started[f"network.{name}"], value, rtol=0, atol=1e-6, msg=name)
    noted = json.loads((folder / "config.json").read_text())["start"]
    assert noted["bundle"] == "mine"
    assert noted["sha256"] == load_bundle(model).manifest.files[MODEL_FILE]
    manifest = bundle_run(folder, tmp_path / "model", name="ours", terms=Terms("CC-BY-4.0"), results={})
    assert manifest.restriction == TERMS.restriction
    assert manifest.citation == TERMS.citation
    own = Terms("CC-BY-4.0", "not for jam", "Us")
    manifest = bundle_run(folder, tmp_path / "other", name="ours", terms=own, results={})
    assert (manifest.restriction, manifest.citation) == ("not for jam", "Us")


def test_what_can_not_be_started_from_is_said(model: Path, tmp_path: Path) -> None:
    module = module_of(small_config(channels=16, mask_layers=2))
    before = {name: value.clone() for name, value in module.network.state_dict().items()}
    with pytest.raises(
        ConfigurationError, match=r"another network \(channels 8, not 16, mask_layers 1, not 2\)"
    ):
        load_weights(module, model)
    with pytest.raises(ConfigurationError, match=r"neither a checkpoint nor a detector's bundle.*sim-fast"):
        load_weights(module, str(tmp_path / "nowhere"))
    with pytest.raises(ConfigurationError, match=r"neither a checkpoint nor.*a bundle of kind"):
        load_weights(module, "promp-reach-sim")
    with pytest.raises(ConfigurationError, match=r"no manifest\.json"):
        load_weights(module, tmp_path)
    (tmp_path / "text").write_text("no checkpoint")
    with pytest.raises(ConfigurationError, match="not a checkpoint of this detector"):
        load_weights(module, tmp_path / "text")
    for name, value in module.network.state_dict().items():
        assert torch.equal(value, before[name]), name


def test_a_start_is_noted_as_what_it_is(model: Path, tmp_path: Path) -> None:
    assert describe_start(None) is None
    # A checkpoint that is gone does not keep its run from going on.
    assert describe_start(tmp_path / "gone.ckpt") == str(tmp_path / "gone.ckpt")
    noted = describe_start(model)
    assert isinstance(noted, dict)
    assert (noted["bundle"], noted["licence"]) == ("mine", "CC-BY-NC-4.0")
