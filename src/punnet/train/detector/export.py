"""A trained detector to ONNX: boxes to heat-maps in the graph; mask pasting and heat-map decoding outside."""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from punnet.train.detector.network import BerryDetector

if TYPE_CHECKING:
    import onnx

__all__ = [
    "INPUTS",
    "OUTPUTS",
    "OnnxGraph",
    "export_onnx",
    "halve",
    "is_halved",
    "rounded",
    "weights_of_onnx",
]

OPSET = 17
TRACED = (128, 160)  # any size does: none is kept
LEAST_HALVED = 64
OWNER = "network."  # how OnnxGraph calls the network, before each name
HALF = "_half"  # behind the name of a weight that is stored in half precision
INPUTS = ["image", "score_threshold"]
OUTPUTS = ["boxes", "scores", "labels", "regions", "masks", "heatmaps", "visibility", "ripeness"]


class OnnxGraph(nn.Module):
    """The network as it is flown: one image of bytes in, arrays of detections out."""

    def __init__(self, network: BerryDetector) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor, score_threshold: Tensor) -> tuple[Tensor, ...]:
        """Detections above the threshold in ``image`` (1, H, W, 3) uint8, best first.

        Returns
        -------
        boxes (N, 4), scores (N,), labels (N,) 0 or 1, regions (N, 4), masks (N, M, M), heatmaps (N, 5, K, K),
        visibility (N, 5, 4), ripeness (N,).
        """
        pixels = image.permute(0, 3, 1, 2).float()
        self.network.heads.score_thresh = score_threshold
        found = self.network(pixels)[0]
        return (
            found["boxes"],
            found["scores"],
            found["labels"] - 1,
            found["regions"],
            found["masks"],
            found["heatmaps"],
            found["visibility"],
            found["ripeness"],
        )


def export_onnx(network: BerryDetector, path: Path) -> BerryDetector:
    """Write ``network`` as ONNX, its weights in half precision that is cast when the file is loaded.

    Batch normalisation stays a node of its own (the runtime folds it), so that weights are rounded as they are, not
    multiplied by something that only the export knows: PyTorch can then calculate with the very same numbers.

    Parameters
    ----------
    network
        Trained. It is left as it is.
    path
        Where to; its folder exists.

    Returns
    -------
    BerryDetector
        The network as the file has it: evaluation mode, weights rounded.
    """
    import onnx

    stored = rounded(network)
    example = torch.from_numpy(np.random.default_rng(0).integers(0, 256, (1, *TRACED, 3), dtype=np.uint8))
    dynamic = {name: {0: "berries"} for name in OUTPUTS} | {"image": {1: "height", 2: "width"}}
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # of the tracer's, which can't know that sizes stay open
        torch.onnx.export(
            OnnxGraph(stored).eval(),
            (example, torch.tensor(0.0)),
            str(path),
            input_names=INPUTS,
            output_names=OUTPUTS,
            dynamic_axes=dynamic,
            opset_version=OPSET,
            training=torch.onnx.TrainingMode.PRESERVE,
            do_constant_folding=False,
            dynamo=False,
        )
    model = onnx.load(str(path))
    halve(model)
    onnx.save(model, str(path))
    return stored


def rounded(network: BerryDetector) -> BerryDetector:
    """A copy for evaluation whose weights are those that half precision can hold."""
    copied = copy.deepcopy(network).float().to(memory_format=torch.contiguous_format).eval()
    for parameter in copied.parameters():
        if is_halved(parameter.shape):
            parameter.data = parameter.data.half().float()
    return copied


def is_halved(shape: Sequence[int]) -> bool:
    """Whether an array of this shape is kept in half precision: weights are, biases and statistics are not."""
    return len(shape) >= 2 and math.prod(shape) >= LEAST_HALVED


def halve(model: onnx.ModelProto) -> None:
    """Store the weights among the model's float32 initialisers as float16, with a cast to float32 behind each."""
    from onnx import TensorProto, helper, numpy_helper

    graph = model.graph
    casts, stored = [], []
    for tensor in graph.initializer:
        if tensor.data_type != TensorProto.FLOAT or not is_halved(tensor.dims):
            stored.append(tensor)
            continue
        name = f"{tensor.name}{HALF}"
        stored.append(numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float16), name))
        casts.append(helper.make_node("Cast", [name], [tensor.name], to=TensorProto.FLOAT))
    nodes = casts + list(graph.node)
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(stored)
    graph.node.extend(nodes)


def weights_of_onnx(path: Path) -> dict[str, Tensor]:
    """The weights that :func:`export_onnx` wrote, by the names they have in the network, in single precision.

    The exporter stores equal arrays once; the other names are then those of ``Identity`` nodes.
    """
    import onnx
    from onnx import numpy_helper

    graph = onnx.load(str(path)).graph
    arrays = {t.name.removesuffix(HALF): numpy_helper.to_array(t) for t in graph.initializer}
    for node in graph.node:
        if node.op_type == "Identity" and node.input[0] in arrays:
            arrays[node.output[0]] = arrays[node.input[0]]
    return {
        name.removeprefix(OWNER): torch.from_numpy(np.array(array, dtype=np.float32))
        for name, array in arrays.items()
        if name.startswith(OWNER)
    }
