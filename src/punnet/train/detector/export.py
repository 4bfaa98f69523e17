"""A trained detector to ONNX: boxes to heat-maps in the graph; mask pasting and heat-map decoding outside."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from punnet.train.detector.network import BerryDetector

__all__ = ["OnnxGraph", "export_onnx"]

OPSET = 17
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


def export_onnx(network: BerryDetector, path: Path) -> None:
    """Write ``network`` as ONNX with half-precision weights that are cast when loaded.

    Parameters
    ----------
    network
        Trained; it is put into evaluation mode.
    path
        Where to; its folder exists.
    """
    import onnx

    network.float().to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    graph = OnnxGraph(network).eval()
    example = torch.from_numpy(np.random.default_rng(0).integers(0, 256, (1, 384, 512, 3), dtype=np.uint8))
    dynamic = {name: {0: "berries"} for name in OUTPUTS} | {"image": {1: "height", 2: "width"}}
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            graph,
            (example, torch.tensor(0.0)),
            str(path),
            input_names=INPUTS,
            output_names=OUTPUTS,
            dynamic_axes=dynamic,
            opset_version=OPSET,
            dynamo=False,
        )
    onnx.save(halved(onnx.load(str(path))), str(path))


def halved(model):  # type: ignore[no-untyped-def]
    """The model with every large float32 initialiser stored as float16 and cast when the model is loaded."""
    from onnx import TensorProto, helper, numpy_helper

    graph = model.graph
    casts, stored = [], []
    for tensor in graph.initializer:
        if tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < 64:
            stored.append(tensor)
            continue
        values = numpy_helper.to_array(tensor)
        name = f"{tensor.name}_half"
        stored.append(numpy_helper.from_array(values.astype(np.float16), name))
        casts.append(helper.make_node("Cast", [name], [tensor.name], to=TensorProto.FLOAT))
    nodes = casts + list(graph.node)
    del graph.initializer[:], graph.node[:]
    graph.initializer.extend(stored)
    graph.node.extend(nodes)
    return model
