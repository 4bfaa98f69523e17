"""A trained planner to ONNX: what :class:`punnet.planning.learned.MovementModel` runs."""

from __future__ import annotations

import copy
import warnings
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from punnet.planning.reaches import DEGREES, SIDE
from punnet.train.detector.export import halve, is_halved
from punnet.train.planner.deep import DeepPrediction
from punnet.train.planner.full import EndModel, FullPrediction
from punnet.train.planner.network import DeepProMP

__all__ = ["export_planner"]

OPSET = 17


class _DeepGraph(nn.Module):
    """Picture and box to mean (N, 7, B) and block-diagonal factor (N, 7·B, 7·B)."""

    def __init__(self, network: DeepProMP) -> None:
        super().__init__()
        self.network = network

    def forward(self, picture: Tensor, box: Tensor) -> tuple[Tensor, Tensor]:
        centres = (box[:, :2] + box[:, 2:]) / 2.0
        mean, factor = self.network(picture, centres)
        whole = torch.einsum("ndbc,de->ndbec", factor, torch.eye(DEGREES))
        size = DEGREES * self.network.heads.functions
        return mean, whole.reshape(-1, size, size)


class _EndGraph(nn.Module):
    """Features to mean (N, 7·B) and root of its doubt (N, 7·B, 7), in double precision."""

    centre: Tensor
    scale: Tensor
    coefficients: Tensor
    middle: Tensor
    precision: Tensor
    doubt: Tensor

    def __init__(self, fitted: FullPrediction, ends: EndModel) -> None:
        super().__init__()
        regression = ends.regression
        for name, values in (
            ("centre", regression.centre),
            ("scale", regression.scale),
            ("coefficients", regression.coefficients @ fitted.gain.T),
            ("middle", fitted.middle + fitted.gain @ regression.intercept),
            ("precision", regression.precision),
            ("doubt", ends.doubt),
        ):
            self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(values)))
        self.rows = regression.rows

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        scaled = (features - self.centre) / self.scale
        leverage = ((scaled @ self.precision) * scaled).sum(dim=1) + 1.0 / self.rows
        doubt = self.doubt.unsqueeze(0) * torch.sqrt(1.0 + leverage)[:, None, None]
        return self.middle + scaled @ self.coefficients, doubt


class _FullGraph(nn.Module):
    """Box, and light if that is looked at, to mean (N, 7, B) and factor (N, 7·B, R): :meth:`FullPrediction.predict`."""

    rest: Tensor

    def __init__(self, fitted: FullPrediction) -> None:
        super().__init__()
        self.functions = fitted.functions
        self.by_centre = _EndGraph(fitted, fitted.by_centre)
        self.closer = None if fitted.closer is None else _EndGraph(fitted, fitted.closer)
        self.cues = () if fitted.closer is None else fitted.closer.cues
        self.register_buffer("rest", torch.from_numpy(np.ascontiguousarray(fitted.rest)))

    def forward(self, box: Tensor, light: Tensor | None = None) -> tuple[Tensor, Tensor]:
        values = box.double()
        u = (values[:, 0] + values[:, 2]) / 2.0 - 0.5
        v = (values[:, 1] + values[:, 3]) / 2.0 - 0.5
        features = torch.stack((u, v, u * u, u * v, v * v), dim=1)
        mean, doubt = self.by_centre(features)
        if self.closer is not None:
            more = []
            if "size" in self.cues:
                more.append(values[:, 2:] - values[:, :2])
            if light is not None:
                more.append(light.double().exp()[:, None])
            cues = torch.cat(more, dim=1)
            known = (cues > 0.0).all(dim=1)  # NaN is not
            told = torch.where(known[:, None], cues, torch.ones_like(cues)).log()
            close, close_doubt = self.closer(torch.cat((features, told), dim=1))
            mean = torch.where(known[:, None], close, mean)
            doubt = torch.where(known[:, None, None], close_doubt, doubt)
        rest = self.rest.unsqueeze(0) + 0.0 * doubt[:, :1, :1]
        return mean.reshape(-1, DEGREES, self.functions), torch.cat((rest, doubt), dim=2)


def export_planner(prediction: DeepPrediction | FullPrediction, path: Path) -> None:
    """Write the graph; a network's weights in half precision, which is cast when the file is loaded.

    Parameters
    ----------
    prediction
        Trained; left as it is.
    path
        Where to; its folder exists.
    """
    import onnx

    deep = isinstance(prediction, DeepPrediction)
    box = torch.tensor([[0.4, 0.4, 0.6, 0.6], [0.1, 0.2, 0.3, 0.4]])
    if isinstance(prediction, DeepPrediction):
        network = copy.deepcopy(prediction.network).eval()
        for parameter in network.parameters():
            if is_halved(parameter.shape):
                parameter.data = parameter.data.half().float()
        graph: nn.Module = _DeepGraph(network)
        example: tuple[Tensor, ...] = (torch.zeros((2, SIDE, SIDE, 3), dtype=torch.uint8), box)
        names = ["picture", "box"]
    else:
        graph, example, names = _FullGraph(prediction), (box,), ["box"]
        if prediction.closer is not None and "light" in prediction.closer.cues:
            example, names = (box, torch.tensor([0.0, float("nan")])), ["box", "light"]
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # of the tracer's, which can't know that the batch stays open
        torch.onnx.export(
            graph.eval(),
            example,
            str(path),
            input_names=names,
            output_names=["mean", "factor"],
            dynamic_axes={name: {0: "photographs"} for name in (*names, "mean", "factor")},
            opset_version=OPSET,
            do_constant_folding=False,
            dynamo=False,
        )
    model = onnx.load(str(path))
    if deep:
        halve(model)
    onnx.save(model, str(path))
