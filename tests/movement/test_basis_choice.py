from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.movement import GaussianBasis, choose_basis


def curves(count: int = 6) -> list[np.ndarray]:
    """Movements that eight functions describe exactly, and one joint that stands still."""
    rng = np.random.default_rng(0)
    basis = GaussianBasis.spaced(8)
    found = []
    for T in rng.integers(60, 120, count):
        moving = basis.phi(np.linspace(0, 1, T)) @ rng.normal(size=(8, 2))
        found.append(np.column_stack([moving, np.full(T, 0.3)]))
    return found


def test_more_functions_reproduce_better_and_as_many_as_made_it_are_chosen() -> None:
    choice = choose_basis(curves(), counts=range(2, 13), tolerance=0.001)
    assert choice.basis == GaussianBasis.spaced(8)
    assert (choice.mse.shape, choice.counts.tolist()) == ((11, 3), list(range(2, 13)))
    assert choice.error_share[0] > 0.3
    assert choice.error_share[6] < 1e-6
    np.testing.assert_allclose(choice.mse[:, 2], 0.0, atol=1e-12)


def test_a_looser_tolerance_takes_fewer_and_an_unreachable_one_the_best() -> None:
    tight, loose = choose_basis(curves(), tolerance=0.01), choose_basis(curves(), tolerance=0.3)
    assert loose.basis.count < tight.basis.count
    best = choose_basis(curves(), counts=(2, 3, 4), tolerance=1e-9)
    assert best.basis.count == 4


def test_figure_is_drawn(tmp_path: Path) -> None:
    choice = choose_basis(curves())
    assert choice.plot(tmp_path / "figure.png").stat().st_size > 10_000
    with pytest.raises(FileFormatError, match="can't be written"):
        choice.plot(tmp_path / "absent" / "figure.png")


def test_refusals() -> None:
    with pytest.raises(ConfigurationError, match="counts"):
        choose_basis(curves(), counts=())
    with pytest.raises(ConfigurationError, match="tolerance"):
        choose_basis(curves(), tolerance=0.0)
    with pytest.raises(ConfigurationError, match="count must be at least 2"):
        choose_basis(curves(), counts=(1,))
    with pytest.raises(ShapeError, match="no demonstrations"):
        choose_basis([])
