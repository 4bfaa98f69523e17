"""Covariances that stay positive semi-definite under rounding: checked, and taken apart into factors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf

from punnet.errors import ConfigurationError

__all__ = ["covariance_factor", "is_semi_definite", "require_semi_definite"]

Array = NDArray[np.float64]

ALLOWED_ROUNDING = 1e-8


def covariance_factor(covariance: Array) -> Array:
    """Factor F (N, N) with ``F Fᵀ`` the covariance (N, N), negative eigenvalues taken for rounding of zero.

    What is computed as ``(A F)(A F)ᵀ`` is positive semi-definite at its own scale, however much smaller than
    the covariance it is; ``A Σ Aᵀ`` or a difference is so only at the scale of Σ.
    """
    eigenvalues, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(eigenvalues, 0.0)))


def is_semi_definite(covariance: Array, rounding: float = ALLOWED_ROUNDING) -> bool:
    """Whether no eigenvalue of a symmetric matrix (N, N) lies below ``−rounding`` times its largest entry."""
    raised = covariance.copy()
    largest = float(np.abs(covariance).max())
    raised.flat[:: len(covariance) + 1] += rounding * largest + np.finfo(np.float64).tiny
    # A factor of the slightly raised matrix exists unless an eigenvalue lies below; that is ten times quicker
    # than the eigenvalues.
    return not dpotrf(raised)[1]


def require_semi_definite(covariance: Array) -> None:
    """Refuse what is not symmetric and positive semi-definite but for rounding, 1e-8 of the largest entry.

    Raises
    ------
    ConfigurationError
        With the smallest eigenvalue.
    """
    largest = float(np.abs(covariance).max())
    if float(np.abs(covariance - covariance.T).max()) > ALLOWED_ROUNDING * largest:
        raise ConfigurationError("trajectory distribution: weight_covariance is not symmetric")
    if not is_semi_definite(covariance):
        smallest = float(np.linalg.eigvalsh(covariance)[0])
        raise ConfigurationError(
            f"trajectory distribution: weight_covariance has a negative eigenvalue, {smallest:.3g}"
        )
