"""Harvest many unseen plants of a suite and count, by the simulator's truth."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from punnet.errors import ConfigurationError, PunnetError
from punnet.harvest.attempts import Attempt
from punnet.harvest.benchmark_figures import figures_of
from punnet.harvest.benchmark_folder import SCHEMA, BenchmarkFolder
from punnet.harvest.benchmark_plants import AttemptResult, PlantResult
from punnet.harvest.benchmark_watch import Watch
from punnet.harvest.config import HarvestConfig
from punnet.harvest.order import DEFAULT_ORDER, order_of
from punnet.harvest.scenario import ORACLE, Scenario, Session
from punnet.harvest.suites import suite_of
from punnet.perception import load_detector
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.planning.choice import CHOICES, DEFAULT_CHOICE
from punnet.planning.named import DEFAULT_PLANNER, PLANNERS, planner_named
from punnet.sim.workers import require_backend, run_jobs
from punnet.sim.world import WorldConfig

__all__ = ["BenchmarkResult", "BenchmarkSettings", "plant_seed", "run_benchmark", "run_plant"]


@dataclass(frozen=True)
class BenchmarkSettings:
    """What decides the figures, but for the number of plants.

    Parameters
    ----------
    suite
        One of :data:`~punnet.harvest.suites.SUITES`.
    seed
        Of the benchmark; its plants have seeds of their own, :func:`plant_seed`.
    perception
        A detector's name or folder, or ``oracle``; see :class:`~punnet.harvest.scenario.Scenario`.
    choice
        How a reach is chosen; see :mod:`punnet.planning.choice`.
    order
        Which berry comes next; see :mod:`punnet.harvest.order`.
    planner, planner_bundle
        What plans; see :func:`punnet.planning.planner_named`.

    Raises
    ------
    ConfigurationError
        If there is no such suite, choice, order or planner, or the seed is negative.
    """

    suite: str = "easy"
    seed: int = 0
    perception: str = SIMULATION_DETECTOR
    choice: str = DEFAULT_CHOICE
    order: str = DEFAULT_ORDER
    planner: str = DEFAULT_PLANNER
    planner_bundle: str | None = None

    def __post_init__(self) -> None:
        suite_of(self.suite)
        order_of(self.order)
        if self.choice not in CHOICES:
            raise ConfigurationError(f"benchmark: no choice '{self.choice}'; there are {', '.join(CHOICES)}")
        if self.planner not in PLANNERS:
            raise ConfigurationError(
                f"benchmark: no planner '{self.planner}'; there are {', '.join(PLANNERS)}"
            )
        if self.seed < 0:
            raise ConfigurationError(f"benchmark: seed must be ≥ 0, got {self.seed}")

    def to_json(self) -> dict[str, Any]:
        """Plain values, with the suite's version."""
        return {
            "schema": SCHEMA,
            "suite": self.suite,
            "suite_version": suite_of(self.suite).version,
            "seed": self.seed,
            "perception": self.perception,
            "choice": self.choice,
            "order": self.order,
            "planner": self.planner,
            "planner_bundle": self.planner_bundle,
        }


@dataclass(frozen=True)
class BenchmarkResult:
    """All plants of a run, in the order of their numbers."""

    settings: BenchmarkSettings
    plants: tuple[PlantResult, ...]

    def to_json(self) -> dict[str, Any]:
        """Settings and figures, every plant's seed and attempts among them."""
        return {**self.settings.to_json(), **figures_of(self.plants)}


