"""What a learned planner has to beat: a constant, the nearest, ridge regression, a Gaussian process, and depth."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, PlanningError
from punnet.movement import TrajectoryDistribution
from punnet.movement.distribution import Space
from punnet.planning.deep_promp import DeepProMPPlanner, FusedPlanner
from punnet.planning.planner import Planner
from punnet.planning.promp_depth import ProMPDepthPlanner
from punnet.planning.reaches import DEGREES, Movements, Reaches
from punnet.robot import HOME, Panda
from punnet.scene import Frame, Target
from punnet.train.planner.full import given_its_end, target_boxes
from punnet.train.planner.prediction import Prediction
from punnet.train.planner.training import demonstrated_joints

__all__ = ["BASELINES", "DepthPrediction", "baseline", "fused", "needs_points"]

Array = NDArray[np.float64]
RIDGE = 1e-3


@dataclass(frozen=True, eq=False)
class _Told:
    """Mean weights, and how unsure they are, by a function of box centres (P, 2); one covariance for all beside."""

    name: str
    space: Space
    tell: Callable[[Array], tuple[Array, Array]]
    covariance: Array

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph."""
        mean, doubt = self.tell(reaches.centres)
        covariance = np.broadcast_to(self.covariance + doubt, (len(mean), *self.covariance.shape))
        return Movements(mean.reshape(len(mean), DEGREES, -1), covariance)


@dataclass(frozen=True, eq=False)
class _Nearest:
    """The movement of the target whose box is nearest."""

    name: str
    space: Space
    reaches: Reaches

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph."""
        apart = np.linalg.norm(reaches.centres[:, None] - _centres(self.reaches), axis=2)
        return self.reaches.movements(self.space)[apart.argmin(axis=1)]


@dataclass(frozen=True, eq=False)
class DepthPrediction:
    """A planner that is told where the berry hangs in space; joint space.

    Where it finds no reach, the demonstrated ones stand in. It sees the marked pictures, in which no light can be told.

    Parameters
    ----------
    name
        In tables.
    planner
        Plans from home.
    otherwise
        Demonstrated reaches.
    """

    name: str
    planner: Planner
    otherwise: Movements
    space: Space = "joint"

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph; points are looked at."""
        found = [
            self._plan(reaches.boxes[row], reaches.pictures[row], reaches.points[target])
            for row, target in enumerate(reaches.targets)
        ]
        return Movements(np.array([f[0] for f in found]), np.array([f[1] for f in found]))

    def _plan(self, box: Array, picture: NDArray[np.uint8], point: Array) -> tuple[Array, Array]:
        frame = Frame(rgb=picture)
        side = picture.shape[0]
        try:
            planned = self.planner.plan(frame, Target(box=box * side, picking_point=point), np.asarray(HOME))
        except PlanningError:
            return self.otherwise.mean[0], self.otherwise.covariance[0]
        return planned.weight_mean, planned.weight_covariance


def _constant(reaches: Reaches, space: Space, seed: int) -> Prediction:
    movements = reaches.movements(space)
    weights = movements.mean.reshape(len(movements), -1)

    def tell(centres: Array) -> tuple[Array, Array]:
        return np.tile(weights.mean(axis=0), (len(centres), 1)), np.zeros((len(centres), 1, 1))

    return _Told(f"constant-{space}", space, tell, np.cov(weights.T) + movements.covariance.mean(axis=0))


def _ridge(degree: int) -> Callable[[Reaches, Space, int], Prediction]:
    """Weights by ridge regression on the polynomial of the box's centre."""

    def fit(reaches: Reaches, space: Space, seed: int) -> Prediction:
        from sklearn.linear_model import Ridge
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import PolynomialFeatures, StandardScaler

        movements = reaches.movements(space)
        weights, centres = movements.mean.reshape(len(movements), -1), _centres(reaches)
        model = make_pipeline(
            PolynomialFeatures(degree, include_bias=False), StandardScaler(), Ridge(alpha=RIDGE)
        )
        model.fit(centres, weights)
        residuals = weights - model.predict(centres)

        def tell(asked: Array) -> tuple[Array, Array]:
            return np.asarray(model.predict(asked), dtype=np.float64), np.zeros((len(asked), 1, 1))

        covariance = residuals.T @ residuals / len(residuals) + movements.covariance.mean(axis=0)
        return _Told(f"ridge-{degree}-{space}", space, tell, covariance)

    return fit


