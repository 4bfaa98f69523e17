"""Harvest many unseen clusters and count, by the simulator's truth."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from punnet.errors import ConfigurationError, PunnetError
from punnet.harvest.attempts import Attempt, Outcome
from punnet.harvest.judge import Fate
from punnet.harvest.scenario import ORACLE, Scenario, Session
from punnet.perception import load_detector
from punnet.perception.choosing import SIMULATION_DETECTOR
from punnet.sim.cluster import ClusterConfig
from punnet.sim.world import WorldConfig

__all__ = [
    "BenchmarkResult",
    "ClusterResult",
    "cluster_seed",
    "run_benchmark",
    "run_cluster",
    "wilson_interval",
]


@dataclass(frozen=True)
class ClusterResult:
    """One cluster: its seed, the fate of its berries, and the attempts in brief. ``error`` is why it ended early."""

    seed: int
    fates: tuple[Fate, ...] = ()
    attempts: tuple[dict[str, Any], ...] = ()
    seconds_simulated: float = 0.0
    seconds_computing: float = 0.0
    error: str | None = None


@dataclass(frozen=True)
class BenchmarkResult:
    """All clusters of a run of one perception."""

    perception: str
    seed: int
    clusters: tuple[ClusterResult, ...]

    @property
    def fates(self) -> list[Fate]:
        """The fates of all berries of all clusters."""
        return [fate for cluster in self.clusters for fate in cluster.fates]

    def to_json(self) -> dict[str, Any]:
        """The table's figures, with 95% Wilson intervals, and every cluster's seed and failures."""
        fates = self.fates
        wanted = [fate for fate in fates if fate.pluckable and fate.reachable]
        detached = [fate for fate in fates if fate.detached]
        unripe = [fate for fate in fates if not fate.pluckable]
        picks = [attempt for cluster in self.clusters for attempt in cluster.attempts]
        good = [attempt for attempt in picks if attempt["outcome"] == Outcome.PICKED]
        simulated = sum(cluster.seconds_simulated for cluster in self.clusters)
        computing = sum(cluster.seconds_computing for cluster in self.clusters)
        return {
            "perception": self.perception,
            "seed": self.seed,
            "clusters": len(self.clusters),
            "berries": len(fates),
            "pluckable": sum(fate.pluckable for fate in fates),
            "reachable_pluckable": len(wanted),
            "success": _share(sum(fate.success for fate in wanted), len(wanted)),
            "wrong_picks": _share(sum(fate.wrongly_picked for fate in detached), len(detached)),
            "damaged": _share(sum(fate.damaged for fate in detached), len(detached)),
            "unripe_touched": _share(sum(fate.collided for fate in unripe), len(unripe)),
            "attempts": len(picks),
            "seconds_a_pick": round(simulated / len(good), 2) if good else None,
            "computing_seconds_a_pick": round(computing / len(good), 2) if good else None,
            "failure_reasons": self.failure_reasons(),
            "errors": {cluster.seed: cluster.error for cluster in self.clusters if cluster.error},
            "per_cluster": [_cluster_json(cluster) for cluster in self.clusters],
        }

    def failure_reasons(self) -> dict[str, int]:
        """How often each reason ended an attempt, or kept a reachable ripe berry from being tried at all."""
        reasons: Counter[str] = Counter()
        for cluster in self.clusters:
            for attempt in cluster.attempts:
                if attempt["outcome"] != Outcome.PICKED:
                    reasons[f"{attempt['phase']}: {attempt['reason_kind']}"] += 1
            missed = sum(f.pluckable and f.reachable and not f.detached for f in cluster.fates)
            tried = sum(attempt["outcome"] != Outcome.PICKED for attempt in cluster.attempts)
            if missed > tried:
                reasons["look: never recognised as ripe and in reach"] += missed - tried
        return dict(reasons.most_common())


def wilson_interval(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson score interval of a share; (0, 1) for no trials."""
    if count == 0:
        return 0.0, 1.0
    share = hits / count
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * math.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return max(0.0, centre - half), min(1.0, centre + half)


