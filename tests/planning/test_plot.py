from pathlib import Path

import numpy as np
import pytest

from punnet.errors import FileFormatError
from punnet.movement import GaussianBasis, TrajectoryDistribution, ViaPoint
from punnet.planning import plot_distribution
from punnet.scene import read_image


def make_distribution(dimensions: int) -> TrajectoryDistribution:
    rng = np.random.default_rng(0)
    factor = 0.1 * rng.normal(size=(8 * dimensions, 8 * dimensions))
    return TrajectoryDistribution(GaussianBasis(), rng.normal(size=(dimensions, 8)), factor @ factor.T)


@pytest.mark.parametrize("dimensions", [1, 3, 7, 8])
def test_draws_every_degree_of_freedom(tmp_path: Path, dimensions: int) -> None:
    file = plot_distribution(make_distribution(dimensions), tmp_path / "plot.png", title="Reach")
    image = read_image(file)
    assert image.shape[0] > 200
    assert image.std() > 5


def test_via_points_show_in_red(tmp_path: Path) -> None:
    def red_pixels(distribution: TrajectoryDistribution) -> int:
        image = read_image(plot_distribution(distribution, tmp_path / "plot.png")).astype(int)
        return int(((image[..., 0] > 150) & (image[..., 1] < 60) & (image[..., 2] < 80)).sum())

    plain = make_distribution(3)
    conditioned = plain.condition(
        [ViaPoint(0.5, np.array([0.2]), (1,), 0.05), ViaPoint(1.0, np.zeros(3), order=1)]
    )
    assert red_pixels(plain) == 0
    assert red_pixels(conditioned) > 20


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="can't be written"):
        plot_distribution(make_distribution(1), tmp_path / "nowhere" / "plot.png")
    with pytest.raises(FileFormatError, match="can't be written"):
        plot_distribution(make_distribution(1), tmp_path / "plot.xyz")
