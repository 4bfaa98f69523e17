"""A trained model as a weight estimator: features in, grams and an interval out, on ONNX Runtime."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.bundle import Bundle, Graph, Manifest, load_bundle
from punnet.errors import BundleError, ConfigurationError
from punnet.scene import Frame, Strawberries
from punnet.weight.estimator import WeightEstimates, gather_estimates
from punnet.weight.features import feature_matrix, feature_names
from punnet.weight.observation import BerryObservation, observe

__all__ = [
    "MODEL_FILE",
    "WEIGHT_FILE",
    "WEIGHT_SCHEMA",
    "IntervalSettings",
    "LearnedWeightEstimator",
    "WeightModel",
    "WeightSettings",
]

WEIGHT_SCHEMA = "punnet-weight/1"
WEIGHT_FILE = "weight.json"
MODEL_FILE = "model.onnx"
_INTERVAL_KIND = "split-conformal"
_MAKE_AGAIN = "train it again with `punnet train weight`"


@dataclass(frozen=True)
class IntervalSettings:
    """How wide an interval is: grams · exp(low · s) … grams · exp(high · s), s the berry's spread.

    Parameters
    ----------
    coverage
        Share of berries whose true weight is to lie inside, in (0, 1).
    low, high
        Quantiles of ln(true / estimated) / s over berries that the model did not learn from (split-conformal);
        low ≤ 0 ≤ high.

    Raises
    ------
    BundleError
        If a number is out of its range.
    """

    coverage: float
    low: float
    high: float

    def __post_init__(self) -> None:
        if not all(_is_number(value) for value in (self.coverage, self.low, self.high)):
            raise BundleError(f"interval: coverage, low and high must be numbers, got {self}")
        if not 0 < self.coverage < 1 or not self.low <= 0 <= self.high:
            raise BundleError(f"interval: needs coverage in (0, 1) and low ≤ 0 ≤ high, got {self}")


@dataclass(frozen=True)
class WeightSettings:
    """``weight.json`` of a bundle of kind ``weight``.

    Parameters
    ----------
    model
        Name of the model in the training registry.
    feature_groups
        What the graph is fed with, see :mod:`punnet.weight.features`.
    interval
        How wide intervals are.
    detected
        The same of berries that a detector has found, if the model was calibrated on such: their errors have other tails.

    Raises
    ------
    BundleError
        If a value is out of its range or a group of features unknown.
    """

    model: str
    feature_groups: tuple[str, ...]
    interval: IntervalSettings
    detected: IntervalSettings | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.model, str):
            raise BundleError(f"model must be a text, got {self.model!r}")
        if not isinstance(self.feature_groups, list | tuple):
            raise BundleError(f"feature_groups must be a list of names, got {self.feature_groups!r}")
        object.__setattr__(self, "feature_groups", tuple(self.feature_groups))
        try:
            feature_names(self.feature_groups)
        except (ConfigurationError, TypeError) as error:
            raise BundleError(f"{error}; this bundle is of another version of punnet") from error

    def answer(self, berry: BerryObservation, grams: float, spread: float) -> tuple[float, float, float]:
        """Grams, lower and upper bound of a berry of which a model said ``grams`` and ``spread``."""
        found = berry.score < 1.0 and self.detected is not None
        interval = self.detected if found and self.detected is not None else self.interval
        return grams, grams * _exp(interval.low * spread), grams * _exp(interval.high * spread)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON with the schema's name."""
        return {
            "schema": WEIGHT_SCHEMA,
            "model": self.model,
            "feature_groups": list(self.feature_groups),
            "features": list(feature_names(self.feature_groups)),
            "interval": _interval_json(self.interval),
            **({} if self.detected is None else {"interval_detected": _interval_json(self.detected)}),
        }

    @classmethod
    def from_json(cls, data: object, *, where: str) -> WeightSettings:
        """Read what :meth:`to_json` wrote; further fields are left alone.

        Raises
        ------
        BundleError
            If the schema is unknown, a field is missing or out of its range, or the features have other names here.
        """
        schema = data.get("schema") if isinstance(data, dict) else None
        if not isinstance(data, dict) or schema != WEIGHT_SCHEMA:
            raise BundleError(
                f"{where}: schema {schema!r} is unknown here; this version reads '{WEIGHT_SCHEMA}': "
                f"update punnet, or {_MAKE_AGAIN}"
            )
        try:
            settings = cls(
                model=data["model"],
                feature_groups=data["feature_groups"],
                interval=_interval_from_json(data["interval"]),
                detected=_interval_from_json(data["interval_detected"])
                if "interval_detected" in data
                else None,
            )
            if list(data["features"]) != list(feature_names(settings.feature_groups)):
                raise BundleError("the features have other names or another order here")
        except BundleError as error:
            raise BundleError(f"{where}: {error}; {_MAKE_AGAIN}") from error
        except (KeyError, TypeError) as error:
            raise BundleError(
                f"{where}: field missing or of the wrong kind ({error!r}); {_MAKE_AGAIN}"
            ) from error
        return settings


