"""The fastest speed along a given path within velocity and acceleration limits (TOPP-RA).

For a path q(x) with ``q̇ = q'ẋ`` and ``q̈ = q''ẋ² + q'ẍ`` the limits are linear in b = ẋ² and u = ẍ, and on
a grid of step Δ ``b[i+1] = b[i] + 2Δu[i]``. A backward pass finds the largest b at each grid point from which
the end can still be reached at rest; a forward pass then takes the largest u that stays below it. (Pham and
Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE Transactions
on Robotics 34 (2018), algorithm 1.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

__all__ = ["fastest_motion"]

Array = NDArray[np.float64]

TINY = 1e-9


def fastest_motion(first: Array, second: Array, step: float, velocity: Array, acceleration: Array) -> PPoly:
    """Place x(t) on the path, from rest to rest, as a piecewise quadratic.

    Parameters
    ----------
    first, second
        q'(x) and q''(x), (G, J), on a grid of x from 0 with spacing ``step``.
    step
        Δ.
    velocity, acceleration
        Largest magnitudes, (J,), or (G, J) if they change along the path.

    Returns
    -------
    PPoly
        x over seconds; its breakpoints are the times at the grid points.
    """
    velocity = np.broadcast_to(velocity, first.shape)
    acceleration = np.broadcast_to(acceleration, first.shape)
    ceiling = np.square(velocity / np.maximum(np.abs(first), TINY)).min(axis=1)
    # Every joint: slope · b + base ≥ u and ≤ u, the two lines that bound u.
    divisor = np.where(np.abs(first) < TINY, TINY, first)
    slope = -second / divisor
    half = np.abs(acceleration / divisor)
    reachable = _backward(slope, half, ceiling, step)
    square = _forward(slope, half, reachable, step)
    speed = np.sqrt(square)
    durations = 2 * step / np.maximum(speed[1:] + speed[:-1], TINY)
    change = np.diff(square) / (2 * step)
    x = step * np.arange(len(first) - 1)
    return PPoly(np.stack((change / 2, speed[:-1], x)), np.concatenate(([0.0], np.cumsum(durations))))


def _backward(slope: Array, half: Array, ceiling: Array, step: float) -> Array:
    """Largest b (G,) at each grid point from which the end can be reached at rest."""
    reachable = ceiling.copy()
    reachable[-1] = 0.0
    for i in range(len(reachable) - 2, -1, -1):
        # u is bounded by lines over b; those of the step to the next point come last.
        low = np.append(slope[i], -1.0 / (2 * step)), np.append(-half[i], 0.0)
        high = np.append(slope[i], -1.0 / (2 * step)), np.append(half[i], reachable[i + 1] / (2 * step))
        closing = low[0][:, None] - high[0]
        room = high[1] - low[1][:, None]
        meets = np.where(closing > TINY, room / np.maximum(closing, TINY), np.inf)
        reachable[i] = min(reachable[i], float(meets.min()))
    return reachable


def _forward(slope: Array, half: Array, reachable: Array, step: float) -> Array:
    """Profile b (G,) from rest that takes the largest u at every step."""
    square = np.zeros(len(reachable))
    for i in range(len(reachable) - 1):
        u = float((slope[i] * square[i] + half[i]).min())
        square[i + 1] = min(max(square[i] + 2 * step * u, 0.0), reachable[i + 1])
    return square
