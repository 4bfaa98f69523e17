"""Autoencoders trained elsewhere: weights in Keras' layout, by Keras' names, into ours.

Layers are told apart by what they hold and counted in the order of the numbers in their names, as Keras hands them out
(``conv2d``, ``conv2d_1``, …); whatever stands before the layer's name or behind the weight's (``encoder/``, ``:0``) is of no
account. A variational encoder's two dense layers may be named by what they give (``z_mean``, ``z_log_var``).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from punnet.errors import ConfigurationError
from punnet.train.planner.autoencoder import LATENT, Decoder, Encoder

__all__ = ["from_keras_arrays"]

FEATURES = 512
WEIGHTS = ("kernel", "bias", "gamma", "beta", "moving_mean", "moving_variance")
TURNS = {"convolution": (3, 2, 0, 1), "transposed": (3, 2, 0, 1), "dense": (1, 0)}
"""Axes of Keras' kernels in the order that PyTorch has them."""
Layer = dict[str, NDArray[np.float32]]


def from_keras_arrays(arrays: Mapping[str, Any]) -> tuple[Encoder, Decoder | None]:
    """Encoder, and decoder if there is one, with weights that Keras had.

    Parameters
    ----------
    arrays
        Weights by name, as ``{w.path: w.numpy() for w in model.weights}`` gives them (or ``w.name``): kernels of convolutions
        (height, width, in, out), of transposed ones (height, width, out, in), of dense layers (in, out).

    Returns
    -------
    encoder
        Variational if there are two dense layers from 512 to 256; in evaluation mode.
    decoder
        In evaluation mode; None if there are no transposed convolutions.

    Raises
    ------
    ConfigurationError
        If layers are missing, too many or of another shape; the message names them.
    """
    layers = _layers(arrays)
    kinds: dict[str, list[tuple[str, Layer]]] = {"convolution": [], "transposed": [], "norm": [], "dense": []}
    for name, layer in layers.items():
        kinds[_kind(name, layer)].append((name, layer))
    with_decoder = bool(kinds["transposed"])
    inwards = [item for item in kinds["dense"] if item[1]["kernel"].shape == (FEATURES, LATENT)]
    outwards = [item for item in kinds["dense"] if item[1]["kernel"].shape == (LATENT, FEATURES)]
    wanted = {"convolution": 3, "transposed": 5 if with_decoder else 0, "norm": 7 if with_decoder else 3}
    found = {kind: len(kinds[kind]) for kind in wanted}
    if found != wanted or len(inwards) not in (1, 2) or len(outwards) != int(with_decoder):
        raise ConfigurationError(
            f"Keras arrays: not the autoencoder of appendix A: layers {', '.join(layers)}; needed are 3 convolutions, 3 batch "
            f"normalisations and 1 or 2 dense layers ({FEATURES}, {LATENT}), and for a decoder 5 transposed convolutions, 4 "
            f"more batch normalisations and a dense layer ({LATENT}, {FEATURES})"
        )
    encoder = Encoder(variational=len(inwards) == 2)
    inwards.sort(key=lambda item: bool(re.search(r"var|sigma|std", item[0])))
    _fill(encoder.bottleneck, inwards[0], "dense")
    if encoder.log_variance is not None:
        _fill(encoder.log_variance, inwards[1], "dense")
    for block, convolution, normalisation in zip(
        encoder.blocks, kinds["convolution"], kinds["norm"][:3], strict=True
    ):
        assert isinstance(block, nn.Sequential)
        _fill(block[0], convolution, "convolution")
        _normalise(block[3], normalisation)
    if not with_decoder:
        return encoder.eval(), None
    decoder = Decoder()
    _fill(decoder.dense, outwards[0], "dense")
    convolutions = [module for module in decoder.blocks if isinstance(module, nn.ConvTranspose2d)]
    for module, transposed in zip(convolutions, kinds["transposed"], strict=True):
        _fill(module, transposed, "transposed")
    norms = [module for module in decoder.blocks if isinstance(module, nn.BatchNorm2d)]
    for norm, normalisation in zip(norms, kinds["norm"][3:], strict=True):
        _normalise(norm, normalisation)
    return encoder.eval(), decoder.eval()


def _layers(arrays: Mapping[str, Any]) -> dict[str, Layer]:
    """Weights by layer, layers in the order of their numbers."""
    layers: dict[str, Layer] = {}
    for name, values in arrays.items():
        parts = name.split(":")[0].split("/")
        if len(parts) < 2 or parts[-1] not in WEIGHTS:
            raise ConfigurationError(f"Keras arrays: '{name}' is no weight's name, as dense/kernel:0 is")
        layers.setdefault(parts[-2], {})[parts[-1]] = np.asarray(values, dtype=np.float32)

    def number(name: str) -> int:
        digits = re.search(r"_(\d+)$", name)
        return int(digits[1]) if digits else 0

    return dict(sorted(layers.items(), key=lambda item: number(item[0])))


def _kind(name: str, layer: Layer) -> str:
    if "moving_mean" in layer:
        return "norm"
    if layer.get("kernel", np.zeros(0)).ndim == 2:
        return "dense"
    return "transposed" if "transpose" in name else "convolution"


def _fill(module: Any, layer: tuple[str, Layer], kind: str) -> None:
    name, weights = layer
    _put(module.weight, weights.get("kernel"), f"{name}/kernel", TURNS[kind])
    _put(module.bias, weights.get("bias"), f"{name}/bias")


def _normalise(module: Any, layer: tuple[str, Layer]) -> None:
    name, weights = layer
    for place, weight in zip(
        (module.weight, module.bias, module.running_mean, module.running_var), WEIGHTS[2:], strict=True
    ):
        _put(place, weights.get(weight), f"{name}/{weight}")


@torch.no_grad()
def _put(
    place: Tensor, values: NDArray[np.float32] | None, name: str, turn: tuple[int, ...] | None = None
) -> None:
    if values is None:
        raise ConfigurationError(f"Keras arrays: '{name}' is missing")
    if turn is not None and values.ndim == len(turn):
        values = values.transpose(turn)
    if tuple(place.shape) != values.shape:
        raise ConfigurationError(
            f"Keras arrays: '{name}' has another shape than the layer of appendix A: {values.shape} in place of "
            f"{tuple(place.shape)} (axes in PyTorch's order)"
        )
    place.copy_(torch.from_numpy(np.ascontiguousarray(values)))
