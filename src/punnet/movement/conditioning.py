"""Conditioning a Gaussian over weights on linear observations, in closed form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtri

from punnet.errors import ConfigurationError
from punnet.movement.basis import GaussianBasis
from punnet.movement.covariance import covariance_factor, is_semi_definite
from punnet.movement.via_point import ViaPoint

__all__ = ["condition_gaussian", "condition_on_via_points", "observe"]

Array = NDArray[np.float64]

RELATIVE_RANK = 1e-12
GOOD_PIVOT = 1e-4  # of the scaled innovation; below it the form is taken that rounding can't hurt
UNMET_TOLERANCE = 1e-6
MUCH_LESS = 0.1  # of the largest variance: from there on rounding of the prior is looked for in what is left
SURE_VARIANCE = 0.05  # of what a row could have, in the mean of all rows: from there on, too
ROUNDING_LEFT = 1e-11  # of the largest entry; with more in what is left the other form is taken
SAFE_VARIANCE = 1e-6  # of what a row could have; below it rounding of the prior grows in what is left


def condition_gaussian(
    mean: Array, covariance: Array, observation: Array, values: Array, noise: Array
) -> tuple[Array, Array]:
    """Posterior of ``w ~ N(mean, covariance)`` given ``values = observation @ w + noise``, all rows at once.

    The gain is ``K = Σ Aᵀ (A Σ Aᵀ + R)⁻¹``. Where the rows, scaled to unit variance, are nearly dependent,
    directions without variance are dropped, so repeated via-points do no harm, and the covariance is updated in
    Joseph's form ``(I − K A) Σ (I − K A)ᵀ + K R Kᵀ`` by factors of Σ and R, which stays positive semi-definite
    however little is left of Σ.

    Parameters
    ----------
    mean, covariance
        (N,) and (N, N) of the prior.
    observation, values
        Matrix A (M, N) and values (M,).
    noise
        Noise variances (M,) of the values, or their covariance R (M, M).

    Returns
    -------
    tuple
        Mean (N,) and covariance (N, N) of the posterior.

    Raises
    ------
    ConfigurationError
        If noise-free values can't be met: they contradict each other or the prior has no variance there.
    """
    if len(values) == 0:
        return mean, covariance
    cross = observation @ covariance
    quick = _condition_quickly(
        mean,
        covariance,
        cross,
        cross @ observation.T,
        values - observation @ mean,
        noise,
        float(np.vdot(observation, observation)),
    )
    return quick or _condition_carefully(mean, covariance, observation, values, noise)


def condition_on_via_points(
    mean: Array, covariance: Array, basis: GaussianBasis, via_points: Sequence[ViaPoint]
) -> tuple[Array, Array]:
    """Posterior mean (D, B) and covariance (D·B, D·B) of weights, given via-points, as :func:`condition_gaussian`.

    Where every via-point is for all degrees of freedom, the same basis functions see each of them, and the
    observation matrix, mostly zeros, need not be made.
    """
    D, B = mean.shape
    if all(point.degrees_of_freedom is None and len(point.values) == D for point in via_points):
        rows = _basis_rows(via_points, basis)
        cross = np.matmul(rows, covariance.reshape(D, B, D * B)).reshape(-1, D * B)
        innovation = (cross.reshape(-1, B) @ rows.T).reshape(len(cross), -1)
        values = np.array([point.values for point in via_points]).T
        noise = _variances_by_degree(via_points, D)
        residual = (values - mean @ rows.T).ravel()
        quick = _condition_quickly(
            mean.ravel(), covariance, cross, innovation, residual, noise, D * float(np.vdot(rows, rows))
        )
        if quick:
            return quick[0].reshape(D, B), quick[1]
    observation, stacked, noise = observe(via_points, basis, D)
    updated, spread = condition_gaussian(mean.ravel(), covariance, observation, stacked, noise)
    return updated.reshape(D, B), spread


def _condition_quickly(
    mean: Array,
    covariance: Array,
    cross: Array,
    innovation: Array,
    residual: Array,
    noise: Array,
    squares: float,
) -> tuple[Array, Array] | None:
    """Condition by a Cholesky factor, from A Σ (M, N), A Σ Aᵀ (M, M), the residual (M,) and the noise.

    ``squares`` is the sum of squares of A. None if the rows are nearly dependent, or one has so little variance that
    rounding would show in what is left.
    """
    if noise.ndim == 1:
        innovation.flat[:: len(cross) + 1] += noise
    else:
        innovation += noise
    variances = innovation.diagonal().copy()
    factor, failed = dpotrf(innovation.T, lower=1, overwrite_a=1)
    if failed:
        return None
    # The factor's diagonal over the variances is that of the factor of rows scaled to unit variance.
    pivot = np.minimum.reduce(factor.diagonal() ** 2 / variances)
    largest = np.maximum.reduce(covariance.diagonal())
    least, most = np.minimum.reduce(variances), squares * largest
    if pivot <= GOOD_PIVOT or least <= SAFE_VARIANCE * most:
        return None
    # With pivots like these the inverse is as good as solving, and quicker for so few rows.
    inverse, _ = dtrtri(factor, lower=1, overwrite_c=1)
    root = inverse @ cross
    # rootᵀ root of one and the same array is symmetric to the last bit.
    left = covariance - root.T @ root
    doubtful = (
        least * len(cross) < SURE_VARIANCE * most or np.maximum.reduce(left.diagonal()) < MUCH_LESS * largest
    )
    if doubtful and not is_semi_definite(left, ROUNDING_LEFT):
        return None
    return mean + (inverse @ residual) @ root, left


def _condition_carefully(
    mean: Array, covariance: Array, observation: Array, values: Array, noise: Array
) -> tuple[Array, Array]:
    R = np.diag(noise) if noise.ndim == 1 else noise
    gain = _gain(covariance, observation, R)
    posterior = mean + gain @ (values - observation @ mean)
    # Rounding in the gain leaves 1e-9 of a large correction; repeating the exact rows removes it.
    exact = np.diagonal(R) == 0.0
    if exact.any():
        exact_gain = (
            gain if exact.all() else _gain(covariance, observation[exact], np.zeros((exact.sum(),) * 2))
        )
        posterior = _polish(posterior, exact_gain, observation[exact], values[exact])
    remaining = np.eye(len(mean)) - gain @ observation
    noise_factor = gain * np.sqrt(noise) if noise.ndim == 1 else gain @ covariance_factor(noise)
    factor = np.concatenate((remaining @ covariance_factor(covariance), noise_factor), axis=1)
    return posterior, factor @ factor.T


def _gain(covariance: Array, observation: Array, noise: Array) -> Array:
    cross = covariance @ observation.T
    innovation = observation @ cross + noise
    variances = np.diag(innovation)
    varies = variances > _rounding(covariance, observation)
    inverse_scale = np.where(varies, 1.0 / np.sqrt(np.where(varies, variances, 1.0)), 0.0)
    scaled = inverse_scale[:, None] * innovation * inverse_scale
    eigenvalues, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
    kept = eigenvalues > RELATIVE_RANK * max(float(eigenvalues[-1]), 0.0)
    vectors = vectors[:, kept] * inverse_scale[:, None]
    return np.asarray((cross @ vectors / eigenvalues[kept]) @ vectors.T, dtype=np.float64)


def _rounding(covariance: Array, observation: Array) -> Array:
    """Variance (M,) of each row below which it is rounding left by an earlier exact via-point.

    A row is held against the weights that it sees: another degree of freedom may vary a million times more.
    """
    spread = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    return np.asarray(RELATIVE_RANK * np.square(np.abs(observation) @ spread))


def _polish(posterior: Array, gain: Array, observation: Array, values: Array) -> Array:
    for _ in range(2):
        posterior = posterior + gain @ (values - observation @ posterior)
    worst = float(np.abs(values - observation @ posterior).max())
    if worst > UNMET_TOLERANCE * max(1.0, float(np.abs(values).max())):
        raise ConfigurationError(
            f"via-points: exact values are missed by {worst:.2g}; they contradict each other or the "
            "demonstrations never vary there: give a std, fewer via-points, or broaden the distribution"
        )
    return posterior


def observe(
    via_points: Sequence[ViaPoint], basis: GaussianBasis, dimensions: int
) -> tuple[Array, Array, Array]:
    """Observation matrix (M, D·B), values (M,) and noise variances (M,) of via-points, one row a value."""
    rows = _basis_rows(via_points, basis)
    degrees = [point.indices(dimensions) for point in via_points]
    owner = np.repeat(np.arange(len(via_points)), [len(chosen) for chosen in degrees])
    matrix = np.zeros((len(owner), dimensions, basis.count))
    matrix[np.arange(len(owner)), np.concatenate(degrees)] = rows[owner]
    values = np.concatenate([point.values for point in via_points])
    variances = np.concatenate([point.variances for point in via_points])
    return matrix.reshape(len(owner), -1), values, variances


def _variances_by_degree(via_points: Sequence[ViaPoint], dimensions: int) -> Array:
    """Noise variances (D·P,) of via-points for all degrees of freedom, degree by degree."""
    squares = [point.std * point.std for point in via_points if isinstance(point.std, float)]
    if len(squares) == len(via_points):
        return np.array(squares * dimensions)
    return np.stack([point.variances for point in via_points], axis=1).ravel()


def _basis_rows(via_points: Sequence[ViaPoint], basis: GaussianBasis) -> Array:
    """Basis functions (P, B), or their derivatives, at each via-point."""
    orders = {point.order for point in via_points}
    if len(orders) == 1:
        return basis.derivative([point.phase for point in via_points], orders.pop())
    rows = np.empty((len(via_points), basis.count))
    for order in orders:
        of_order = [i for i, point in enumerate(via_points) if point.order == order]
        rows[of_order] = basis.derivative([via_points[i].phase for i in of_order], order)
    return rows
