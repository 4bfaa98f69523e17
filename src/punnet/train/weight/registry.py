"""The weight estimators that can be trained, by name.

A model is one file with a config, ``fit`` and a fitted model, and one line here: ``module:ATTRIBUTE`` of its
:class:`ModelSpec`. Modules are imported when their model is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.weight.observation import BerryObservation
from punnet.weight.samples import WeightSamples

__all__ = ["MODELS", "Fit", "FittedWeightModel", "ModelSpec", "Tell", "model_spec"]

MODELS: dict[str, str] = {
    "pointconv": "punnet.train.weight.pointconv:POINTCONV",
    "pointnet": "punnet.train.weight.pointnet:POINTNET",
    "pointnet2": "punnet.train.weight.pointnet2:POINTNET2",
    "dgcnn": "punnet.train.weight.dgcnn:DGCNN",
    "gcn": "punnet.train.weight.gcn:GCN",
    "hgnn": "punnet.train.weight.hgnn:HGNN",
    "efficientnet_b0": "punnet.train.weight.efficientnet:EFFICIENTNET_B0",
    "efficientnet_b7": "punnet.train.weight.efficientnet:EFFICIENTNET_B7",
    "forest": "punnet.train.weight.forest:FOREST",
    "forest_pca": "punnet.train.weight.forest:FOREST_PCA",
    "shape": "punnet.train.weight.shape:SHAPE",
}
"""In the order of figure 4.12, ours last."""

Tell = Callable[[str], None]
"""Takes a line on how training goes."""


class FittedWeightModel(Protocol):
    """A trained model."""

    def predict(self, observations: Sequence[BerryObservation]) -> NDArray[np.float64]:
        """Grams, (N,) of N berries; the same whatever else is asked at the same time."""
        ...

    def save(self, folder: Path) -> None:
        """Write what :attr:`ModelSpec.load` needs into an existing folder: JSON, ONNX, state dicts; no pickles."""
        ...


class Fit(Protocol):
    """Training of one model."""

    def __call__(
        self,
        train: WeightSamples,
        validation: WeightSamples,
        config: Any,
        *,
        seed: int,
        progress: Tell,
        folder: Path,
    ) -> FittedWeightModel:
        """Train on ``train``; ``validation`` decides when to stop and which settings are kept.

        Once that is decided, a model may learn from both. What is set aside for tests is in neither.

        ``folder`` exists and is the model's own: checkpoints go there, and what an earlier run that was stopped left
        there is gone on with. ``progress`` is told how it goes.
        """
        ...


@dataclass(frozen=True)
class ModelSpec:
    """How a model is trained and loaded.

    Parameters
    ----------
    name
        As in :data:`MODELS`.
    title
        As tables print it.
    config
        Frozen dataclass of its settings; ``config()`` is what is trained by default.
    fit
        Trains.
    load
        A trained model from the folder that :meth:`FittedWeightModel.save` filled.
    quick
        Settings of ``--quick`` runs, which must fit all models into an hour on two cores.
    learns_both
        Whether it learns from the validation plants too once settings are chosen: then they tell nothing of it.
    learns_fast
        Whether thousands of berries take minutes, so that it can learn from more plants than the others.
    thesis
        Percentage of correct weights by tolerance that the thesis gives for it (section 4.3.3).
    """

    name: str
    title: str
    config: type[Any]
    fit: Fit
    load: Callable[[Path], FittedWeightModel]
    quick: Mapping[str, Any] = field(default_factory=dict)
    learns_both: bool = False
    learns_fast: bool = False
    thesis: Mapping[float, float] = field(default_factory=dict)


def model_spec(name: str) -> ModelSpec:
    """The model of that name.

    Raises
    ------
    ConfigurationError
        If there is none, or what it is made with is not installed.
    """
    if name not in MODELS:
        raise ConfigurationError(f"no weight model '{name}'; there are {', '.join(MODELS)}")
    module, _, attribute = MODELS[name].partition(":")
    try:
        spec = getattr(import_module(module), attribute)
    except ModuleNotFoundError as error:
        raise ConfigurationError(
            f"model '{name}' needs {error.name}, which is not installed: pip install 'punnet[train]'"
        ) from error
    assert isinstance(spec, ModelSpec)
    return spec