def _share(hits: int, count: int) -> dict[str, Any]:
    low, high = wilson_interval(hits, count)
    return {
        "hits": hits,
        "of": count,
        "share": round(hits / count, 4) if count else None,
        "interval_95": [round(low, 4), round(high, 4)],
    }


def _cluster_json(cluster: ClusterResult) -> dict[str, Any]:
    wanted = [fate for fate in cluster.fates if fate.pluckable and fate.reachable]
    return {
        "seed": cluster.seed,
        "success": sum(fate.success for fate in wanted),
        "of": len(wanted),
        "wrong_picks": sum(fate.wrongly_picked for fate in cluster.fates),
        "damaged": sum(fate.damaged and fate.detached for fate in cluster.fates),
        "attempts": list(cluster.attempts),
    }


def cluster_seed(seed: int, number: int) -> int:
    """Seed of cluster ``number`` of the benchmark with ``seed``: spread out, so that no two benchmarks share plants."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])


def run_cluster(seed: int, perception: str, cluster: ClusterConfig | None = None) -> ClusterResult:
    """Grow the plant of ``seed``, harvest it, judge it. An error ends this cluster, not the benchmark."""
    if multiprocessing.parent_process() is not None:
        # Ctrl-C reaches the workers too; the process that started them ends them, without a traceback each.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    scenario = Scenario(seed, perception, WorldConfig(cluster or ClusterConfig(), arm_visuals=False))
    try:
        with Session(scenario) as session:
            run = session.run()
            if run.interrupted:
                raise KeyboardInterrupt
            return ClusterResult(
                seed,
                tuple(session.fates()),
                tuple(_brief(attempt) for attempt in run.attempts),
                run.seconds_simulated,
                run.seconds_computing,
                run.stopped,
            )
    except PunnetError as error:
        return ClusterResult(seed, error=str(error))


def _brief(attempt: Attempt) -> dict[str, Any]:
    return {
        "outcome": attempt.outcome,
        "phase": str(attempt.phase),
        "reason": attempt.reason,
        "reason_kind": (attempt.reason or "").partition(":")[0],
        "estimate_g": None if math.isnan(attempt.estimate) else round(attempt.estimate, 1),
        "weighed_g": None if math.isnan(attempt.weighed) else round(attempt.weighed, 1),
        "picking_point": [round(float(value), 4) for value in attempt.picking_point],
        "seconds": round(attempt.seconds_simulated, 2),
    }


def run_benchmark(
    clusters: int,
    seed: int,
    *,
    workers: int = 1,
    perception: str = SIMULATION_DETECTOR,
    cluster: ClusterConfig | None = None,
    progress: Callable[[ClusterResult], None] | None = None,
) -> BenchmarkResult:
    """Harvest ``clusters`` plants, the same ones for the same ``seed`` whatever the number of workers.

    Parameters
    ----------
    perception
        A detector's name or folder, or ``oracle``; see :class:`Scenario`.
    workers
        Processes; joblib's default back end, so another one can be set around this call.
    cluster
        The kind of plant; the demo's if None.
    progress
        Told of each cluster as it is done.

    Raises
    ------
    BundleError
        If the detector can't be had.
    """
    if clusters < 1 or workers < 1:
        raise ConfigurationError(f"benchmark: clusters and workers must be ≥ 1, got {clusters} and {workers}")
    if perception != ORACLE:
        load_detector(perception)  # else every single cluster would say that it can't be had
    jobs = (
        delayed(run_cluster)(cluster_seed(seed, number), perception, cluster) for number in range(clusters)
    )
    results = []
    for result in Parallel(n_jobs=workers, return_as="generator", batch_size=1)(jobs):
        results.append(result)
        if progress is not None:
            progress(result)
    return BenchmarkResult(perception, seed, tuple(results))