class WeightModel:
    """A weight model's graph on ONNX Runtime: ``features`` float32 (N, F) to ``grams`` and, if it has it, ``spread``.

    Parameters
    ----------
    path
        The ONNX file. Outputs are float (N,) or (N, 1). ``spread`` is positive: how large a relative error the model
        expects of a berry; 1 for all without it.
    features
        F.

    Raises
    ------
    BundleError
        If the file is no ONNX graph, or not one of a weight model.
    """

    def __init__(self, path: Path, features: int) -> None:
        # A dozen berries: threads only cost.
        self._graph = Graph(path, _MAKE_AGAIN, threads=1)
        inputs, outputs = self._graph.inputs, self._graph.outputs
        fed = inputs.get("features")
        if set(inputs) != {"features"} or "grams" not in outputs or fed is None or fed[0] != "float":
            raise BundleError(
                f"{path}: not a weight model's graph: inputs {sorted(inputs)}, outputs {sorted(outputs)}; needed are "
                f"'features' (float) and 'grams'; {_MAKE_AGAIN}"
            )
        if len(fed[1]) != 2 or fed[1][1] not in (None, features):
            raise BundleError(f"{path}: takes features {fed[1]}, {features} a berry are given; {_MAKE_AGAIN}")
        self._outputs = ["grams", "spread"] if "spread" in outputs else ["grams"]
        self._path, self._features = path, features

    def run(self, features: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs ``grams`` and ``spread``, (N,) each, for features (N, F).

        Raises
        ------
        BundleError
            If the graph fails or gives something else.
        """
        count = len(features)
        if not count:
            return np.zeros(0), np.zeros(0)
        fed = {"features": np.ascontiguousarray(features, dtype=np.float32)}
        raw = self._graph.run(self._outputs, fed, f"features {features.shape}")
        outputs = [np.asarray(value, dtype=np.float64).reshape(-1) for value in raw]
        spread = outputs[1] if len(outputs) == 2 else np.ones(count)
        if outputs[0].shape != (count,) or spread.shape != (count,) or (spread < 0).any():
            raise BundleError(
                f"{self._path}: gave grams {outputs[0].shape} and spread {spread.shape}, needed is ({count},), "
                f"spread not negative; {_MAKE_AGAIN}"
            )
        return outputs[0], spread


class LearnedWeightEstimator:
    """Weighs with a trained model of a bundle.

    Parameters
    ----------
    model
        The graph.
    settings
        What it is fed with, and how wide intervals are.
    manifest
        Of the bundle: name, licence, results.
    """

    def __init__(self, model: WeightModel, settings: WeightSettings, manifest: Manifest) -> None:
        self.settings = settings
        self.manifest = manifest
        self.name = manifest.name
        self._model = model

    @classmethod
    def from_bundle(cls, bundle: Bundle | str | Path) -> LearnedWeightEstimator:
        """Load a bundle of kind ``weight``: the bundle, its folder, or the name of one that comes with the package.

        Raises
        ------
        BundleError
            If a file is missing, damaged or not what is asked for.
        """
        if not isinstance(bundle, Bundle):
            bundle = load_bundle(bundle, kind="weight")
        settings = WeightSettings.from_json(
            bundle.read_json(WEIGHT_FILE), where=str(bundle.path(WEIGHT_FILE))
        )
        model = WeightModel(bundle.path(MODEL_FILE), len(feature_names(settings.feature_groups)))
        return cls(model, settings, bundle.manifest)

    def estimate(self, frame: Frame, berries: Strawberries) -> WeightEstimates:
        """Grams with an interval for each of ``berries``; NaN with a reason where the frame can't tell."""
        return self.weigh(observe(frame, berries))

    def weigh(self, observations: list[BerryObservation | str]) -> WeightEstimates:
        """The same for what :func:`~punnet.weight.observe` saw."""
        seen = [berry for berry in observations if not isinstance(berry, str)]
        grams_of, spread = self._model.run(feature_matrix(seen, self.settings.feature_groups))
        told = iter(zip(grams_of.tolist(), spread.tolist(), strict=True))
        answers = [
            berry if isinstance(berry, str) else self.settings.answer(berry, *next(told))
            for berry in observations
        ]
        return gather_estimates(answers, self.settings.interval.coverage)


def _interval_json(interval: IntervalSettings) -> dict[str, Any]:
    return {
        "kind": _INTERVAL_KIND,
        "coverage": interval.coverage,
        "low": interval.low,
        "high": interval.high,
    }


def _interval_from_json(data: Any) -> IntervalSettings:
    if data["kind"] != _INTERVAL_KIND:
        raise BundleError(f"interval of kind {data['kind']!r}; '{_INTERVAL_KIND}' is known")
    return IntervalSettings(data["coverage"], data["low"], data["high"])


def _exp(value: float) -> float:
    """Exponential that is infinite where it is too large, so that it can be disbelieved."""
    return math.exp(value) if value < 700.0 else math.inf


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