def _gaussian_process(reaches: Reaches, space: Space, seed: int) -> Prediction:
    """One process for each number of the end; the demonstrated movement is conditioned on it as in ``full``."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    movements = reaches.movements(space)
    H = np.asarray(np.kron(np.eye(DEGREES), reaches.basis.phi([1.0])), dtype=np.float64)
    ends = movements.mean.reshape(len(movements), -1) @ H.T
    kernel = ConstantKernel(1.0) * RBF([0.5, 0.5], (0.05, 20.0)) + WhiteKernel(0.1, (1e-6, 10.0))
    processes = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a length scale at its bound: the box does not tell that number
        for values in ends.T:
            process = GaussianProcessRegressor(
                kernel, normalize_y=True, n_restarts_optimizer=2, random_state=seed
            )
            processes.append(process.fit(_centres(reaches), values))
    given = given_its_end(movements, H)

    def tell(centres: Array) -> tuple[Array, Array]:
        told = [process.predict(centres, return_std=True) for process in processes]
        mean, std = (np.stack([one[part] for one in told], axis=1) for part in (0, 1))
        doubt = given.gain * std[:, None, :]
        return given.middle + mean @ given.gain.T, doubt @ doubt.transpose(0, 2, 1)

    within = given.gain @ H @ movements.covariance.mean(axis=0) @ H.T @ given.gain.T
    return _Told(f"gp-{space}", space, tell, given.rest + within)


def _nearest(reaches: Reaches, space: Space, seed: int) -> Prediction:
    return _Nearest(f"nearest-{space}", space, reaches)


def _promp_depth(reaches: Reaches, space: Space, seed: int) -> Prediction:
    demonstrated = demonstrated_joints(reaches)
    return DepthPrediction("promp-depth", ProMPDepthPlanner(demonstrated, Panda()), _alone(demonstrated))


BASELINES: dict[str, Callable[[Reaches, Space, int], Prediction]] = {
    "constant": _constant,
    "nearest": _nearest,
    "ridge-1": _ridge(1),
    "ridge-2": _ridge(2),
    "gp": _gaussian_process,
    "promp-depth": _promp_depth,
}
"""By name; ``promp-depth`` needs the berry's place in space and predicts joints, whatever is asked for."""


def baseline(name: str, reaches: Reaches, space: Space, seed: int = 0) -> Prediction:
    """Fit a baseline.

    Raises
    ------
    ConfigurationError
        If there is none of that name, or it needs points that the reaches do not have.
    """
    if name not in BASELINES:
        raise ConfigurationError(f"planner: no baseline '{name}'; there are {', '.join(BASELINES)}")
    if needs_points(name) and not np.isfinite(reaches.points).all():
        raise ConfigurationError(f"{reaches.name}: {name} needs to know where each berry hangs in space")
    return BASELINES[name](reaches, space, seed)


def needs_points(name: str) -> bool:
    """Whether a baseline is told the berry's place in space."""
    return name == "promp-depth"


def fused(deep: DeepProMPPlanner) -> DepthPrediction:
    """A learned planner conditioned on the berry's place in space."""
    return DepthPrediction("fused", FusedPlanner(deep), _alone(deep.demonstrated))


def _alone(distribution: TrajectoryDistribution) -> Movements:
    return Movements(distribution.weight_mean[None], distribution.weight_covariance[None])


def _centres(reaches: Reaches) -> Array:
    """(M, 2) of each target."""
    boxes = target_boxes(reaches)
    return np.asarray((boxes[:, :2] + boxes[:, 2:]) / 2.0)
