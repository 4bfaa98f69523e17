"""A trained model that weighs by features: the files of a weight bundle before they are one."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.outputs import write_bytes, write_text
from punnet.weight.estimator import WeightEstimates, gather_estimates
from punnet.weight.features import feature_matrix, feature_names
from punnet.weight.learned import MODEL_FILE, WEIGHT_FILE, WeightModel, WeightSettings
from punnet.weight.observation import BerryObservation

__all__ = ["COVERAGE", "FeatureModel"]

COVERAGE = 0.9
"""Of the intervals of trained models."""


@dataclass(frozen=True, eq=False)
class FeatureModel:
    """Weighs by features; a :class:`~punnet.train.weight.registry.FittedWeightModel` with intervals.

    Parameters
    ----------
    graph
        The ONNX file that :class:`~punnet.weight.learned.WeightModel` runs.
    settings
        What it is fed with, and how wide intervals are.
    training
        What was chosen on validation.
    """

    graph: bytes
    settings: WeightSettings
    training: Mapping[str, Any] = field(default_factory=dict)

    def predict(self, observations: Sequence[BerryObservation]) -> NDArray[np.float64]:
        """Grams, (N,)."""
        return self._run(observations)[0]

    def weigh(self, observations: Sequence[BerryObservation]) -> WeightEstimates:
        """Grams with intervals, as the bundle will say them."""
        told = zip(observations, *(values.tolist() for values in self._run(observations)), strict=True)
        return gather_estimates([self.settings.answer(*one) for one in told], self.settings.interval.coverage)

    def save(self, folder: Path) -> None:
        """Write ``model.onnx`` and ``weight.json``."""
        write_bytes(folder / MODEL_FILE, self.graph, force=True)
        text = json.dumps(self.to_json(), indent=1, allow_nan=False)
        write_text(folder / WEIGHT_FILE, text + "\n", force=True)

    def to_json(self) -> dict[str, Any]:
        """``weight.json``."""
        return self.settings.to_json() | {"training": dict(self.training)}

    @classmethod
    def load(cls, folder: Path) -> FeatureModel:
        """What :meth:`save` wrote.

        Raises
        ------
        FileFormatError
            If a file is missing or damaged.
        BundleError
            If it is of another version.
        """
        path = folder / WEIGHT_FILE
        try:
            data, graph = json.loads(path.read_text(encoding="utf-8")), (folder / MODEL_FILE).read_bytes()
        except (OSError, ValueError) as error:
            raise FileFormatError(f"{folder}: no trained weight model ({error}); train it anew") from error
        settings = WeightSettings.from_json(data, where=str(path))
        return cls(graph, settings, data.get("training", {}))

    def _run(
        self, observations: Sequence[BerryObservation]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._model.run(feature_matrix(observations, self.settings.feature_groups))

    @cached_property
    def _model(self) -> WeightModel:
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch) / MODEL_FILE
            path.write_bytes(self.graph)
            return WeightModel(path, len(feature_names(self.settings.feature_groups)))
