"""Figure 6.12 of the thesis: what the networks predict of new plants, carried out by the arm before those plants.

Of every target the mean and the trajectories at ±2σ, all coordinates at once, as in table 6.3. A reach of poses is followed by
inverse kinematics from home. What comes of it is measured at the arm, not at the prediction: a reach that the arm can't follow,
or that its guard refuses, is not executed and is counted as such.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos import DemonstrationSet
from punnet.errors import ConfigurationError, KinematicsError
from punnet.geometry import make_transform, quaternion_from_rotation, rotation_from_quaternion
from punnet.movement import GaussianBasis
from punnet.movement.distribution import Space
from punnet.planning.reaches import Movements, Reaches
from punnet.robot import follow_path
from punnet.sim.demonstrations_factory import regrow_scene
from punnet.sim.executed_reaches import Execution, ReachExecutor
from punnet.sim.world import WorldConfig, build_world

__all__ = ["SIGMAS", "Executed", "ExecutedReach", "execute_predictions"]

Array = NDArray[np.float64]
SIGMAS = (0, -2, 2)
"""Trajectories of each prediction: the mean, and so many standard deviations beside it."""
INSTANTS = 150
JOINED = 0.3
"""Phase until which a predicted start that is not quite home has been left."""
NOT_FOLLOWED = "the arm can't follow it"


@dataclass(frozen=True, eq=False)
class ExecutedReach:
    """One trajectory, carried out.

    Parameters
    ----------
    network, target, sigma
        What predicted it, for which target, how many standard deviations beside the mean.
    position, orientation
        Eq. 6.2 where the arm stood at last: metres, and the distance of the quaternions; NaN if it never moved.
    reason
        Why it did not come to its end; None if it did.
    peak_force
        Newtons on a berry at most.
    way
        (T, 3) of the flange.
    """

    network: str
    target: str
    sigma: int
    position: float
    orientation: float
    reason: str | None
    peak_force: float
    way: Array

    @property
    def moved(self) -> bool:
        """Whether it was carried out, to its end or to where something stopped it."""
        return bool(np.isfinite(self.position))


@dataclass(frozen=True, eq=False)
class Executed:
    """All reaches, and where the demonstrations of each target lead, (M, T, 3) by its name."""

    reaches: tuple[ExecutedReach, ...]
    demonstrated: Mapping[str, Array]

    def of(self, network: str, *, beside: bool) -> tuple[ExecutedReach, ...]:
        """A network's means, or its trajectories beside them."""
        return tuple(r for r in self.reaches if r.network == network and (r.sigma != 0) == beside)

    def position(self, network: str, *, beside: bool) -> Array:
        """(N,) metres from the demonstrated end, of what was carried out."""
        return np.array([reach.position for reach in self.of(network, beside=beside) if reach.moved])

    def to_json(self) -> list[dict[str, Any]]:
        """Plain values of each reach, without its way."""
        return [
            {
                "network": reach.network,
                "target": reach.target,
                "sigma": reach.sigma,
                "position_m": reach.position if reach.moved else None,
                "orientation": reach.orientation if reach.moved else None,
                "reason": reach.reason,
                "peak_force_n": round(reach.peak_force, 2),
            }
            for reach in self.reaches
        ]


