"""Graphs that are not a detector's are refused, saying why; those that misbehave when run, too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import ModelProto, TensorProto, helper

from punnet.errors import BundleError, ConfigurationError
from punnet.perception.network import OUTPUTS, Network
from tests.perception.toy_detector import toy_graph

IMAGE = np.zeros((1, 64, 96, 3), dtype=np.uint8)
IMAGE[0, 20:40, 30:60, 0] = 200


def saved(tmp_path: Path, change: Callable[[ModelProto], object] = lambda model: None) -> Path:
    model = toy_graph()
    change(model)
    path = tmp_path / "model.onnx"
    path.write_bytes(model.SerializeToString())
    return path


def initializer(model: ModelProto, name: str, value: np.ndarray) -> None:
    from onnx import numpy_helper

    for tensor in model.graph.initializer:
        if tensor.name == name:
            tensor.CopyFrom(numpy_helper.from_array(value, name))


def rename_input(model: ModelProto) -> None:
    model.graph.input[0].name = "images"
    model.graph.node[0].input[0] = "images"


def further_input(model: ModelProto) -> None:
    model.graph.input.append(helper.make_tensor_value_info("iou", TensorProto.FLOAT, []))


def float_input(model: ModelProto) -> None:
    model.graph.input[0].type.tensor_type.elem_type = TensorProto.FLOAT


def batch_of_two(model: ModelProto) -> None:
    model.graph.input[0].CopyFrom(helper.make_tensor_value_info("image", TensorProto.UINT8, [2, "H", "W", 3]))


def one_size(model: ModelProto) -> None:
    model.graph.input[0].CopyFrom(helper.make_tensor_value_info("image", TensorProto.UINT8, [1, 32, 32, 3]))


def without_ripeness(model: ModelProto) -> None:
    del model.graph.output[-1]


def three_keypoints(model: ModelProto) -> None:
    initializer(model, "maps", np.zeros((1, 3, 8, 8), np.float32))
    heatmaps = model.graph.output[5]
    heatmaps.CopyFrom(helper.make_tensor_value_info("heatmaps", TensorProto.FLOAT, ["N", 3, 8, 8]))


def test_a_detectors_graph_runs(tmp_path: Path) -> None:
    network = Network(saved(tmp_path))
    raw = network.run(IMAGE, 0.5)
    assert raw.boxes.tolist() == [[30, 20, 60, 40]]
    assert raw.labels.tolist() == [0]
    assert len(network.run(IMAGE, 0.95)) == 0
    assert len(network.run(np.zeros_like(IMAGE), 0.5)) == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (rename_input, ["images", "score_threshold", "export"]),
        (further_input, ["iou"]),
        (float_input, ["'image' is float", "needed is uint8"]),
        (batch_of_two, ["(2, ?, ?, 3)", "(1, ?, ?, 3)"]),
        (without_ripeness, ["outputs", "ripeness"]),
        (three_keypoints, ["'heatmaps'", "(?, 5, ?, ?)"]),
    ],
)
def test_a_foreign_graph_is_refused(
    tmp_path: Path, change: Callable[[ModelProto], object], words: list[str]
) -> None:
    with pytest.raises(BundleError) as refusal:
        Network(saved(tmp_path, change))
    for word in ["model.onnx", *words]:
        assert word in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"not an ONNX file", b"\x08\x09\x12\x04toy"])
def test_a_damaged_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(BundleError, match=r"model\.onnx: .*(again|detector's graph)"):
        Network(path)


def test_a_file_that_ends_too_early_is_refused(tmp_path: Path) -> None:
    whole = saved(tmp_path)
    whole.write_bytes(whole.read_bytes()[:-500])
    with pytest.raises(BundleError, match="again"):
        Network(whole)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("ripe", np.array([np.nan], np.float32), "'ripeness' with numbers that are not finite"),
        ("label", np.array([7], np.int64), r"labels \[7\]"),
        ("mask", np.zeros((2, 14, 14), np.float32), "'masks' of shape|could not be run"),
        ("spread", np.array([[-1e6, -1e6, 1e6, 1e6]], np.float32), "far outside the image"),
        ("spread", np.array([[0, 0, -90, 0]], np.float32), "'regions' that end before they begin"),
    ],
)
def test_what_a_graph_gives_is_checked(tmp_path: Path, name: str, value: np.ndarray, words: str) -> None:
    def change(model: ModelProto) -> None:
        initializer(model, name, value)
        if name == "mask":
            # Both rows pass, though there is one box.
            for node in model.graph.node:
                if list(node.output) == ["masks"]:
                    node.CopyFrom(helper.make_node("Identity", ["mask"], ["masks"]))

    with pytest.raises(BundleError, match=words):
        Network(saved(tmp_path, change)).run(IMAGE, 0.5)


def test_a_graph_that_fails_is_named(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"model\.onnx: could not be run on an image of 64×96"):
        Network(saved(tmp_path, one_size)).run(IMAGE, 0.5)


def test_threads_make_no_difference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path)
    one, two = (Network(path, threads=threads).run(IMAGE, 0.5) for threads in (1, 2))
    for name in OUTPUTS:
        assert (getattr(one, name) == getattr(two, name)).all()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert len(Network(path).run(IMAGE, 0.5)) == 1


def test_impossible_threads_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="threads"):
        Network(saved(tmp_path), threads=0)
