"""The whole outline of a berry of which only a part shows, completed from the edges that are its own.

Where something nearer begins at the outline, or a neighbour as near has bitten a notch into it, the berry goes on
behind; only the rest of the outline tells where it ends. A tapered ellipse is fitted to that rest, must not lie inside
the covered part, and is held to what berries look like as far as the edges leave it open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Completion", "complete_outline", "trace_contour"]

_MOST_POINTS = 48
_NOTCH = (2.0, 0.04)
"""Pixels, and share of the mask's diameter, by which an outline lies inside its hull where a neighbour covers it."""
_EDGE_NOISE = 0.0012
"""Metres by which a berry's edge is off a tapered ellipse."""
_INDEPENDENT = 14
"""Edge points count as so many independent ones, however many there are: neighbours are off alike."""
_MEAN = np.array((0.0, 0.0, math.log(0.0185), math.log(0.78), 0.15, 0.0))
_SPREAD = np.array((0.012, 0.012, 0.22, 0.12, 0.12, 0.25))
"""Of the middle about the outline's (m), ln half length (m), ln width / length, taper, turn of the axis (rad)."""
_MOST_CHANGE = np.array((0.01, 0.01, 0.4, 0.3, 0.2, 0.4))
_DIFFERENCE = np.array((1e-5, 1e-5, 1e-4, 1e-4, 1e-4, 1e-4))
_NEIGHBOURS = np.concatenate((np.zeros((1, 6)), np.diag(_DIFFERENCE)))
_ROUNDS = 12
_NARROWEST = 0.2


@dataclass(frozen=True)
class Completion:
    """A tapered ellipse that may be a berry's whole outline: |across| ≤ half width · √(1 − u²) · (1 − taper · u).

    u runs from −1 at the top to 1 at the bottom of its axis.

    Parameters
    ----------
    begin, length, width
        Where it begins along the berry's axis, and its size along and across its own axis; metres.
    taper
        By how much it is narrower towards the bottom.
    turn
        Radians from the berry's axis to its own.
    uncertainty
        Standard deviation of the logarithm of the volume of the body that it sweeps, as the edges leave it open.
    length_uncertainty
        That of the logarithm of the length.
    misfit
        Root mean square by which the berry's own edges are off it, over half its width; 0 without such edges.
    own
        Share of the outline that is the berry's own edge; 0 if nothing is known of it.
    """

    begin: float
    length: float
    width: float
    taper: float
    turn: float
    uncertainty: float
    length_uncertainty: float
    misfit: float
    own: float

    @property
    def volume(self) -> float:
        """Cubic metres, turned about its axis: π a b² (4/3 + 4/15 taper²) of half length a, half width b."""
        halves = self.length * self.width**2 / 8.0
        return math.pi * halves * (4.0 + 0.8 * self.taper**2) / 3.0


