"""Demonstrations reduced to what a linear Gaussian model needs to know of them, whatever their length.

With ``Φ = Q R`` (thin QR) the trajectory ``y = Φ w + ε`` of one degree of freedom says no more about w than
the B numbers ``Qᵀ y = R w + ε'``, whose noise is as white as ε; the rest of y is noise alone, of which the sum
of squares suffices. A demonstration of 10⁵ samples costs as much as one of 150 from there on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.movement.basis import GaussianBasis

__all__ = ["ReducedDemonstrations", "marginal_log_likelihood", "reduce_demonstrations"]

Array = NDArray[np.float64]

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


def reduce_demonstrations(
    basis: GaussianBasis, demonstrations: Sequence[Array], phases: Sequence[Array] | None = None
) -> ReducedDemonstrations:
    """Reduce demonstrations (T_n, D), sampled evenly or at ``phases`` (T_n,)."""
    lengths = np.array([len(values) for values in demonstrations])
    if phases is None:
        sampled: dict[int, Array] = {T: np.linspace(0.0, 1.0, T) for T in dict.fromkeys(lengths.tolist())}
        members = {T: np.flatnonzero(lengths == T) for T in sampled}
    else:
        sampled = dict(enumerate(phases))
        members = {n: np.array([n]) for n in sampled}
    N, D, B = len(demonstrations), demonstrations[0].shape[1], basis.count
    factors, group = np.zeros((len(sampled), B, B)), np.empty(N, dtype=np.int64)
    projected, rest = np.zeros((N, D, B)), np.empty((N, D))
    for u, key in enumerate(sampled):
        Q, R = np.linalg.qr(basis.phi(sampled[key]))
        of_group = members[key]
        values = np.stack([demonstrations[int(n)] for n in of_group], axis=1).reshape(len(Q), -1)
        inside = Q.T @ values
        left = np.maximum(np.einsum("ti,ti->i", values, values) - np.einsum("bi,bi->i", inside, inside), 0.0)
        factors[u, : len(R)] = R
        group[of_group] = u
        projected[of_group, :, : len(R)] = inside.T.reshape(len(of_group), D, len(R))
        rest[of_group] = left.reshape(len(of_group), D)
    return ReducedDemonstrations(factors, group, projected, rest, lengths)


def marginal_log_likelihood(
    demonstrations: ReducedDemonstrations, mean: Array, covariance: Array, noise_variance: Array
) -> Array:
    """Log-likelihood (N,) in nats of each demonstration under weights N(mean (D, B), covariance) and noise (D,)."""
    N, D, B = demonstrations.shape
    noise = np.maximum(noise_variance, SMALLEST_NOISE**2)
    blocks = covariance.reshape(D, B, D, B)
    result = np.empty(N)
    for u, R in enumerate(demonstrations.factors):
        chosen = demonstrations.group == u
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
