"""What people really hand over: each a clear error or the right answer."""

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError, ShapeError
from punnet.movement import (
    ExpectationMaximisation,
    GaussianBasis,
    ProMP,
    Ridge,
    TrajectoryDistribution,
    ViaPoint,
)
from tests.timing import times_as_long

BASIS = GaussianBasis()
PHASES = np.linspace(0.0, 1.0, 31)
BOTH = pytest.mark.parametrize("estimator", [Ridge(), ExpectationMaximisation()], ids=["ridge", "em"])


def curve(seed: int, T: int = 80, dimensions: int = 3) -> np.ndarray:
    weights = np.random.default_rng(seed).normal(size=(dimensions, 8))
    return BASIS.phi(np.linspace(0, 1, T)) @ weights.T


@BOTH
def test_one_sample_is_no_movement(estimator) -> None:
    with pytest.raises(ShapeError, match="demonstration 1 has 1 sample; a movement needs"):
        ProMP(BASIS, estimator).fit([curve(0), curve(1)[:1]])


@BOTH
def test_two_samples_are_a_movement(estimator) -> None:
    fit = ProMP(BASIS, estimator).fit([curve(seed)[[0, -1]] for seed in range(3)])
    assert np.isfinite(fit.mean(PHASES)).all()
    np.testing.assert_allclose(
        fit.mean([0.0, 1.0]), np.mean([curve(seed)[[0, -1]] for seed in range(3)], axis=0), atol=0.05
    )


@BOTH
def test_a_hundred_thousand_samples_give_what_a_hundred_give(estimator) -> None:
    def made() -> list[np.ndarray]:
        return [curve(seed, T=100_000) for seed in range(3)]

    demonstrations = made()
    assert times_as_long(lambda: ProMP(BASIS, estimator).fit(demonstrations), made, turns=3) < 5
    long = ProMP(BASIS, estimator).fit(demonstrations)
    short = ProMP(BASIS, estimator).fit([curve(seed, T=100) for seed in range(3)])
    np.testing.assert_allclose(long.mean(PHASES), short.mean(PHASES), atol=1e-3)
    np.testing.assert_allclose(long.std(PHASES), short.std(PHASES), atol=1e-2)


@BOTH
def test_another_number_of_joints_is_named(estimator) -> None:
    with pytest.raises(ShapeError, match="demonstration 0 has 3 degrees of freedom, demonstration 2 has 2"):
        ProMP(BASIS, estimator).fit([curve(0), curve(1), curve(2, dimensions=2)])


@BOTH
def test_what_never_varies_gets_the_mean_and_next_to_no_spread(estimator) -> None:
    still = np.tile([0.1, -0.2, 0.3], (50, 1))
    fit = ProMP(BASIS, estimator).fit([still] * 5)
    np.testing.assert_allclose(fit.mean(PHASES), np.tile([0.1, -0.2, 0.3], (31, 1)), atol=1e-6)
    assert (fit.std(PHASES) < 2e-3).all()
    assert np.isfinite(fit.log_likelihood(still))


@BOTH
def test_duplicates_and_a_single_demonstration_are_as_sure_as_they_can_be(estimator) -> None:
    for shown in ([curve(0)], [curve(0)] * 6):
        fit = ProMP(BASIS, estimator).fit(shown)
        np.testing.assert_allclose(fit.mean(np.linspace(0, 1, 80)), curve(0), atol=1e-4)
        assert (fit.std(PHASES) < 3e-3).all()
        assert np.linalg.eigvalsh(fit.weight_covariance)[0] >= 0


@BOTH
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_none_is_found(estimator, value: float) -> None:
    broken = curve(1)
    broken[17, 2] = value
    with pytest.raises(
        ShapeError, match="demonstration 1 must be finite, but sample 17, degree of freedom 2"
    ):
        ProMP(BASIS, estimator).fit([curve(0), broken])


