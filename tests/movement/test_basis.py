from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement import GaussianBasis

PHASES = np.linspace(0.0, 1.0, 150)


def test_recorded_basis_reproduces_the_labs_matrix(shared_data: Path) -> None:
    recorded = np.load(shared_data / "reach" / "promp_weights.npz")["phi_100"]
    ours = GaussianBasis.recorded().phi(np.linspace(0.0, 1.0, 100))
    np.testing.assert_allclose(ours, recorded, atol=1e-15)


def test_default_is_well_conditioned_and_the_recorded_one_is_not() -> None:
    assert np.linalg.cond(GaussianBasis().phi(PHASES)) < 50
    assert 2.1e4 < np.linalg.cond(GaussianBasis.recorded().phi(PHASES)) < 2.3e4


@pytest.mark.parametrize("count", [3, 5, 8, 12, 20])
def test_spaced_basis_stays_well_conditioned(count: int) -> None:
    assert np.linalg.cond(GaussianBasis.spaced(count).phi(PHASES)) < 100


def test_spaced_with_the_default_count_is_the_default() -> None:
    assert GaussianBasis.spaced(8) == GaussianBasis()


@given(st.integers(2, 20), st.floats(1e-4, 1.0), st.floats(-1.0, 2.0))
@settings(deadline=None, max_examples=60)
def test_functions_are_positive_and_sum_to_one(count: int, width: float, phase: float) -> None:
    basis = GaussianBasis(count, width)
    values = basis.phi([phase])
    assert values.shape == (1, count)
    assert (values >= 0).all()
    np.testing.assert_allclose(values.sum(), 1.0, rtol=1e-12)
    for order in (1, 2):
        slope = basis.derivative([phase], order)
        assert abs(slope.sum()) <= 1e-9 * max(1.0, np.abs(slope).max())


@given(st.integers(3, 12), st.floats(0.005, 0.1), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=60)
def test_derivatives_match_finite_differences(count: int, width: float, phase: float) -> None:
    basis, step = GaussianBasis(count, width), 1e-5
    before, after = basis.phi([phase - step, phase + step])
    np.testing.assert_allclose(basis.derivative([phase], 1)[0], (after - before) / (2 * step), atol=2e-5)
    second = (basis.derivative([phase + step], 1) - basis.derivative([phase - step], 1))[0] / (2 * step)
    np.testing.assert_allclose(basis.derivative([phase], 2)[0], second, atol=2e-4)


def test_far_outside_nothing_underflows() -> None:
    assert np.isfinite(GaussianBasis(8, 1e-4).phi([-50.0, 50.0])).all()


def test_json_round_trip_and_refusals() -> None:
    basis = GaussianBasis(11, 0.013)
    assert GaussianBasis.from_json(basis.to_json()) == basis
    for wrong in ({"kind": "fourier"}, {"kind": "gaussian", "count": 8}, []):
        with pytest.raises(FileFormatError, match="basis JSON"):
            GaussianBasis.from_json(wrong)  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="count"):
        GaussianBasis(1)
    with pytest.raises(ConfigurationError, match="width"):
        GaussianBasis(8, 0.0)
    with pytest.raises(ConfigurationError, match="order"):
        basis.derivative([0.5], 3)
    with pytest.raises(ShapeError, match="phase"):
        basis.phi(np.zeros((2, 2)))


def test_centres_may_be_placed() -> None:
    placed = GaussianBasis(5, 0.03, (-0.1, 0.3, 0.6, 0.9, 1.0))
    assert placed.centres == (-0.1, 0.3, 0.6, 0.9, 1.0)
    assert GaussianBasis.from_json(placed.to_json()) == placed
    np.testing.assert_allclose(placed.phi(PHASES).sum(axis=1), 1.0)
    np.testing.assert_allclose(GaussianBasis(5, 0.03).centres, [0.0, 0.25, 0.5, 0.75, 1.0])
    for wrong in ((0.0, 1.0), (0.0, 0.5, 0.4, 0.8, 1.0), (0.0, 0.2, 0.4, 0.8, float("inf"))):
        with pytest.raises(ConfigurationError, match="rising"):
            GaussianBasis(5, 0.03, wrong)


def test_condition_number_is_that_of_phi() -> None:
    assert GaussianBasis().condition_number() == pytest.approx(np.linalg.cond(GaussianBasis().phi(PHASES)))
    assert GaussianBasis().condition_number() < 100 < GaussianBasis.recorded().condition_number()
