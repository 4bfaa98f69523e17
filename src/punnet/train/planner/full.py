"""Ours, ``full``: where the reach ends is told from the target's box, and the demonstrated movement is conditioned on it.

1. The end e (7 numbers: the flange's position and quaternion, or the joints) is regressed robustly on the degree-2
   polynomial of the box's centre (:mod:`punnet.train.planner.regression`) and, where that helps on groups left out, on the
   box's size and on how brightly the berry is lit (:mod:`punnet.planning.berry_light`), which tell how far away it
   is. Its uncertainty, over all degrees of freedom at once, is that of groups left out
   (:mod:`punnet.train.planner.calibration`).
2. All demonstrated movements make one Gaussian N(m, S) over the weights. With H the basis at the end, its conditional on an
   end ~ N(e, V) is N(m + K (e − H m), (I − K H) S (I − K H)ᵀ + K V Kᵀ) with K = S Hᵀ (H S Hᵀ)⁻¹: Eq. 5.8 with
   a via-point that is itself uncertain.

It earns its place on few real demonstrations, where networks that see the whole picture learn it by heart.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.movement.distribution import Space
from punnet.planning.reaches import DEGREES, Movements, Reaches
from punnet.train.planner.calibration import doubt_of_ends, places
from punnet.train.planner.regression import LeftOut, Regression, fit_robustly, fold_numbers, leave_folds_out

__all__ = [
    "EndModel",
    "FullConfig",
    "FullPrediction",
    "GivenItsEnd",
    "fit_full",
    "given_its_end",
    "target_boxes",
]

Array = NDArray[np.float64]
Cue = Literal["size", "light"]
FOLDS = 8
"""Most folds that groups are left out in to choose penalties and to see how far off ends are."""
LEAST_TARGETS = 6
LOOKS: tuple[tuple[Cue, ...], ...] = (("size",), ("light",), ("size", "light"))
"""What may be looked at beside the box's centre."""
HELPFUL = 0.97
"""Share of the error on groups left out that they have to take it down to, to be looked at."""
CENTRE = 5  # numbers of a box's centre
ALL_ALIKE = 1e-3
"""Standard deviation of a cue that does not differ between targets, rounding apart."""
RIDGE = 1e-9


@dataclass(frozen=True)
class FullConfig:
    """How ``full`` is fitted.

    Parameters
    ----------
    space
        ``joint`` or ``task``.
    freedoms
        ν of the multivariate t that errors are taken to have: the smaller, the less rows count that fit nothing, as swapped
        labels do; of several, what does best on groups left out.
    """

    space: Space = "task"
    freedoms: tuple[float, ...] = (2.5, 10.0, 1e6)

    def __post_init__(self) -> None:
        if self.space not in get_args(Space):
            raise ConfigurationError(f"planner: space must be joint or task, got {self.space!r}")
        if not self.freedoms or not all(np.isfinite(freedom) and freedom > 0 for freedom in self.freedoms):
            raise ConfigurationError(f"planner: freedoms must be positive numbers, got {self.freedoms}")

    @property
    def kind(self) -> str:
        """``full``."""
        return "full"

    @property
    def name(self) -> str:
        """Kind and space."""
        return f"full-{self.space}"


@dataclass(frozen=True, eq=False)
class EndModel:
    """Where reaches end.

    Parameters
    ----------
    regression
        Features to the end (7,).
    doubt
        (7·B, 7) root of K V Kᵀ, V how far off ends are on unseen groups.
    cues
        Beside the polynomial of the box's centre.
    """

    regression: Regression
    doubt: Array
    cues: tuple[Cue, ...] = ()


