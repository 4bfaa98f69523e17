"""The MLPs of appendix A.3 (figures A.5, A.6): all degrees of freedom as one batched module.

One network a degree, latent vector → 8 mean weights and 36 numbers of the covariance's LDLᵀ factors (Eq. 6.1). Networks
of equal widths are computed together, as batched matrix products; they share nothing.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from punnet.train.planner.autoencoder import LATENT, SLOPE

__all__ = ["BatchedHeads", "BatchedLinear", "MovementHeads", "covariance_factor"]

MEAN_BRANCH = (64, 32, 16)
COVARIANCE_BRANCH = (64,)
BRANCH = 128
CONDITIONS = 2
SMALLEST_VARIANCE = 1e-9


class BatchedLinear(nn.Module):
    """K dense layers beside each other: (K, N, inputs) → (K, N, outputs); initialised as Keras does (Glorot, 0)."""

    def __init__(self, count: int, inputs: int, outputs: int) -> None:
        super().__init__()
        limit = math.sqrt(6.0 / (inputs + outputs))
        self.weight = nn.Parameter(torch.empty(count, inputs, outputs).uniform_(-limit, limit))
        self.bias = nn.Parameter(torch.zeros(count, 1, outputs))

    def forward(self, values: Tensor) -> Tensor:
        """All layers at once."""
        return torch.baddbmm(self.bias, values, self.weight)


class BatchedHeads(nn.Module):
    """K MLPs of one width.

    Parameters
    ----------
    count
        K.
    functions
        Weights B of each degree's mean.
    trunk
        Widths of the trunk's two layers.
    conditioned
        Concatenate the two box coordinates, each through a dense unit of its own (figure A.6).
    """

    def __init__(self, count: int, functions: int, trunk: tuple[int, int], *, conditioned: bool) -> None:
        super().__init__()
        first, second = trunk
        self.count = count
        self.trunk = nn.ModuleList([BatchedLinear(count, LATENT, first), BatchedLinear(count, first, second)])
        self.conditions = nn.ModuleList(
            [BatchedLinear(count, 1, 1) for _ in range(CONDITIONS if conditioned else 0)]
        )
        inputs = second + len(self.conditions)
        factors = functions * (functions + 1) // 2
        self.mean_branch = _branch(count, (inputs, BRANCH, *MEAN_BRANCH, functions))
        self.covariance_branch = _branch(count, (inputs, BRANCH, *COVARIANCE_BRANCH, factors))

    def forward(self, latent: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
        """(K, N, B) mean weights and (K, N, B(B+1)/2) factor entries of ``latent`` (N, 256), ``centres`` (N, 2)."""
        values = latent.expand(self.count, *latent.shape)
        for layer in self.trunk:
            values = nn.functional.leaky_relu(layer(values), SLOPE)
        for number, layer in enumerate(self.conditions):
            told = centres[:, number : number + 1].expand(self.count, -1, -1)
            values = torch.cat((values, nn.functional.leaky_relu(layer(told), SLOPE)), dim=-1)
        return _through(self.mean_branch, values), _through(self.covariance_branch, values)


def _branch(count: int, widths: tuple[int, ...]) -> nn.ModuleList:
    return nn.ModuleList([BatchedLinear(count, a, b) for a, b in pairwise(widths)])


def _through(branch: nn.ModuleList, values: Tensor) -> Tensor:
    """Tanh between the layers, linear at the end."""
    for layer in branch[:-1]:
        values = torch.tanh(layer(values))
    last: Tensor = branch[-1](values)
    return last


class MovementHeads(nn.Module):
    """The MLPs of all degrees of freedom; those of equal widths are batched.

    Parameters
    ----------
    degrees, functions
        D and B.
    trunk
        One pair of widths, or one a degree.
    conditioned
        As :class:`BatchedHeads`.
    """

    order: Tensor

    def __init__(
        self, degrees: int, functions: int, trunk: tuple[tuple[int, int], ...], *, conditioned: bool
    ) -> None:
        super().__init__()
        pairs = trunk * degrees if len(trunk) == 1 else trunk
        alike: dict[tuple[int, int], list[int]] = {}
        for degree, pair in enumerate(pairs):
            alike.setdefault(pair, []).append(degree)
        self.heads = nn.ModuleList(
            [
                BatchedHeads(len(members), functions, pair, conditioned=conditioned)
                for pair, members in alike.items()
            ]
        )
        order = [degree for members in alike.values() for degree in members]
        self.register_buffer("order", torch.tensor(np.argsort(order)), persistent=False)
        self.functions = functions

    def forward(self, latent: Tensor, centres: Tensor) -> tuple[Tensor, Tensor]:
        """(N, D, B) mean weights and (N, D, B, B) factors F with covariance F Fᵀ."""
        found = [head(latent, centres) for head in self.heads]
        mean = torch.cat([means for means, _ in found])[self.order].transpose(0, 1)
        entries = torch.cat([factors for _, factors in found])[self.order].transpose(0, 1)
        return mean, covariance_factor(entries, self.functions)

    @torch.no_grad()
    def start_at(self, mean: NDArray[np.float64], blocks: NDArray[np.float64]) -> None:
        """Let the last biases give the mean (D, B) and covariance (D, B, B) of the training movements."""
        entries = np.array([_entries(block) for block in blocks])
        offset = 0
        backwards = torch.argsort(self.order)
        for head in self.heads:
            assert isinstance(head, BatchedHeads)
            rows = backwards[offset : offset + head.count].numpy()
            for branch, start in ((head.mean_branch, mean), (head.covariance_branch, entries)):
                last = branch[-1]
                assert isinstance(last, BatchedLinear)
                last.bias.copy_(torch.from_numpy(start[rows, None]))
            offset += head.count


def covariance_factor(entries: Tensor, functions: int) -> Tensor:
    """F = L √D (…, B, B) with covariance F Fᵀ = L D Lᵀ, of (…, B(B+1)/2) numbers; Eq. 6.1.

    First the entries of L below its diagonal of ones, row by row; then ln D, so that D = exp(·) is positive.
    """
    below = functions * (functions - 1) // 2
    # A product with zeros and ones: its gradient is a product too, where that of picking entries adds one at a time.
    places = torch.from_numpy(_places_below_diagonal(functions)).to(entries.dtype)
    shape = (*entries.shape[:-1], functions, functions)
    lower = (entries[..., :below] @ places).reshape(shape) + torch.eye(functions)
    factor: Tensor = lower * torch.exp(0.5 * entries[..., below:]).unsqueeze(-2)
    return factor


@lru_cache(maxsize=8)
def _places_below_diagonal(functions: int) -> NDArray[np.float32]:
    """(B(B−1)/2, B²) of zeros and ones: where each entry of L goes, row by row."""
    rows, columns = np.tril_indices(functions, -1)
    places = np.zeros((len(rows), functions * functions), dtype=np.float32)
    places[np.arange(len(rows)), rows * functions + columns] = 1.0
    return places


def _entries(block: NDArray[np.float64]) -> NDArray[np.float64]:
    """The numbers that :func:`covariance_factor` takes to ``block`` (B, B), made safely positive."""
    size = len(block)
    lift = max(float(np.trace(block)) / size * 1e-4, SMALLEST_VARIANCE)
    root = np.linalg.cholesky(block + lift * np.eye(size))
    diagonal = np.diag(root)
    lower = root / diagonal
    return np.concatenate((lower[np.tril_indices(size, -1)], 2.0 * np.log(diagonal)))
