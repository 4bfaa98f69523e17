"""Measures of weight estimates: what is counted, in which part, and what counts against an estimator."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from punnet.errors import ConfigurationError, ShapeError
from punnet.weight.ellipsoid import EllipsoidEstimator
from punnet.weight.estimator import WeightEstimates
from punnet.weight.evaluation import evaluate_weights, weigh_samples
from punnet.weight.samples import MissedBerry, WeightSamples
from tests.train.weight.domes import domes


@pytest.fixture(scope="module")
def samples() -> WeightSamples:
    some = domes(20)
    return replace(
        some,
        grams=np.linspace(8.0, 30.0, 20),
        occlusion=np.where(np.arange(20) < 5, 0.4, 0.0),
        distance=np.where(np.arange(20) < 10, 0.25, 0.5),
    )


def estimates(grams: np.ndarray, half_width: float = 0.1) -> WeightEstimates:
    intervals = grams[:, None] * (1.0 - half_width, 1.0 + half_width)
    return WeightEstimates(grams, intervals, (None,) * len(grams))


def test_parts_and_coverage(samples: WeightSamples) -> None:
    told = samples.grams * np.where(np.arange(20) < 5, 1.17, 1.03)
    found = evaluate_weights(samples, estimates(told), estimator="mine", data="some")
    assert found.whole.pcw == {0.05: 75.0, 0.10: 75.0, 0.15: 75.0, 0.20: 100.0, 0.25: 100.0, 0.30: 100.0}
    occluded, free = found.part("occluded"), found.part("free")
    assert occluded is not None
    assert free is not None
    assert occluded.errors.mean_percentage == pytest.approx(17.0)
    assert free.errors.mean_percentage == pytest.approx(3.0)
    assert occluded.coverage is not None
    assert free.coverage is not None
    assert (occluded.coverage.inside, free.coverage.inside) == (0.0, 100.0)
    assert free.coverage.width == pytest.approx(20.0)
    assert found.part("middle") is None
    assert {part.name: part.errors.count for part in found.parts} == {
        "all": 20,
        "free": 15,
        "occluded": 5,
        "near": 10,
        "far": 10,
    }
    assert sum(c.berries for c in found.coverage_by_weight.values()) == 20


def test_missed_berries_and_refusals_count_as_wrong(samples: WeightSamples) -> None:
    missed = tuple(MissedBerry(f"only {n} readings", 20.0, "a", 0.5, n, n) for n in range(20))
    told = samples.grams.copy()
    told[0] = math.nan
    some = WeightEstimates(told, np.full((20, 2), math.nan), ("why", *(None,) * 19))
    found = evaluate_weights(replace(samples, missed=missed), some, estimator="mine", data="some")
    assert found.whole.pcw[0.05] == pytest.approx(100.0 * 19 / 40)
    assert found.whole.errors.missing == 21
    assert found.refused == {"only … readings": 20}
    assert found.nominal is None
    assert found.whole.coverage is None
    assert found.coverage_by_weight == {}


def test_json_is_plain(samples: WeightSamples) -> None:
    nothing = WeightEstimates(np.full(20, math.nan), np.full((20, 2), math.nan), ("why",) * 20)
    for said in (estimates(samples.grams), nothing):
        data = evaluate_weights(samples, said, estimator="mine", data="some").to_json()
        assert json.loads(json.dumps(data, allow_nan=False))["parts"]["all"]["berries"] == 20
    assert data["parts"]["all"]["mape"] is None


def test_every_kind_of_weigher_can_be_asked() -> None:
    class Constant:
        def predict(self, observations: object) -> np.ndarray:
            return np.full(6, 20.0)

    some = domes(6)
    by_geometry = weigh_samples(EllipsoidEstimator(), some)
    assert np.isfinite(by_geometry.intervals).all()
    plain = weigh_samples(Constant(), some)
    assert plain.grams.tolist() == [20.0] * 6
    assert np.isnan(plain.intervals).all()

    class Framed:
        name = "framed"

        def estimate(self, frame: object, berries: object) -> WeightEstimates:
            raise AssertionError

    with pytest.raises(ConfigurationError, match="whole frames only"):
        weigh_samples(Framed(), some)


def test_as_many_estimates_as_berries(samples: WeightSamples) -> None:
    with pytest.raises(ShapeError, match="19 estimates for 20 berries"):
        evaluate_weights(samples, estimates(samples.grams[:19]), estimator="mine", data="some")
    with pytest.raises(ShapeError, match="at least one"):
        evaluate_weights(samples.subset([]), estimates(np.zeros(0)), estimator="mine", data="some")
