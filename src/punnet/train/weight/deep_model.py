"""A trained deep weight estimator: weighs observations, and is kept as JSON and a state dict."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.outputs import write_bytes, write_text
from punnet.train.detector.config import config_from_json, config_to_json
from punnet.train.weight.deep_inputs import BerryInputs
from punnet.train.weight.deep_layers import WeightNetwork
from punnet.weight.observation import BerryObservation

__all__ = ["DeepWeightModel", "load_deep_model"]

SCHEMA = "punnet-deep-weight/1"
DESCRIPTION_FILE = "model.json"
WEIGHTS_FILE = "network.pt"
_BATCH = 32
_LEAST_GRAMS = 0.1


@dataclass(frozen=True, eq=False)
class DeepWeightModel:
    """A trained network with what it takes to weigh.

    Parameters
    ----------
    name
        In the registry.
    config
        Its settings.
    network
        Trained.
    inputs
        Makes the network's inputs of observations, by the settings.
    curve
        Validation of each epoch: ``epoch``, ``loss``, ``mape``, ``pcw20``.
    """

    name: str
    config: Any
    network: WeightNetwork
    inputs: Callable[[Any, Any], BerryInputs]
    curve: tuple[Mapping[str, float], ...] = ()

    def predict(self, observations: Sequence[BerryObservation]) -> NDArray[np.float64]:
        """Grams (N,), at least 0.1 (the linear output itself may be negative)."""
        grams = [np.empty(0)]
        self.network.eval()
        with torch.inference_mode():
            for first in range(0, len(observations), _BATCH):
                some = observations[first : first + _BATCH]
                still = self.inputs(some, self.config).still(np.arange(len(some)))
                grams.append(self.network(still).double().numpy())
        return np.maximum(np.concatenate(grams), _LEAST_GRAMS)

    def save(self, folder: Path) -> None:
        """Write ``model.json`` and ``network.pt``, a state dict that loads without unpickling code."""
        weights = io.BytesIO()
        torch.save(self.network.state_dict(), weights)
        write_bytes(folder / WEIGHTS_FILE, weights.getvalue(), force=True)
        description = {
            "schema": SCHEMA,
            "model": self.name,
            "config": config_to_json(self.config),
            "curve": [dict(epoch) for epoch in self.curve],
        }
        write_text(folder / DESCRIPTION_FILE, json.dumps(description, indent=1) + "\n", force=True)


def load_deep_model(
    folder: Path,
    name: str,
    config: type[Any],
    network: Callable[[Any], WeightNetwork],
    inputs: Callable[[Any, Any], BerryInputs],
) -> DeepWeightModel:
    """The model ``name`` that :meth:`DeepWeightModel.save` wrote into ``folder``.

    Parameters
    ----------
    folder
        Holds ``model.json`` and ``network.pt``.
    name
        The model expected.
    config, network, inputs
        Its settings' class, and what builds the network and makes its inputs.

    Raises
    ------
    FileFormatError
        If a file is missing or damaged, or it is another model.
    """
    path = folder / DESCRIPTION_FILE
    try:
        described = json.loads(path.read_text(encoding="utf-8"))
        schema, found = described["schema"], described["model"]
        settings, curve = described["config"], tuple(described["curve"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileFormatError(f"{path}: not the description of a deep weight model ({error})") from error
    if (schema, found) != (SCHEMA, name):
        raise FileFormatError(f"{path}: is {found} ({schema}), not {name} ({SCHEMA})")
    settings = config_from_json(config, {key: _tuples(value) for key, value in settings.items()})
    model = DeepWeightModel(name, settings, network(settings), inputs, curve)
    weights = folder / WEIGHTS_FILE
    try:
        model.network.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True))
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise FileFormatError(
            f"{weights}: not the weights of this {name} ({str(error).splitlines()[0]})"
        ) from error
    return model


def _tuples(value: Any) -> Any:
    """Lists of JSON as tuples, all the way down."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
