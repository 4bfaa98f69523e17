"""A weight bundle that can be reckoned by hand: so many grams for each millilitre of revolution."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper

from punnet.bundle import write_bundle
from punnet.weight.features import feature_names
from punnet.weight.learned import IntervalSettings, WeightSettings

GROUPS = ("mask", "metric")
DENSITY, SPREAD = 0.9, 0.1


def toy_graph(
    *,
    density: float = DENSITY,
    spread: float | None = SPREAD,
    groups: tuple[str, ...] = GROUPS,
    input_name: str = "features",
) -> bytes:
    """``grams`` = density · revolution_ml, (N, 1); ``spread`` the same for all, left out if None."""
    names = feature_names(groups)
    column = np.zeros((len(names), 1), dtype=np.float32)
    column[names.index("revolution_ml")] = density
    nodes = [helper.make_node("MatMul", [input_name, "column"], ["grams"])]
    constants = [onnx.numpy_helper.from_array(column, "column")]
    outputs = [helper.make_tensor_value_info("grams", TensorProto.FLOAT, ["n", 1])]
    if spread is not None:
        constants += [
            onnx.numpy_helper.from_array(np.zeros((len(names), 1), dtype=np.float32), "nothing"),
            onnx.numpy_helper.from_array(np.array([spread], dtype=np.float32), "width"),
        ]
        nodes += [
            helper.make_node("MatMul", [input_name, "nothing"], ["zero"]),
            helper.make_node("Add", ["zero", "width"], ["spread"]),
        ]
        outputs.append(helper.make_tensor_value_info("spread", TensorProto.FLOAT, ["n", 1]))
    inputs = [helper.make_tensor_value_info(input_name, TensorProto.FLOAT, ["n", len(names)])]
    graph = helper.make_graph(nodes, "toy", inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    return bytes(model.SerializeToString())


def toy_settings(**changes: Any) -> dict[str, Any]:
    """``weight.json`` with some fields replaced."""
    settings = WeightSettings("toy", GROUPS, IntervalSettings(0.9, -1.5, 2.0))
    return settings.to_json() | changes


def write_toy_bundle(
    folder: Path, *, graph: bytes | None = None, settings: dict[str, Any] | None = None
) -> Path:
    write_bundle(
        folder,
        name="toy-scale",
        kind="weight",
        files={
            "model.onnx": toy_graph() if graph is None else graph,
            "weight.json": toy_settings() if settings is None else settings,
        },
        licence="MIT",
        command="made by a test",
    )
    return folder
