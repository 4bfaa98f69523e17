"""How many basis functions: reconstruction error against their number (thesis figure 6.8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, FileFormatError
from punnet.movement.basis import GaussianBasis
from punnet.movement.promp import checked_demonstrations
from punnet.movement.reduction import reduce_demonstrations
from punnet.movement.regression import Ridge

__all__ = ["BasisChoice", "choose_basis"]

COUNTS = tuple(range(2, 21))
COLOUR = "#5b3a8e"


@dataclass(frozen=True, eq=False)
class BasisChoice:
    """What :func:`choose_basis` found.

    Parameters
    ----------
    counts
        (K,) numbers of basis functions tried.
    mse
        (K, D) mean squared error of each degree of freedom, in its unit squared.
    error_share
        (K,) root mean squared error as a share of the movement's own standard deviation, largest over the
        degrees of freedom that move.
    basis
        The one chosen.
    """

    counts: NDArray[np.int64]
    mse: NDArray[np.float64]
    error_share: NDArray[np.float64]
    basis: GaussianBasis

    def plot(self, path: str | Path, *, title: str = "MSE against the number of weights") -> Path:
        """Draw figure 6.8: the mean squared error over all degrees of freedom, logarithmic, the choice marked.

        Raises
        ------
        FileFormatError
            If the file can't be written or its format is unknown.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.0, 3.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        mean = np.maximum(self.mse.mean(axis=1), np.finfo(np.float64).tiny)
        axes.semilogy(self.counts, mean, color=COLOUR, marker="o", ms=4)
        chosen = int(np.flatnonzero(self.counts == self.basis.count)[0])
        axes.plot(
            self.basis.count, mean[chosen], "o", ms=11, mfc="none", mec="#c8102e", mew=1.6, label="chosen"
        )
        axes.set(xlabel="ProMP weights per degree of freedom", ylabel="MSE (squared units)", title=title)
        axes.set_xticks(self.counts)
        axes.grid(alpha=0.25, lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False)
        try:
            figure.savefig(path, dpi=130)
        except (OSError, ValueError) as error:
            raise FileFormatError(f"{path}: the plot can't be written ({error})") from error
        return Path(path)


def choose_basis(
    demonstrations: Sequence[ArrayLike], *, counts: Sequence[int] = COUNTS, tolerance: float = 0.015
) -> BasisChoice:
    """Fewest well-conditioned basis functions that reproduce every degree of freedom.

    Parameters
    ----------
    demonstrations
        N ≥ 1 arrays (T_n, D), evenly sampled; lengths may differ.
    counts
        Numbers of functions to try, each at least 2.
    tolerance
        Root mean squared error allowed, as a share of a degree's own standard deviation over all samples. If
        no count reaches it, the one with the least error is taken.

    Raises
    ------
    ShapeError
        If the demonstrations are not as :meth:`~punnet.movement.ProMP.fit` takes them.
    ConfigurationError
        If there is no count, one is below 2, or the tolerance is not positive.
    """
    tried = sorted(set(counts))
    if not tried or not tolerance > 0:
        raise ConfigurationError(
            f"choose_basis: counts and a positive tolerance are needed, got {tried} and {tolerance}"
        )
    arrays = checked_demonstrations(demonstrations)
    samples = sum(len(values) for values in arrays)
    centre = sum(values.sum(axis=0) for values in arrays) / samples
    spread = sum(np.square(values - centre).sum(axis=0) for values in arrays) / samples
    mse = np.stack([_mean_squared_error(GaussianBasis.spaced(count), arrays) for count in tried])
    moving = np.sqrt(spread) > 1e-9 * np.maximum(1.0, np.abs(centre))
    share = np.sqrt(np.divide(mse, spread, out=np.zeros_like(mse), where=moving)).max(axis=1)
    good = np.flatnonzero(share <= tolerance)
    chosen = int(good[0]) if len(good) else int(np.argmin(share))
    return BasisChoice(np.array(tried), mse, share, GaussianBasis.spaced(tried[chosen]))


def _mean_squared_error(basis: GaussianBasis, arrays: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    reduced = reduce_demonstrations(basis, arrays)
    noise = Ridge(shrinkage=0.0).estimate(reduced, "full").noise_std
    return np.square(noise)
