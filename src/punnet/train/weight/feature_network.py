"""Small networks on a berry's features, beside the trees: smooth where trees are steps, so that their errors differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    import onnx

__all__ = ["FeatureNetworks", "NetworkConfig", "network_nodes"]

_LEAST_SCALE = 1e-9
_INPUT_LIMIT, _TARGET_LIMIT = 3.0, 4.0
"""Half spreads (of the middle nine tenths) and deviations to which inputs and targets are cut, lest one berry rules."""


@dataclass(frozen=True)
class NetworkConfig:
    """Settings of the networks.

    Parameters
    ----------
    members
        Networks, begun from other random numbers, whose answers are averaged.
    widths
        Of the hidden layers (ReLU).
    decay
        Weight of the squared weights in the loss.
    epochs, learning_rate, batch
        Adam's; training ends early after 15 epochs without a better tenth of the berries.

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    """

    members: int = 5
    widths: tuple[int, ...] = (96, 48)
    decay: float = 0.01
    epochs: int = 60
    learning_rate: float = 0.002
    batch: int = 128

    def __post_init__(self) -> None:
        if not self.widths or min(self.members, self.epochs, self.batch, *self.widths) < 1:
            raise ConfigurationError("networks: members, widths, epochs and batch must be ≥ 1")
        if self.decay < 0 or not 0 < self.learning_rate <= 1:
            raise ConfigurationError("networks: decay must be ≥ 0, learning_rate in (0, 1]")


class FeatureNetworks:
    """The mean of some small networks; ``fit`` and ``predict`` as scikit-learn has them.

    Attributes
    ----------
    middle, scale
        (F,) of the inputs; what the networks see is (x − middle) / scale, cut to ±3.
    mean, spread
        Of the target; what the networks say is (y − mean) / spread.
    layers
        Of each network, (weights (in, out), biases (out,)) of its layers.
    """

    def __init__(self, config: NetworkConfig, seed: int) -> None:
        self.config, self.seed = config, seed
        self.middle: NDArray[np.float32] = np.empty(0, np.float32)
        self.scale: NDArray[np.float32] = np.empty(0, np.float32)
        self.mean, self.spread = 0.0, 1.0
        self.layers: list[list[tuple[NDArray[np.float32], NDArray[np.float32]]]] = []

    def fit(self, X: NDArray[np.float32], y: NDArray[np.float64]) -> FeatureNetworks:
        """Learn from N berries' features (N, F) and targets (N,)."""
        import warnings

        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        low, middle, high = np.percentile(X, (5.0, 50.0, 95.0), axis=0)
        self.middle = middle.astype(np.float32)
        half = (high - low) / 2.0
        self.scale = np.where(half < _LEAST_SCALE, 1.0, half).astype(np.float32)
        self.mean, self.spread = float(np.mean(y)), max(float(np.std(y)), _LEAST_SCALE)
        wanted = np.clip((y - self.mean) / self.spread, -_TARGET_LIMIT, _TARGET_LIMIT)
        seen, config = self._seen(X), self.config
        self.layers = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # the epochs are meant to be used up
            for member in range(config.members):
                network = MLPRegressor(
                    hidden_layer_sizes=config.widths,
                    alpha=config.decay,
                    max_iter=config.epochs,
                    learning_rate_init=config.learning_rate,
                    batch_size=min(config.batch, max(1, len(y) // 2)),
                    early_stopping=True,
                    n_iter_no_change=15,
                    random_state=self.seed + member,
                ).fit(seen, wanted)
                pairs = zip(network.coefs_, network.intercepts_, strict=True)
                self.layers.append([(w.astype(np.float32), b.astype(np.float32)) for w, b in pairs])
        return self

    def predict(self, X: NDArray[np.float32]) -> NDArray[np.float64]:
        """(N,) for features (N, F)."""
        told = np.zeros(len(X))
        for layers in self.layers:
            values = self._seen(X)
            for weights, biases in layers[:-1]:
                values = np.maximum(values @ weights + biases, 0.0)
            told += (values @ layers[-1][0] + layers[-1][1])[:, 0]
        return self.mean + self.spread * told / len(self.layers)

    def _seen(self, X: NDArray[np.float32]) -> NDArray[np.float32]:
        scaled = (X - self.middle) / self.scale
        return np.asarray(np.clip(scaled, -_INPUT_LIMIT, _INPUT_LIMIT), dtype=np.float32)


def network_nodes(
    networks: FeatureNetworks, source: str, output: str
) -> tuple[list[onnx.NodeProto], list[onnx.TensorProto]]:
    """ONNX nodes and constants from the value ``source`` (N, F) to ``output`` (N, 1)."""
    from onnx import helper, numpy_helper

    def constant(name: str, value: NDArray[np.float32] | float) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, dtype=np.float32), name))
        return name

    constants: list[onnx.TensorProto] = []
    nodes = [
        helper.make_node("Sub", [source, constant("middle", networks.middle)], ["about"]),
        helper.make_node("Div", ["about", constant("scale", networks.scale)], ["scaled"]),
        helper.make_node(
            "Clip", ["scaled", constant("least", -_INPUT_LIMIT), constant("most", _INPUT_LIMIT)], ["seen"]
        ),
    ]
    answers = []
    for member, layers in enumerate(networks.layers):
        value = "seen"
        for number, (weights, biases) in enumerate(layers):
            name = f"network_{member}_{number}"
            given = [value, constant(f"{name}_weights", weights), constant(f"{name}_biases", biases)]
            nodes.append(helper.make_node("Gemm", given, [name]))
            value = name
            if number + 1 < len(layers):
                value = f"{name}_active"
                nodes.append(helper.make_node("Relu", [name], [value]))
        answers.append(value)
    nodes += [
        helper.make_node("Mean", answers, ["answer"]),
        helper.make_node("Mul", ["answer", constant("answer_spread", networks.spread)], ["answer_wide"]),
        helper.make_node("Add", ["answer_wide", constant("answer_mean", networks.mean)], [output]),
    ]
    return nodes, constants