def plant_seed(seed: int, number: int) -> int:
    """Seed of plant ``number`` of the benchmark with ``seed``: spread out, so that no two benchmarks share plants."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])


def run_benchmark(
    settings: BenchmarkSettings,
    plants: int,
    *,
    workers: int = 1,
    backend: str = "loky",
    folder: str | Path | None = None,
    force: bool = False,
    progress: Callable[[PlantResult], None] | None = None,
) -> BenchmarkResult:
    """Harvest ``plants`` plants, the same ones for the same settings whatever the number of workers.

    Parameters
    ----------
    settings
        What is harvested, and how.
    workers
        Processes (``loky``) or tasks at a time (``ray``).
    folder
        Where each plant's result is kept as soon as it is there: a run that was interrupted goes on, and one that is
        complete can be given more plants.
    force
        Begin anew what the folder holds.
    progress
        Told of each plant as it is done, those of an earlier run first.

    Raises
    ------
    BundleError
        If the detector or the planner can't be had.
    ConfigurationError
        If a number is out of range, or Ray is asked for and not installed.
    OutputExistsError
        If the folder was made with other settings, or by something else.
    """
    if plants < 1 or workers < 1:
        raise ConfigurationError(f"benchmark: clusters and workers must be ≥ 1, got {plants} and {workers}")
    require_backend("benchmark", backend)
    if settings.perception != ORACLE:
        load_detector(settings.perception)  # else every single plant would say that it can't be had
    planner_named(settings.planner, bundle=settings.planner_bundle)
    place = None if folder is None else BenchmarkFolder(folder, settings.to_json())
    done: dict[int, PlantResult] = {}
    if place is not None:
        place.open(force=force)
        done = {number: result for number, result in place.results().items() if number < plants}
    progress = progress or (lambda result: None)
    for number in sorted(done):
        progress(done[number])
    jobs = [(settings, number) for number in range(plants) if number not in done]
    for result in run_jobs(run_plant, jobs, workers, backend):
        if place is not None:
            place.add(result)
        done[result.number] = result
        progress(result)
    finished = BenchmarkResult(settings, tuple(done[number] for number in sorted(done)))
    if place is not None:
        place.complete(finished.to_json())
    return finished


def run_plant(settings: BenchmarkSettings, number: int) -> PlantResult:
    """Grow plant ``number``, harvest it, judge it. An error ends this plant, not the benchmark."""
    if multiprocessing.parent_process() is not None:
        # Ctrl-C reaches the workers too; the process that started them ends them, without a traceback each.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    seed = plant_seed(settings.seed, number)
    try:
        watch = Watch()
        scenario = Scenario(
            seed,
            settings.perception,
            WorldConfig(arm_visuals=False),
            HarvestConfig(order=settings.order),
            suite=settings.suite,
            choice=settings.choice,
            planner=settings.planner,
            planner_bundle=settings.planner_bundle,
        )
        with Session(scenario, watch.listen) as session:
            return _harvested(PlantResult(number, seed), session, watch)
    except PunnetError as error:
        return PlantResult(number, seed, error=str(error))


def _harvested(plant: PlantResult, session: Session, watch: Watch) -> PlantResult:
    watch.session = session
    began = time.process_time()
    run = session.run()
    computing = time.process_time() - began - session.timed.seconds
    if run.interrupted:
        raise KeyboardInterrupt
    watch.finish()
    result = replace(
        plant,
        fates=tuple(session.fates()),
        attempts=tuple(_attempt(session, watch, attempt) for attempt in run.attempts),
        collisions=tuple(watch.collisions),
        seconds_simulated=run.seconds_simulated,
        seconds_computing=computing,
        error=run.stopped,
    )
    # Through JSON and back, so that figures are the same for a plant of this run and of an earlier one.
    return PlantResult.from_json(result.to_json(), "result")


def _attempt(session: Session, watch: Watch, attempt: Attempt) -> AttemptResult:
    truth = watch.attempts.get(attempt.number)
    return AttemptResult(
        outcome=str(attempt.outcome),
        phase=str(attempt.phase),
        reason=attempt.reason,
        aimed=None if truth is None else truth.aimed,
        estimate=attempt.estimate,
        interval=attempt.interval,
        true_weight=session.truth_of.get(attempt.number, float("nan")),
        located_error=float("nan") if truth is None else truth.located_error,
        cut_error=float("nan") if truth is None else truth.cut_error,
        seconds=attempt.seconds_simulated,
    )
