"""Largest velocity, acceleration and jerk of a piecewise polynomial: upper bounds that hold everywhere on each piece."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

__all__ = ["peak_rates"]

Array = NDArray[np.float64]

DEGREE = 5
SUBSTEPS = 8


def peak_rates(curve: PPoly) -> Array:
    """Bounds (3, J) of the magnitude of the first three derivatives of a curve (T, J) of degree 5 or less.

    Each piece is sampled, both of its ends included: jerk may jump from one to the next. Between two samples δ apart a
    function exceeds the greater of them by no more than ``δ²/8 max|f''|``, which is added; with f the velocity, f'' is the
    jerk, with the acceleration the fourth derivative, and with the jerk the fifth, which is constant on a piece. So the
    bounds are never below the true peaks; above them by some percent where a piece bends wildly, else by far less.
    """
    coefficients = np.zeros((DEGREE + 1, *curve.c.shape[1:]))
    coefficients[DEGREE + 1 - len(curve.c) :] = curve.c
    step = np.diff(curve.x)[:, None]  # (T − 1, 1)
    places = np.linspace(0.0, 1.0, SUBSTEPS + 1)[:, None, None] * step
    between = np.square(step / SUBSTEPS) / 8.0
    fifth = np.abs(_derivative(coefficients, 5)[0])
    fourth = np.abs(_values(_derivative(coefficients, 4), places[[0, -1]])).max(axis=0)
    jerk = np.abs(_values(_derivative(coefficients, 3), places)).max(axis=0) + between * fifth
    acceleration = np.abs(_values(_derivative(coefficients, 2), places)).max(axis=0) + between * fourth
    velocity = np.abs(_values(_derivative(coefficients, 1), places)).max(axis=0) + between * jerk
    return np.stack([rate.max(axis=0) for rate in (velocity, acceleration, jerk)])


def _derivative(coefficients: Array, order: int) -> Array:
    """Coefficients (degree + 1 − order, T − 1, J), highest power first."""
    powers = np.arange(len(coefficients) - 1, -1, -1, dtype=np.float64)[:, None, None]
    for _ in range(order):
        coefficients, powers = coefficients[:-1] * powers[:-1], powers[:-1] - 1.0
    return coefficients


def _values(coefficients: Array, places: Array) -> Array:
    """Values (S, T − 1, J) at places (S, T − 1, 1) from the start of each piece, by Horner's rule."""
    values = np.broadcast_to(coefficients[0], (len(places), *coefficients.shape[1:]))
    for coefficient in coefficients[1:]:
        values = values * places + coefficient
    return np.asarray(values)