@dataclass(frozen=True, eq=False)
class FullPrediction:
    """A fitted ``full``.

    Parameters
    ----------
    config
        How.
    by_centre
        Of the box's centre alone.
    closer
        What looks at more, for photographs where that is known; None if it does not help.
    gain
        (7·B, 7): K.
    middle
        (7·B,): m − K H m.
    rest
        (7·B, R) root of what the end leaves open.
    functions
        B.
    left_out
        How far off the ends of groups left out are: in task space ``position_m`` and ``orientation``, the means of
        Eq. 6.2; in joint space ``joints_rad``, the mean length.
    """

    config: FullConfig
    by_centre: EndModel
    closer: EndModel | None
    gain: Array
    middle: Array
    rest: Array
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
        mean, covariance = self._told(self.by_centre, _features((), reaches.boxes, reaches.lights))
        if self.closer is not None:
            features = _features(self.closer.cues, reaches.boxes, reaches.lights)
            known = np.isfinite(features).all(axis=1)
            mean[known], covariance[known] = self._told(self.closer, features[known])
        return Movements(mean.reshape(len(mean), DEGREES, self.functions), covariance)

    def _told(self, ends: EndModel, features: Array) -> tuple[Array, Array]:
        mean = self.middle + ends.regression(features) @ self.gain.T
        growth = 1.0 + ends.regression.leverage(features)
        return mean, self.rest @ self.rest.T + growth[:, None, None] * (ends.doubt @ ends.doubt.T)


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
    given = given_its_end(movements, H)
    within = H @ movements.covariance.mean(axis=0) @ H.T
    place = places(config.space, reaches)
    counted = None if config.space == "task" else place
    boxes, lights = target_boxes(reaches), _target_lights(reaches)

    def fitted(cues: tuple[Cue, ...]) -> tuple[EndModel, LeftOut] | None:
        features = _features(cues, boxes, lights)
        if not np.isfinite(features).all() or (cues and features[:, CENTRE:].std(axis=0).min() < ALL_ALIKE):
            return None
        folds = fold_numbers(reaches.groups, FOLDS)
        unseen = min(
            (leave_folds_out(features, ends, folds, freedom, counted) for freedom in config.freedoms),
            key=lambda one: _how_far(place, one),
        )
        regression = fit_robustly(features, ends, unseen.penalties, unseen.freedom, counted)
        doubt = doubt_of_ends(config.space, reaches, unseen, within)
        return EndModel(regression, given.gain @ _root(doubt), cues), unseen

    alone = fitted(())
    assert alone is not None
    best = min(
        (alone, *(found for found in map(fitted, LOOKS) if found is not None)),
        key=lambda found: _how_far(place, found[1]) * (HELPFUL if found is alone else 1.0),
    )
    return FullPrediction(
        config,
        alone[0],
        None if best is alone else best[0],
        given.gain,
        given.middle,
        _root(given.rest),
        functions,
        _left_out(config.space, ends, best[1].residuals),
    )


def _how_far(place: Array, unseen: LeftOut) -> float:
    """Metres that the flange is off on groups left out, on average."""
    return float(np.linalg.norm(np.einsum("mij,mj->mi", place, unseen.residuals), axis=1).mean())


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


def _target_lights(reaches: Reaches) -> Array:
    """(M,) mean over the photographs of each target; NaN if one of them is unknown."""
    count = np.bincount(reaches.targets, minlength=len(reaches.target_ids))
    total = np.zeros(len(count))
    np.add.at(total, reaches.targets, reaches.lights)
    return np.asarray(total / np.maximum(count, 1))


def _features(cues: tuple[Cue, ...], boxes: Array, lights: Array) -> Array:
    """(N, 5 + …) u, v, u², uv, v² of the centres of boxes (N, 4), from the middle of the picture, then the cues.

    The size is the logarithm of width and height; of a box that is a point it is not known: not a finite number.
    """
    u, v = ((boxes[:, :2] + boxes[:, 2:]) / 2.0 - 0.5).T
    columns = [u, v, u * u, u * v, v * v]
    if "size" in cues:
        size = boxes[:, 2:] - boxes[:, :2]
        columns += list(np.log(np.where(size > 0.0, size, np.nan)).T)
    if "light" in cues:
        columns.append(lights)
    return np.stack(columns, axis=1)


def _root(covariance: Array) -> Array:
    """F (n, R) with F Fᵀ = ``covariance``."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2.0)
    kept = values > 1e-12 * max(values[-1], 0.0)
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))
