"""A detector's graph that needs no training: it calls the box around all that is red one ripe berry.

It obeys the contract of ``punnet.perception.network`` to the letter, so what runs it and reads it can be tested whole.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from punnet.bundle import write_bundle
from punnet.perception.learned import DETECTOR_FILE, MODEL_FILE, DetectorSettings

SETTINGS = DetectorSettings(
    backbone="toy",
    longest_side=640,
    stride=32,
    mask_threshold=0.5,
    score_threshold=0.5,
    keypoint_sigmas=(0.1,) * 5,
)
MASK_CELLS, MAP_CELLS, SCORE = 14, 28, 0.9
MARGIN = 0.5  # of the box, on each side
# Where the key-points lie in the box (u, v as shares of it); the picking point above it.
PLACES = ((0.5, -0.3), (0.5, 0.05), (0.5, 0.95), (0.1, 0.4), (0.9, 0.4))
VISIBILITY = (3, 2, 1, 2, 0)


def ellipse() -> np.ndarray:
    """(M, M) probability of a mask that fills its box, in the middle of the region."""
    cells = (np.arange(MASK_CELLS) + 0.5) / MASK_CELLS * (1 + 2 * MARGIN) - MARGIN
    radius = np.hypot(*np.meshgrid(2 * cells - 1, 2 * cells - 1))
    return np.clip(0.5 + 2 * (1 - radius), 0, 1).astype(np.float32)


def heatmaps() -> np.ndarray:
    """(5, K, K) logits with their peaks at :data:`PLACES`."""
    cells = (np.arange(MAP_CELLS) + 0.5) / MAP_CELLS * (1 + 2 * MARGIN) - MARGIN
    return np.stack(
        [-20 * np.hypot(*np.meshgrid(cells - u, cells - v)).astype(np.float32) for u, v in PLACES]
    )


def constants() -> dict[str, np.ndarray]:
    """The graph's initialisers."""
    return {
        "weights": np.array([1, -1, 0], np.float32).reshape(3, 1),
        "red": np.array(60.0, np.float32),
        "rows": np.array([1], np.int64),
        "columns": np.array([2], np.int64),
        "one": np.array([1], np.int64),
        "score": np.array([SCORE], np.float32),
        "label": np.array([0], np.int64),
        "spread": np.array([[-MARGIN, -MARGIN, MARGIN, MARGIN]], np.float32),
        "mask": ellipse()[None],
        "maps": heatmaps()[None],
        "seen": np.eye(4, dtype=np.float32)[list(VISIBILITY)][None],
        "ripe": np.array([0.95], np.float32),
    }


def toy_graph() -> onnx.ModelProto:
    """Image and score threshold in, one berry or none out."""

    def edges(axis: str, other: str, low: str, high: str) -> list[onnx.NodeProto]:
        """First and one past the last red row or column, as (1, 1) floats."""
        return [
            helper.make_node("ReduceMax", ["is_red", other], [f"any_{low}"], keepdims=0),
            helper.make_node("ArgMax", [f"any_{low}"], [f"first_{low}"], axis=1, keepdims=1),
            helper.make_node("ArgMax", [f"any_{low}"], [f"last_{low}"], axis=1, keepdims=1, select_last_index=1),
            helper.make_node("Add", [f"last_{low}", "one"], [f"end_{low}"]),
            helper.make_node("Cast", [f"first_{low}"], [low], to=TensorProto.FLOAT),
            helper.make_node("Cast", [f"end_{low}"], [high], to=TensorProto.FLOAT),
        ]  # fmt: skip

    nodes = [
        helper.make_node("Cast", ["image"], ["pixels"], to=TensorProto.FLOAT),
        helper.make_node("MatMul", ["pixels", "weights"], ["redness4"]),
        helper.make_node("Squeeze", ["redness4", "last"], ["redness"]),
        helper.make_node("Greater", ["redness", "red"], ["is_red_bool"]),
        helper.make_node("Cast", ["is_red_bool"], ["is_red"], to=TensorProto.FLOAT),
        *edges("rows", "columns", "y0", "y1"),
        *edges("columns", "rows", "x0", "x1"),
        helper.make_node("Concat", ["x0", "y0", "x1", "y1"], ["box"], axis=1),
        helper.make_node("Sub", ["x1", "x0"], ["w"]),
        helper.make_node("Sub", ["y1", "y0"], ["h"]),
        helper.make_node("Concat", ["w", "h", "w", "h"], ["extent"], axis=1),
        helper.make_node("Mul", ["extent", "spread"], ["grow"]),
        helper.make_node("Add", ["box", "grow"], ["region"]),
        # A berry is there if anything is red and the score reaches the threshold.
        helper.make_node("ReduceMax", ["is_red", "both"], ["any"], keepdims=0),
        helper.make_node("Cast", ["any"], ["any_bool"], to=TensorProto.BOOL),
        helper.make_node("GreaterOrEqual", ["score", "score_threshold"], ["sure"]),
        helper.make_node("And", ["any_bool", "sure"], ["keep"]),
        *(
            helper.make_node("Compress", [source, "keep"], [target], axis=0)
            for source, target in (
                ("box", "boxes"),
                ("score", "scores"),
                ("label", "labels"),
                ("region", "regions"),
                ("mask", "masks"),
                ("maps", "heatmaps"),
                ("seen", "visibility"),
                ("ripe", "ripeness"),
            )
        ),
    ]
    values = constants() | {"last": np.array([3], np.int64), "both": np.array([1, 2], np.int64)}
    floats, whole = TensorProto.FLOAT, TensorProto.INT64
    outputs: list[tuple[str, int, list[Any]]] = [
        ("boxes", floats, ["N", 4]),
        ("scores", floats, ["N"]),
        ("labels", whole, ["N"]),
        ("regions", floats, ["N", 4]),
        ("masks", floats, ["N", MASK_CELLS, MASK_CELLS]),
        ("heatmaps", floats, ["N", 5, MAP_CELLS, MAP_CELLS]),
        ("visibility", floats, ["N", 5, 4]),
        ("ripeness", floats, ["N"]),
    ]
    graph = helper.make_graph(
        nodes,
        "toy",
        [
            helper.make_tensor_value_info("image", TensorProto.UINT8, [1, "H", "W", 3]),
            helper.make_tensor_value_info("score_threshold", floats, []),
        ],
        [helper.make_tensor_value_info(*output) for output in outputs],
        [numpy_helper.from_array(value, name) for name, value in values.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)


def write_toy_bundle(folder: Path, model: onnx.ModelProto | bytes | None = None, **changes: Any) -> Path:
    """A bundle of kind ``detector``; ``changes`` replace fields of ``detector.json`` or of the manifest."""
    model = toy_graph() if model is None else model
    settings = SETTINGS.to_json()
    details = {"name": "toy", "kind": "detector", "licence": "Apache-2.0", "command": "none: a test's own"}
    for name, value in changes.items():
        (settings if name in settings else details)[name] = value
    write_bundle(
        folder,
        files={
            MODEL_FILE: model if isinstance(model, bytes) else model.SerializeToString(),
            DETECTOR_FILE: settings,
        },
        **details,
    )
    return folder
