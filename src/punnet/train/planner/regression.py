"""Robust ridge regression of vectors: rows that fit nothing, as swapped labels do, hardly count.

The errors are taken as multivariate t with ν degrees of freedom and fitted by iteratively reweighted least squares
(Lange, Little & Taylor, 1989): a row at squared Mahalanobis distance d counts by (ν + K) / (ν + d).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "PENALTIES",
    "LeftOut",
    "Regression",
    "fit_robustly",
    "fold_numbers",
    "leave_folds_out",
]

Array = NDArray[np.float64]
PENALTIES = (1e-4, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
"""Ridge penalties to choose from, on standardised features; the last one leaves a constant."""
ITERATIONS = 30
SMALLEST = 1e-9


@dataclass(frozen=True, eq=False)
class Regression:
    """y = intercept + (x − centre) / scale · coefficients.

    Parameters
    ----------
    centre, scale
        (F,) of the features.
    intercept
        (K,)
    coefficients
        (F, K)
    gram
        (F, F) weighted second moments of the scaled features.
    rows
        Effective number of rows: Σw.
    """

    centre: Array
    scale: Array
    intercept: Array
    coefficients: Array
    gram: Array
    rows: float

    def __call__(self, features: Array) -> Array:
        """(N, K) of features (N, F)."""
        return np.asarray(self.intercept + (features - self.centre) / self.scale @ self.coefficients)

    def leverage(self, features: Array) -> Array:
        """(N,) how much surer a row's outputs would be had rows like it been learnt from: variances grow by 1 + this."""
        scaled = (features - self.centre) / self.scale
        inverse = self.precision
        return np.asarray(np.einsum("nf,fg,ng->n", scaled, inverse, scaled) + 1.0 / self.rows)

    @property
    def precision(self) -> Array:
        """(F, F) of :meth:`leverage`."""
        F = len(self.centre)
        return np.asarray(np.linalg.inv(self.gram + PENALTIES[1] * np.eye(F)) / self.rows)


def fit_robustly(
    features: Array, values: Array, penalties: Array, freedom: float, counted: Array | None = None
) -> Regression:
    """Fit (N, F) features to (N, K) values.

    Parameters
    ----------
    features, values
        At least two rows.
    penalties
        (K,) ridge penalty of each output.
    freedom
        ν; the smaller the less far-off rows count.
    counted
        (N, C, K) what of each row's error tells how far off it is; all of it if not given.
    """
    N = len(values)
    middle, scale = features.mean(axis=0), np.maximum(features.std(axis=0), SMALLEST)
    X = (features - middle) / scale
    w = np.ones(N)
    for _ in range(ITERATIONS):
        share = w / w.sum()
        x0, y0 = share @ X, share @ values
        Xc, Yc = X - x0, values - y0
        gram = (Xc * share[:, None]).T @ Xc
        right = (Xc * share[:, None]).T @ Yc
        systems = gram + penalties[:, None, None] * np.eye(X.shape[1])
        coefficients = np.linalg.solve(systems, right.T[:, :, None])[:, :, 0].T
        residual = Yc - Xc @ coefficients
        off = residual if counted is None else np.einsum("nck,nk->nc", counted, residual)
        C = off.shape[1]
        spread = (off * w[:, None]).T @ off / N
        spread += (1e-4 * np.trace(spread) / C + SMALLEST) * np.eye(C)
        distance = np.einsum("nk,kl,nl->n", off, np.linalg.inv(spread), off)
        w = (freedom + C) / (freedom + distance)
    return Regression(middle + x0 * scale, scale, y0, coefficients, gram, float(w.sum()))


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What regressions do on folds that they have not seen.

    Parameters
    ----------
    penalties
        (K,) ridge penalty of each output that does best there.
    residuals
        (N, K) of each row, by the fit to the other folds with those penalties.
    leverage
        (N,) of each row in that fit.
    freedom
        ν of the fits.
    """

    penalties: Array
    residuals: Array
    leverage: Array
    freedom: float


def leave_folds_out(
    features: Array,
    values: Array,
    folds: NDArray[np.int64],
    freedom: float,
    counted: Array | None = None,
) -> LeftOut:
    """Choose penalties by folds left out, and say how far off they are there.

    Parameters
    ----------
    features, values, freedom
        As :func:`fit_robustly`.
    folds
        (N,) which fold each row is of.
    counted
        (N, C, K) what of each row's residual counts, for one penalty that all outputs share: of an arm's joints it is where
        they take the flange, for a little too much ridge on each adds up. Without it each output has its own.
    """
    N, K = values.shape
    residuals, leverage = np.zeros((len(PENALTIES), N, K)), np.zeros((len(PENALTIES), N))
    for row, penalty in enumerate(PENALTIES):
        for fold in np.unique(folds):
            out = folds == fold
            seen = None if counted is None else counted[~out]
            fitted = fit_robustly(features[~out], values[~out], np.full(K, penalty), freedom, seen)
            residuals[row, out] = values[out] - fitted(features[out])
            leverage[row, out] = fitted.leverage(features[out])
    telling = residuals if counted is None else np.einsum("nck,pnk->pnc", counted, residuals)
    scale = np.maximum(np.median(np.abs(telling), axis=1).min(axis=0), SMALLEST)
    cost = np.log1p(np.square(telling / scale) / freedom).mean(axis=1)
    best = cost.argmin(axis=0) if counted is None else np.full(K, cost.sum(axis=1).argmin())
    return LeftOut(
        np.array(PENALTIES)[best],
        np.asarray(residuals[best, :, np.arange(K)].T),
        np.asarray(leverage[best].mean(axis=0)),
        freedom,
    )


def fold_numbers(groups: Sequence[str], most: int) -> NDArray[np.int64]:
    """(N,) fold of each row: groups stay whole, one fold each while there are at most ``most``."""
    names = {name: number for number, name in enumerate(dict.fromkeys(groups))}
    return np.array([names[group] % most for group in groups], dtype=np.int64)
