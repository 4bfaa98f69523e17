"""Ours, ``full``: where the reach ends is told from the target's box, and the demonstrated movement is conditioned on it.

1. The end e (7 numbers: the flange's position and quaternion, or the joints) is regressed robustly on the degree-2
   polynomial of the box's centre (:mod:`punnet.train.planner.regression`), and so is its uncertainty, over all
   degrees of freedom at once, from errors on groups left out.
2. All demonstrated movements make one Gaussian N(m, S) over the weights. With H the basis at the end, its conditional on an
   end ~ N(e, V) is N(m + K (e − H m), (I − K H) S (I − K H)ᵀ + K V Kᵀ) with K = S Hᵀ (H S Hᵀ)⁻¹: Eq. 5.8 with
   a via-point that is itself uncertain.

It earns its place on few real demonstrations, where networks that see the whole picture learn it by heart.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from punnet.errors import ConfigurationError
from punnet.movement.distribution import Space
from punnet.planning.reaches import DEGREES, Movements, Reaches
from punnet.train.planner.regression import Regression, choose_penalties, fit_robustly, fold_numbers

__all__ = ["FullConfig", "FullPrediction", "GivenItsEnd", "fit_full", "given_its_end", "target_boxes"]

Array = NDArray[np.float64]
FOLDS = 8
"""Most folds that groups are left out in to choose penalties and to see how far off ends are."""
LEAST_TARGETS = 6
WIDENINGS = np.geomspace(0.1, 10.0, 81)
TOLERANCES = {0.5: 0.07, 0.9: 0.05}
"""Shares of demonstrations that regions are to hold, and how far off each may be."""
RIDGE = 1e-9


@dataclass(frozen=True)
class FullConfig:
    """How ``full`` is fitted.

    Parameters
    ----------
    space
        ``joint`` or ``task``.
    freedom
        ν of the multivariate t that errors are taken to have: the smaller, the less rows count that fit nothing.
    """

    space: Space = "task"
    freedom: float = 2.5

    def __post_init__(self) -> None:
        if self.space not in get_args(Space):
            raise ConfigurationError(f"planner: space must be joint or task, got {self.space!r}")
        if not (np.isfinite(self.freedom) and self.freedom > 0):
            raise ConfigurationError(f"planner: freedom must be positive, got {self.freedom}")

    @property
    def kind(self) -> str:
        """``full``."""
        return "full"

    @property
    def name(self) -> str:
        """Kind and space."""
        return f"full-{self.space}"


@dataclass(frozen=True, eq=False)
class FullPrediction:
    """A fitted ``full``.

    Parameters
    ----------
    config
        How.
    regression
        Polynomial of the box's centre to the end (7,).
    gain
        (7·B, 7): K.
    middle
        (7·B,): m − K H m.
    rest
        (7·B, R) root of what the end leaves open.
    doubt
        (7·B, 7) root of K V Kᵀ, V how far off ends are on unseen groups.
    functions
        B.
    left_out
        How far off the ends of groups left out are: in task space ``position_m`` and ``orientation``, the means of
        Eq. 6.2; in joint space ``joints_rad``, the mean length.
    """

    config: FullConfig
    regression: Regression
    gain: Array
    middle: Array
    rest: Array
    doubt: Array
    functions: int
    left_out: dict[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Kind and space."""
        return self.config.name

    @property
    def space(self) -> Space:
        """Joint or task."""
        return self.config.space

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph."""
        features = _polynomial(reaches.centres)
        mean = self.middle + self.regression(features) @ self.gain.T
        growth = 1.0 + self.regression.leverage(features)
        covariance = self.rest @ self.rest.T + growth[:, None, None] * (self.doubt @ self.doubt.T)
        return Movements(mean.reshape(len(mean), DEGREES, self.functions), covariance)


def fit_full(config: FullConfig, reaches: Reaches) -> FullPrediction:
    """Fit ``full`` to reaches: a second, not an hour.

    Raises
    ------
    ConfigurationError
        If there are fewer than six targets, or all are of one group: how far off it is on others can't be told then.
    """
    M = len(reaches.target_ids)
    if M < LEAST_TARGETS or len(set(reaches.groups)) < 2:
        raise ConfigurationError(
            f"{reaches.name}: `full` needs {LEAST_TARGETS} targets or more of two plants or scenes or more, got {M} of "
            f"{len(set(reaches.groups))}"
        )
    movements, functions = reaches.movements(config.space), reaches.basis.count
    H = np.asarray(np.kron(np.eye(DEGREES), reaches.basis.phi([1.0])), dtype=np.float64)
    ends = movements.mean.reshape(M, -1) @ H.T
    features = _polynomial(_centres(target_boxes(reaches)))
    folds = fold_numbers(reaches.groups, FOLDS)
    penalties, off = choose_penalties(features, ends, folds, config.freedom)
    regression = fit_robustly(features, ends, penalties, config.freedom)
    given = given_its_end(movements, H)
    doubt = _doubt_of_ends(config, reaches, off, H @ movements.covariance.mean(axis=0) @ H.T)
    return FullPrediction(
        config,
        regression,
        given.gain,
        given.middle,
        _root(given.rest),
        given.gain @ _root(doubt),
        functions,
        _left_out(config.space, ends, off),
    )


def _left_out(space: Space, ends: Array, off: Array) -> dict[str, float]:
    if space == "joint":
        return {"joints_rad": float(np.linalg.norm(off, axis=1).mean())}
    told, true = (_quaternions(values[:, 3:]) for values in (ends - off, ends))
    return {
        "position_m": float(np.linalg.norm(off[:, :3], axis=1).mean()),
        "orientation": float(np.linalg.norm(told - true, axis=1).mean()),
    }


def _quaternions(values: Array) -> Array:
    """(N, 4) of unit length."""
    return np.asarray(values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), RIDGE))


def target_boxes(reaches: Reaches) -> Array:
    """(M, 4) mean box of each target over its photographs."""
    count = np.bincount(reaches.targets, minlength=len(reaches.target_ids))
    total = np.zeros((len(count), 4))
    np.add.at(total, reaches.targets, reaches.boxes)
    return np.asarray(total / np.maximum(count, 1)[:, None])


@dataclass(frozen=True, eq=False)
class GivenItsEnd:
    """All demonstrated movements, given where they end: weights = middle + gain · end, with covariance ``rest``.

    Parameters
    ----------
    gain
        (7·B, 7): K = S Hᵀ (H S Hᵀ)⁻¹.
    middle
        (7·B,): m − K H m.
    rest
        (7·B, 7·B): (I − K H) S (I − K H)ᵀ.
    """

    gain: Array
    middle: Array
    rest: Array


def given_its_end(movements: Movements, H: Array) -> GivenItsEnd:
    """Conditional of movements (M) on their end, ``H`` (7, 7·B) of the weights."""
    weights = movements.mean.reshape(len(movements), -1)
    S = np.cov(weights.T) + movements.covariance.mean(axis=0)
    gain = np.linalg.solve(H @ S @ H.T + RIDGE * np.eye(DEGREES), H @ S).T
    left = np.eye(len(S)) - gain @ H
    mean = weights.mean(axis=0)
    return GivenItsEnd(gain, mean - gain @ (H @ mean), left @ S @ left.T)


def _doubt_of_ends(config: FullConfig, reaches: Reaches, off: Array, within: Array) -> Array:
    """V (7, 7): scatter of the ends of groups left out, widened so that regions hold the shares they should.

    Parameters
    ----------
    off
        (M, 7) end minus prediction, of targets in groups left out.
    within
        (7, 7) how ends of repeats to one target differ.
    """
    scatter = _robust_scatter(off, config.freedom)
    space = slice(0, 3) if config.space == "task" else slice(0, DEGREES)
    demonstrated = _offs_of_demonstrations(config, reaches, off)[:, space]
    n = demonstrated.shape[1]

    def missed(widening: float) -> float:
        region = (widening * scatter + within)[space, space]
        distance = np.einsum(
            "pk,kl,pl->p", demonstrated, np.linalg.inv(region + RIDGE * np.eye(n)), demonstrated
        )
        return max(
            abs(float((distance < chi2.ppf(share, n)).mean()) - share) / tolerance
            for share, tolerance in TOLERANCES.items()
        )

    widening = min(WIDENINGS, key=missed)
    return np.asarray(widening * scatter + within)


def _offs_of_demonstrations(config: FullConfig, reaches: Reaches, off: Array) -> Array:
    """(P, 7) how far each demonstration ended from what is told of its target; in joint space of the targets' means."""
    if config.space == "joint":
        return off[reaches.targets]
    last = reaches.basis.phi([1.0])[0]
    return np.asarray(off[reaches.targets] + reaches.ends - (reaches.pose.mean @ last)[reaches.targets])


def _robust_scatter(off: Array, freedom: float) -> Array:
    """Scatter (K, K) of a multivariate t around zero."""
    N, K = off.shape
    w, scatter = np.ones(N), np.eye(K)
    for _ in range(50):
        scatter = (off * w[:, None]).T @ off / N
        scatter += (1e-6 * np.trace(scatter) / K + RIDGE) * np.eye(K)
        w = (freedom + K) / (freedom + np.einsum("nk,kl,nl->n", off, np.linalg.inv(scatter), off))
    return np.asarray(scatter)


def _centres(boxes: Array) -> Array:
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2.0)


def _polynomial(centres: Array) -> Array:
    """(N, 5) u, v, u², uv, v² of centres (N, 2), from the middle of the picture."""
    u, v = (centres - 0.5).T
    return np.stack((u, v, u * u, u * v, v * v), axis=1)


def _root(covariance: Array) -> Array:
    """F (n, R) with F Fᵀ = ``covariance``."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    kept = values > 1e-12 * max(values[-1], 0.0)
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))