def test_what_is_no_array() -> None:
    with pytest.raises(ShapeError, match="demonstration 0 is no array"):
        ProMP().fit([[[1.0, 2.0], [3.0]]])
    with pytest.raises(ShapeError, match=r"demonstration 0 must be \(T, D\)"):
        ProMP().fit([np.zeros(10)])


def test_times_are_used_and_checked() -> None:
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(4, 2, 8))
    times = [np.sort(rng.uniform(0.0, 3.0, 90)) + 5.0 for _ in range(4)]
    phases = [(t - t[0]) / (t[-1] - t[0]) for t in times]
    shown = [BASIS.phi(z) @ w.T for z, w in zip(phases, weights, strict=True)]
    fit = ProMP(estimator=Ridge(shrinkage=0.0)).fit(shown, times=times)
    np.testing.assert_allclose(fit.weight_mean, weights.mean(axis=0), atol=1e-3)
    assert fit.duration == pytest.approx(np.mean([t[-1] - t[0] for t in times]))
    np.testing.assert_allclose(ProMP().weights(shown[0], times[0]), weights[0], atol=1e-3)
    with pytest.raises(ShapeError, match="times of demonstration 1"):
        ProMP().fit(shown, times=[times[0], times[1][::-1], *times[2:]])
    with pytest.raises(ShapeError, match="3 arrays of times for 4"):
        ProMP().fit(shown, times=times[:3])
    with pytest.raises(ConfigurationError, match="not both"):
        ProMP().fit(shown, times=times, durations=[1.0] * 4)


def test_exact_via_points_that_contradict_are_refused_even_one_after_another() -> None:
    prior = TrajectoryDistribution(BASIS, np.zeros((2, 8)), np.eye(16))
    first = ViaPoint(0.5, np.array([0.3]), (0,))
    other = ViaPoint(0.5, np.array([0.4]), (0,))
    with pytest.raises(ConfigurationError, match="contradict"):
        prior.condition([first, other])
    with pytest.raises(ConfigurationError, match="contradict"):
        prior.condition([first]).condition([other])
    # With a std on each they are weighed: the mean lies between.
    softened = prior.condition([ViaPoint(0.5, np.array([v]), (0,), std=0.1) for v in (0.3, 0.4)])
    assert 0.3 < softened.mean([0.5])[0, 0] < 0.4


def test_a_via_point_outside_the_movement_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"phase must lie in \[0, 1\]"):
        ViaPoint(1.1, np.zeros(2))
    with pytest.raises(ConfigurationError, match=r"time 5.0 s is not within"):
        ViaPoint.at_time(5.0, np.zeros(2), 3.0)


def test_seconds_and_velocities_per_second() -> None:
    prior = TrajectoryDistribution(BASIS, np.zeros((1, 8)), np.eye(8), duration=4.0)
    point = ViaPoint.at_time(2.0, [0.5], 4.0, std=0.1, order=1)
    assert (point.phase, point.values[0], point.std) == (0.5, 2.0, 0.4)
    exact = ViaPoint.at_time(2.0, [0.5], 4.0, order=1)
    assert prior.condition([exact]).mean([0.5], 1)[0, 0] / 4.0 == pytest.approx(0.5)


def test_files(tmp_path) -> None:
    prior = TrajectoryDistribution(BASIS, np.zeros((1, 8)), np.eye(8), duration=4.0)
    path = prior.save(tmp_path / "a.json")
    assert TrajectoryDistribution.load(path).duration == 4.0
    with pytest.raises(OutputExistsError):
        prior.save(path)
    assert prior.retimed(2.0).save(path, force=True) == path
    assert TrajectoryDistribution.load(path).duration == 2.0
    with pytest.raises(FileFormatError, match="absent"):
        TrajectoryDistribution.load(tmp_path / "absent.json")
    (tmp_path / "b.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"b\.json"):
        TrajectoryDistribution.load(tmp_path / "b.json")
    (tmp_path / "c.json").write_text("{}")
    with pytest.raises(FileFormatError, match=r"c\.json: .*schema"):
        TrajectoryDistribution.load(tmp_path / "c.json")
