"""Every deep model of the registry, at a size that trains in a moment."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import timm
import torch

from punnet.errors import ConfigurationError, FileFormatError
from punnet.train.imagenet import fill_from_lite0
from punnet.train.weight.dgcnn import DGCNNConfig, DynamicGraphNetwork
from punnet.train.weight.efficientnet import EfficientNetConfig, TwoStreams
from punnet.train.weight.fixed_graph import neighbour_edges
from punnet.train.weight.gcn import GCNConfig, GraphConvolutionalNetwork
from punnet.train.weight.hgnn import HGNNConfig, HigherOrderNetwork
from punnet.train.weight.pointconv import PointConv, PointConvConfig, point_density
from punnet.train.weight.pointnet import PointNet, PointNetConfig
from punnet.train.weight.pointnet2 import PointNet2, PointNet2Config
from punnet.train.weight.registry import MODELS, ModelSpec, model_spec
from tests.train.weight.domes import dome, domes

SMALL: dict[str, dict[str, Any]] = {
    "pointnet": {"first": (16, 16), "second": (16, 32), "head": (16,)},
    "pointnet2": {
        "centres": (16, 8),
        "neighbours": (8, 4),
        "widths": ((8, 16), (16, 16)),
        "last": (32,),
        "head": (16,),
    },
    "pointconv": {
        "centres": (16, 8, 1),
        "neighbours": (8, 4, 4),
        "widths": ((8,), (16,), (32,)),
        "kernel": 4,
        "head": (16,),
    },
    "gcn": {"neighbours": 4, "widths": (8, 16), "head": (16,)},
    "hgnn": {"neighbours": 4, "widths": (8, 16), "head": (16,)},
    "dgcnn": {"neighbours": 4, "widths": (8, 16), "whole": 32, "head": (16,)},
}
POINTS = {"points": 32, "pool": 64}
NETWORKS = {
    "pointnet": (PointNet, PointNetConfig),
    "pointnet2": (PointNet2, PointNet2Config),
    "pointconv": (PointConv, PointConvConfig),
    "gcn": (GraphConvolutionalNetwork, GCNConfig),
    "hgnn": (HigherOrderNetwork, HGNNConfig),
    "dgcnn": (DynamicGraphNetwork, DGCNNConfig),
}
IMAGES = {"pixels": 32, "epochs": 1, "batch": 4}


def config_of(spec: ModelSpec, **changes: Any) -> Any:
    if spec.name.startswith("efficientnet"):
        return spec.config(**{**IMAGES, **changes})
    return spec.config(**{**SMALL[spec.name], **POINTS, "epochs": 1, "batch": 4, **changes})


def network_of(name: str, **changes: Any) -> Any:
    network, config = NETWORKS[name]
    torch.manual_seed(0)
    made = network(config(**{**SMALL[name], **POINTS, **changes}))
    for module in made.modules():
        if isinstance(module, torch.nn.BatchNorm1d):
            module.momentum = 1.0  # statistics of the pass below, as training would leave them
    made(clouds(6))
    return made.eval()


def clouds(count: int = 2, points: int = 32) -> torch.Tensor:
    generator = torch.Generator().manual_seed(7)
    inputs = torch.rand(count, points, 4, generator=generator) * 2 - 1
    inputs[:, :, 3] = inputs[:, :1, 3]
    return inputs


@pytest.mark.parametrize("name", [*SMALL, "efficientnet_b0"])
def test_two_steps_then_the_same_grams_from_disk(name: str, tmp_path: Path) -> None:
    spec = model_spec(name)
    train, validation = domes(8), domes(3, seed=1)
    (tmp_path / "run").mkdir()
    (tmp_path / "kept").mkdir()
    said: list[str] = []
    model = spec.fit(
        train, validation, config_of(spec), seed=0, progress=said.append, folder=tmp_path / "run"
    )
    assert len(said) == 1
    assert name in said[0]
    grams = model.predict(validation.observations)
    assert grams.shape == (3,)
    assert grams.dtype == np.float64
    assert (grams > 0).all()
    model.save(tmp_path / "kept")
    model.save(tmp_path / "kept")  # a run that was stopped between saving and judging saves again
    loaded = spec.load(tmp_path / "kept")
    np.testing.assert_array_equal(loaded.predict(validation.observations), grams)
    one_by_one = np.concatenate([loaded.predict([seen]) for seen in validation.observations])
    np.testing.assert_allclose(one_by_one, grams, rtol=1e-4)
    assert loaded.predict([]).shape == (0,)


@pytest.mark.parametrize("name", SMALL)
def test_the_order_of_the_points_does_not_matter(name: str) -> None:
    network, inputs = network_of(name), clouds()
    order = torch.randperm(inputs.shape[1], generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(network(inputs[:, order]), network(inputs), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", SMALL)
def test_berries_of_a_batch_do_not_mix(name: str) -> None:
    network, inputs = network_of(name), clouds(3)
    torch.testing.assert_close(network(inputs)[1:2], network(inputs[1:2]), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", SMALL)
def test_every_weight_gets_a_gradient(name: str) -> None:
    network = network_of(name).train()
    if name == "pointnet":  # the transform starts as the identity: its last layer moves first
        torch.nn.init.normal_(network.transform.last.weight, std=0.01)
    (network(clouds(6)).square().sum() + network.penalty()).backward()
    silent = [
        key
        for key, weight in network.named_parameters()
        if weight.grad is None or not torch.isfinite(weight.grad).all() or not weight.grad.any()
    ]
    assert not silent


@pytest.mark.parametrize("name", SMALL)
def test_points_at_one_place_are_borne(name: str) -> None:
    inputs = clouds()
    inputs[:, :, :3] = inputs[:, :1, :3]
    assert torch.isfinite(network_of(name)(inputs)).all()


@pytest.mark.parametrize("name", SMALL)
def test_depth_counts(name: str) -> None:
    network, inputs = network_of(name), clouds()
    farther = inputs.clone()
    farther[:, :, 3] += 0.5
    assert not torch.equal(network(inputs), network(farther))


def test_the_streams_see_colour_and_depth() -> None:
    torch.manual_seed(0)
    network = TwoStreams(EfficientNetConfig(pixels=32)).eval()
    assert network.head[-1].weight.shape == (1, 2560)
    picture = torch.rand(1, 5, 32, 32, requires_grad=True)
    network(picture).sum().backward()
    assert picture.grad is not None
    assert (picture.grad.abs().sum(dim=(0, 2, 3)) > 0).all()


def test_b7_is_the_larger_variant() -> None:
    spec = model_spec("efficientnet_b7")
    assert spec.config().variant == "b7"
    assert spec.config().start == "random"
    with pytest.raises(ConfigurationError, match="lite0 fits variant b0, not b7"):
        spec.config(start="lite0")


def test_b0_starts_with_the_layers_of_lite0() -> None:
    started, unlike = TwoStreams(EfficientNetConfig()), TwoStreams(EfficientNetConfig(start="random"))
    lite0 = timm.create_model("efficientnet_lite0", num_classes=0)
    fill_from_lite0(lite0)
    for stream in (started.colour, started.depth):
        torch.testing.assert_close(stream.blocks[3][1].conv_pw.weight, lite0.blocks[3][1].conv_pw.weight)
        torch.testing.assert_close(stream.bn2.running_var, lite0.bn2.running_var)
        gate = stream.blocks[3][1].se.conv_expand.bias
        assert (torch.sigmoid(gate) > 0.95).all()
    torch.testing.assert_close(started.colour.conv_stem.weight, lite0.conv_stem.weight)
    # Two channels of the same value are answered as three would be.
    torch.testing.assert_close(started.depth.conv_stem.weight.sum(dim=1), lite0.conv_stem.weight.sum(dim=1))
    assert not torch.equal(unlike.colour.conv_stem.weight, lite0.conv_stem.weight)


def test_weights_that_can_not_be_downloaded_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")

    def offline(*arguments: Any, **settings: Any) -> Any:
        raise OSError("no route to host")

    monkeypatch.setattr("timm.models._builder.load_pretrained", offline)
    with pytest.raises(ConfigurationError, match=r"no route to host.*start otherwise"):
        TwoStreams(EfficientNetConfig(pixels=32, start="imagenet"))


def test_an_edge_leads_from_each_nearest_neighbour() -> None:
    points = clouds(2, 20)[..., :3]
    edges = neighbour_edges(points, 3)
    assert edges.shape == (2, 2 * 20 * 3)
    for cloud in range(2):
        distances = torch.cdist(points[cloud], points[cloud]) + 9 * torch.eye(20)
        for point in range(20):
            sources = edges[0, edges[1] == cloud * 20 + point] - cloud * 20
            assert sources.tolist() == distances[point].topk(3, largest=False).indices.tolist()


def test_the_dynamic_graph_changes_from_layer_to_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    network, inputs, graphs = network_of("dgcnn"), clouds(), []

    def recorded(points: torch.Tensor, neighbours: int) -> torch.Tensor:
        graphs.append(neighbour_edges(points, neighbours))
        return graphs[-1]

    monkeypatch.setattr("punnet.train.weight.dgcnn.neighbour_edges", recorded)
    network(inputs)
    assert len(graphs) == 2
    assert torch.equal(graphs[0], neighbour_edges(inputs[..., :3], 4))
    assert not torch.equal(graphs[0], graphs[1])
    assert torch.equal(graphs[0][1], graphs[1][1])


def test_density_is_that_of_the_definition() -> None:
    points = clouds(1, 15)[..., :3]
    squares = ((points[0][:, None] - points[0]) ** 2).sum(dim=2).double()
    expected = (torch.exp(-squares / 0.18) / ((2 * np.pi) ** 1.5 * 0.3**3)).mean(dim=1)
    torch.testing.assert_close(point_density(points, 0.3)[0].double(), expected, rtol=1e-4, atol=1e-5)


def test_the_feature_transform_starts_as_the_identity() -> None:
    network = network_of("pointnet")
    network(clouds())
    assert network.penalty().item() == 0.0
    torch.nn.init.normal_(network.transform.last.weight, std=0.1)
    network(clouds())
    assert network.penalty().item() > 0.0


@pytest.mark.parametrize("name", [name for name in MODELS if "net" in name or name in SMALL])
def test_quick_settings_fit_their_config(name: str) -> None:
    spec = model_spec(name)
    quick = spec.config(**spec.quick)
    assert quick.epochs <= spec.config().epochs
    assert dataclasses.asdict(quick) != dataclasses.asdict(spec.config())


def test_levels_need_an_entry_each() -> None:
    with pytest.raises(ConfigurationError, match="one entry a level"):
        PointNet2Config(centres=(64,))
    with pytest.raises(ConfigurationError, match="one entry a level"):
        PointConvConfig(bandwidths=(0.1,))
    with pytest.raises(ConfigurationError, match="last level"):
        PointConvConfig(centres=(64, 16, 4))


@pytest.mark.parametrize("broken", ["missing", "not json", "another model", "other settings", "cut weights"])
def test_a_damaged_model_is_refused(broken: str, tmp_path: Path) -> None:
    spec = model_spec("gcn")
    network = network_of("gcn")
    from punnet.train.weight.deep_inputs import PointInputs
    from punnet.train.weight.deep_model import DeepWeightModel

    DeepWeightModel("gcn", GCNConfig(**SMALL["gcn"], **POINTS), network, PointInputs).save(tmp_path)
    assert spec.load(tmp_path).predict([dome()]).shape == (1,)
    description, weights = tmp_path / "model.json", tmp_path / "network.pt"
    if broken == "missing":
        description.unlink()
    elif broken == "not json":
        description.write_text("{", encoding="utf-8")
    elif broken == "another model":
        spec = model_spec("hgnn")
    elif broken == "other settings":
        description.write_text(description.read_text().replace('"neighbours"', '"friends"'), encoding="utf-8")
    else:
        weights.write_bytes(weights.read_bytes()[:200])
    with pytest.raises((FileFormatError, ConfigurationError), match=r"model\.json|network\.pt|friends"):
        spec.load(tmp_path)