def trace_contour(
    mask: NDArray[np.bool_], near: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Pixels (K, 2) along the outline of a mask (H, W) of one piece, and whether the berry goes on behind each (K,).

    It does where something nearer is ``near`` (:func:`~punnet.weight.silhouette.near_something_nearer`), and in notches.
    """
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    whole = max(contours, key=len)[:, 0, :]
    pixels = whole[:: max(1, math.ceil(len(whole) / _MOST_POINTS))]
    covered = near[pixels[:, 1], pixels[:, 0]]
    notch = _depth_inside(cv2.convexHull(whole)[:, 0, :].astype(np.float64), pixels.astype(np.float64))
    deepest = max(_NOTCH[0], _NOTCH[1] * math.sqrt(float(mask.sum())))
    return pixels.astype(np.float64), np.asarray(covered | (notch > deepest))


def complete_outline(
    points: NDArray[np.float64], covered: NDArray[np.bool_], outline: NDArray[np.float64]
) -> Completion:
    """The tapered ellipse that a berry's edges and what berries look like make likeliest (Levenberg and Marquardt).

    Parameters
    ----------
    points
        (K, 2) along the outline, metres along the berry's axis from its top and across; may be none.
    covered
        (K,) whether the berry goes on behind it.
    outline
        (M, 2) corners of the outline as the key-points complete it, likewise; where the search starts.
    """
    start, mean = _start(outline)
    noise = _EDGE_NOISE * math.sqrt(max(1.0, len(points) / _INDEPENDENT))

    def off(settings: NDArray[np.float64]) -> NDArray[np.float64]:
        edges = _distance(settings, points, covered) / noise
        return np.concatenate((edges, (settings - mean) / _SPREAD), axis=1)

    # A place is looked at together with its neighbours, which tell the slope if the search goes on from there.
    settings, damping = start, 1e-3
    looked = off(settings + _NEIGHBOURS)
    residual, slope = looked[0], (looked[1:] - looked[0]) / _DIFFERENCE[:, None]
    cost = float(residual @ residual)
    for _ in range(_ROUNDS):
        normal, gradient = slope @ slope.T, slope @ residual
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
        tried = settings + np.clip(step, -_MOST_CHANGE, _MOST_CHANGE)
        looked = off(tried + _NEIGHBOURS)
        reached = float(looked[0] @ looked[0])
        if reached >= cost:
            damping *= 5.0
            continue
        settled = cost - reached < 1e-3 * cost
        settings, residual, cost, damping = tried, looked[0], reached, max(0.3 * damping, 1e-5)
        if settled:
            break
        slope = (looked[1:] - residual) / _DIFFERENCE[:, None]
    return _described(settings, np.linalg.inv(normal), residual[: len(points)] * noise, covered)


def _start(outline: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where to begin, and the mean of what is likely before any edge is looked at."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    length, width = high - low
    middle = (low + high) / 2.0
    mean = _MEAN.copy()
    mean[:2] = middle
    start = mean.copy()
    start[2] = math.log(min(max(length, 0.01), 0.1) / 2.0)
    start[3] = math.log(min(max(width / max(length, 1e-6), 0.5), 1.2))
    return start, mean


def _distance(
    settings: NDArray[np.float64], points: NDArray[np.float64], covered: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Metres by which points (K, 2) are outside of V ellipses (V, 6), (V, K); covered ones may be inside: 0."""
    u, v, a, taper, turn = settings[:, 0], settings[:, 1], *_sizes(settings)
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    along, across = points[:, 0] - u[:, None], points[:, 1] - v[:, None]
    along, across = along * cosine + across * sine, across * cosine - along * sine
    share = along / a[:, None]
    half = a[:, None] * np.exp(settings[:, 3:4]) * np.maximum(1.0 - taper[:, None] * share, _NARROWEST)
    radius = np.sqrt(share**2 + (across / half) ** 2) + 1e-9
    outside = (radius - 1.0) * np.hypot(along, across) / radius
    return np.where(covered, np.maximum(outside, 0.0), outside)


def _sizes(settings: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    return np.exp(settings[:, 2]), settings[:, 4], settings[:, 5]


def _described(
    settings: NDArray[np.float64],
    covariance: NDArray[np.float64],
    off: NDArray[np.float64],
    covered: NDArray[np.bool_],
) -> Completion:
    half, ratio, taper, turn = math.exp(settings[2]), math.exp(settings[3]), settings[4], settings[5]
    own = ~covered
    volume = np.array((0.0, 0.0, 3.0, 2.0, 0.4 * taper, 0.0))  # derivative of its logarithm
    return Completion(
        begin=float(settings[0]) - half,
        length=2.0 * half,
        width=2.0 * half * ratio,
        taper=float(taper),
        turn=float(turn),
        uncertainty=math.sqrt(max(float(volume @ covariance @ volume), 0.0)),
        length_uncertainty=math.sqrt(max(float(covariance[2, 2]), 0.0)),
        misfit=float(np.sqrt(np.mean(off[own] ** 2))) / (half * ratio) if own.any() else 0.0,
        own=float(own.mean()) if len(own) else 0.0,
    )


def _depth_inside(hull: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points (K, 2) lie inside of a convex polygon (C, 2), pixels."""
    edge = np.roll(hull, -1, axis=0) - hull
    length = np.maximum(np.hypot(*edge.T), 1e-9)
    away = points[:, None] - hull
    return np.asarray(np.abs((edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0]) / length).min(axis=1))