def execute_predictions(
    predictions: Mapping[str, tuple[Space, Movements]],
    demonstrations: DemonstrationSet,
    reaches: Reaches,
    *,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Executed:
    """Carry out what was predicted of the first photograph of each target.

    Parameters
    ----------
    predictions
        By network: the space, and (P) movements, one a photograph of ``reaches``.
    demonstrations
        A set of :func:`~punnet.sim.demonstrations_factory.simulate_demonstration_set`, whose plants are grown again.
    reaches
        Of that set.
    workers
        Processes, a plant at a time each.
    progress
        Told how many plants are done.

    Raises
    ------
    ConfigurationError
        If the plants can't be grown again.
    """
    import joblib

    first = {int(target): row for row, target in reversed(list(enumerate(reaches.targets)))}
    worlds = {
        episode.target_id: int(episode.extra.get("world_seed", -1))
        for episode in demonstrations
        if episode.target_id
    }
    plants = list(dict.fromkeys(reaches.groups))
    jobs = []
    for number, plant in enumerate(plants):
        rows = [row for row, group in enumerate(reaches.groups) if group == plant]
        tasks = [
            _Task(
                name,
                space,
                reaches.target_ids[row],
                reaches.basis,
                found.mean[first[row]],
                found.blocks[first[row]],
                reaches.pose.mean[row],
            )
            for name, (space, found) in predictions.items()
            for row in rows
        ]
        jobs.append((demonstrations.info, number, worlds[reaches.target_ids[rows[0]]], tasks))
    done: list[ExecutedReach] = []
    with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        for index, part in enumerate(
            joblib.Parallel(n_jobs=workers, return_as="generator")(
                joblib.delayed(_execute)(*job) for job in jobs
            ),
            1,
        ):
            done += part
            if progress is not None:
                progress(index)
    phi = reaches.basis.phi(np.linspace(0.0, 1.0, INSTANTS))
    ways = {
        name: np.asarray((mean @ phi.T)[:3].T)
        for name, mean in zip(reaches.target_ids, reaches.pose.mean, strict=True)
    }
    return Executed(tuple(done), ways)


@dataclass(frozen=True, eq=False)
class _Task:
    """A prediction to carry out: weights (7, B) and blocks (7, B, B), and the demonstrated pose weights (7, B)."""

    network: str
    space: Space
    target: str
    basis: GaussianBasis
    mean: Array
    blocks: Array
    demonstrated: Array


def _execute(
    info: Mapping[str, Any], plant: int, world_seed: int, tasks: Sequence[_Task]
) -> list[ExecutedReach]:
    """All reaches to one plant. Runs in a worker."""
    scene = regrow_scene(info, plant)
    if scene.world_seed != world_seed:
        raise ConfigurationError(
            f"demonstrations: plant {plant} grows otherwise than when it was demonstrated; simulate the set anew"
        )
    executor = ReachExecutor(build_world(scene.world_seed, WorldConfig(scene.config, arm_visuals=False)))
    start = executor.start
    return [_carried_out(executor, task, sigma, start) for task in tasks for sigma in SIGMAS]


def _carried_out(executor: ReachExecutor, task: _Task, sigma: int, start: Array) -> ExecutedReach:
    path = _joints(task, sigma, start)
    if path is None:
        return _reach(task, sigma, None, NOT_FOLLOWED)
    execution = executor.execute(path)
    refused = execution.reason is not None and execution.reason.startswith("unsafe")
    return _reach(task, sigma, None if refused else execution, execution.reason)


def _reach(task: _Task, sigma: int, execution: Execution | None, reason: str | None) -> ExecutedReach:
    if execution is None:
        nowhere = np.empty((0, 3))
        return ExecutedReach(task.network, task.target, sigma, np.nan, np.nan, reason, 0.0, nowhere)
    true = task.demonstrated @ task.basis.phi([1.0])[0]
    turned = quaternion_from_rotation(execution.end[:3, :3])
    unit = true[3:] / np.linalg.norm(true[3:])
    return ExecutedReach(
        task.network,
        task.target,
        sigma,
        float(np.linalg.norm(execution.end[:3, 3] - true[:3])),
        float(min(np.linalg.norm(turned - unit), np.linalg.norm(turned + unit))),
        reason,
        execution.peak_force,
        execution.way,
    )


def _joints(task: _Task, sigma: int, start: Array) -> Array | None:
    """(T, 7) from ``start``; None where the arm can't follow predicted poses."""
    phases = np.linspace(0.0, 1.0, INSTANTS)
    phi = task.basis.phi(phases)
    deviation = np.sqrt(np.maximum(np.einsum("tb,dbc,tc->td", phi, task.blocks, phi), 0.0))
    curve = phi @ task.mean.T + sigma * deviation
    if task.space == "task":
        lengths = np.maximum(np.linalg.norm(curve[:, 3:], axis=1, keepdims=True), 1e-9)
        poses = make_transform(rotation_from_quaternion(curve[:, 3:] / lengths), curve[:, :3])
        try:
            curve = follow_path(poses, start)
        except KinematicsError:
            return None
    # Predicted starts lie near home, not at it.
    left = np.clip(phases / JOINED, 0.0, 1.0)
    return np.asarray(curve + (1.0 - left * left * (3.0 - 2.0 * left))[:, None] * (start - curve[0]))
