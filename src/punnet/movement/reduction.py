"""Demonstrations reduced to what a linear Gaussian model needs to know of them, whatever their length.

With ``Φ = Q R`` (thin QR) the trajectory ``y = Φ w + ε`` of one degree of freedom says no more about w than
the B numbers ``Qᵀ y = R w + ε'``, whose noise is as white as ε; the rest of y is noise alone, of which the sum
of squares suffices. A demonstration of 10⁵ samples costs as much as one of 150 from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from punnet.movement.basis import GaussianBasis

__all__ = ["ReducedDemonstrations", "marginal_log_likelihood", "reduce_demonstrations"]

Array = NDArray[np.float64]

CACHED_SAMPLES = 10_000
SMALLEST_NOISE = 1e-9
"""Standard deviation given to noise where there is none, in the degrees' own units."""


@dataclass(frozen=True, eq=False)
class ReducedDemonstrations:
    """N demonstrations of D degrees of freedom with B basis functions; those sampled alike share a group.

    Parameters
    ----------
    factors
        (U, B, B) the R of each group.
    group
        (N,) the group of each demonstration.
    projected
        (N, D, B) the ``Qᵀ y``.
    rest
        (N, D) sum of squares of what no weights can explain.
    lengths
        (N,) samples.
    """

    factors: Array
    group: NDArray[np.int64]
    projected: Array
    rest: Array
    lengths: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, int, int]:
        """N, D and B."""
        N, D, B = self.projected.shape
        return N, D, B

    @property
    def groups(self) -> list[tuple[Array, NDArray[np.bool_] | slice]]:
        """R (B, B) of each group and what chooses its demonstrations."""
        if len(self.factors) == 1:
            return [(self.factors[0], slice(None))]
        return [(R, self.group == u) for u, R in enumerate(self.factors)]


def reduce_demonstrations(
    basis: GaussianBasis, demonstrations: Sequence[Array], phases: Sequence[Array] | None = None
) -> ReducedDemonstrations:
    """Reduce demonstrations (T_n, D), sampled evenly or at ``phases`` (T_n,)."""
    sizes = [len(values) for values in demonstrations]
    if phases is not None:
        members = [np.array([n]) for n in range(len(sizes))]
        grids = [_factored(basis.phi(z)) for z in phases]
    else:
        sampled = sorted(set(sizes))
        members = [np.flatnonzero(np.array(sizes) == T) for T in sampled] if len(sampled) > 1 else []
        grids = [_even_grid(basis, T) if T <= CACHED_SAMPLES else _even(basis, T) for T in sampled]
    N, D, B = len(demonstrations), demonstrations[0].shape[1], basis.count
    lengths = np.array(sizes)
    if not members:
        Q, R = grids[0]
        projected, rest = _projected(Q, demonstrations, B)
        return ReducedDemonstrations(R[None], np.zeros(N, dtype=np.int64), projected, rest, lengths)
    group = np.empty(N, dtype=np.int64)
    projected, rest = np.empty((N, D, B)), np.empty((N, D))
    for u, (of_group, (Q, _)) in enumerate(zip(members, grids, strict=True)):
        group[of_group] = u
        projected[of_group], rest[of_group] = _projected(Q, [demonstrations[int(n)] for n in of_group], B)
    return ReducedDemonstrations(np.stack([R for _, R in grids]), group, projected, rest, lengths)


def _projected(Q: Array, demonstrations: Sequence[Array], count: int) -> tuple[Array, Array]:
    """``Qᵀ y`` (N, D, B), zeros beyond the columns of Q (T, min(T, B)), and the sums of squares (N, D) that it leaves."""
    shape = len(demonstrations), -1, Q.shape[1]
    values = np.array(demonstrations).transpose(1, 0, 2).reshape(len(Q), -1)
    inside = values.T @ Q
    left = np.einsum("ti,ti->i", values, values) - np.einsum("ib,ib->i", inside, inside)
    projected = inside.reshape(shape)
    if Q.shape[1] < count:
        projected = np.concatenate((projected, np.zeros((*projected.shape[:2], count - Q.shape[1]))), axis=2)
    return projected, np.maximum(left, 0.0).reshape(shape[:2])


def _factored(phi: Array) -> tuple[Array, Array]:
    """Q (T, min(T, B)) and R (B, B), rows beyond T zero."""
    Q, R = np.linalg.qr(phi)
    full = np.zeros((phi.shape[1],) * 2)
    full[: len(R)] = R
    return Q, full


def _even(basis: GaussianBasis, samples: int) -> tuple[Array, Array]:
    return _factored(basis.phi(np.linspace(0.0, 1.0, samples)))


_even_grid = lru_cache(maxsize=64)(_even)  # demonstrations of one length, in one fit and the next, share it


def marginal_log_likelihood(
    demonstrations: ReducedDemonstrations, mean: Array, covariance: Array, noise_variance: Array
) -> Array:
    """Log-likelihood (N,) in nats of each demonstration under weights N(mean (D, B), covariance) and noise (D,)."""
    N, D, B = demonstrations.shape
    noise = np.maximum(noise_variance, SMALLEST_NOISE**2)
    blocks = covariance.reshape(D, B, D, B)
    result = np.empty(N)
    for R, chosen in demonstrations.groups:
        spread = np.einsum("ij,djek,lk->diel", R, blocks, R, optimize=True).reshape(D * B, D * B)
        # In units of the noise its covariance is the identity: all eigenvalues are at least one.
        unit = np.repeat(np.sqrt(noise), B)
        scaled = (spread + spread.T) / 2.0 / unit / unit[:, None]
        eigenvalues, vectors = np.linalg.eigh(scaled)
        eigenvalues = np.maximum(eigenvalues, 0.0) + 1.0
        residual = (demonstrations.projected[chosen] - mean @ R.T).reshape(-1, D * B) / unit
        squares = np.square(residual @ vectors) / eigenvalues
        logarithm = np.log(eigenvalues).sum() + 2.0 * np.log(unit).sum()
        result[chosen] = -0.5 * (squares.sum(axis=1) + logarithm)
    # Of T samples B are in the projection; the others see the noise alone.
    others = demonstrations.lengths[:, None] - B
    result -= 0.5 * (demonstrations.rest / noise + others * np.log(noise)).sum(axis=1)
    return np.asarray(result - 0.5 * demonstrations.lengths * D * np.log(2.0 * np.pi), dtype=np.float64)
