"""The networks of chapter 6 of the thesis, trained once and told of in all its tables and figures.

``direct``, ``ae``, ``vae`` and ``cvae``, in joint and in task space, before and after tuning, learn from one set of reaches
and predict another, of other plants. Kept are their predictions, latent vectors and losses, and the networks themselves as
ONNX graphs; a stopped call goes on.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, FileFormatError
from punnet.movement.distribution import Space
from punnet.outputs import write_text
from punnet.planning.reaches import Movements, Reaches
from punnet.train.detector.config import config_from_json
from punnet.train.planner.config import KINDS, QUICK, Kind, PlannerConfig
from punnet.train.planner.deep import DeepPrediction, block_diagonal
from punnet.train.planner.export import export_planner
from punnet.train.planner.fitting import fit_planner
from punnet.train.runs import as_json, claim_run

__all__ = ["CHAPTER_MODELS", "SPACES", "ChapterSix", "Outcome", "train_chapter"]

SPACES: tuple[Space, ...] = ("joint", "task")
UNITS: tuple[tuple[Kind, ...], ...] = (("direct", "ae"), ("vae", "cvae"))
"""Kinds whose trainings share tr-1; the two take about as long."""
RUN_FILE = "chapter-6.json"
SCHEMA = "punnet-chapter-6/2"
Tell = Callable[[str], None]
Array = NDArray[np.float64]


def _config(kind: Kind, space: Space, *, tuned: bool, quick: bool) -> PlannerConfig:
    return config_from_json(
        PlannerConfig, {"kind": kind, "space": space, "tuned": tuned, **(QUICK if quick else {})}
    )


CHAPTER_MODELS: tuple[str, ...] = tuple(
    _config(kind, space, tuned=tuned, quick=True).name
    for space in SPACES
    for kind in KINDS
    for tuned in ((False,) if kind == "direct" else (False, True))
)
"""Names of all fourteen, ``l-`` before the tuned ones."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one network came to.

    Parameters
    ----------
    name, space, seed
        Of the network, and of its training.
    movements
        (P) predictions of the unseen photographs.
    latents
        (250, 256) or so: of the photographs it learnt from.
    unseen_latents
        (P, 256)
    curves
        Loss of each epoch, by stage.
    seconds
        That its own stages took; tr-1, which networks share, is with the first that needed it.
    graph
        The network, for :class:`~punnet.planning.learned.MovementModel`.
    """

    name: str
    space: Space
    seed: int
    movements: Movements
    latents: Array
    unseen_latents: Array
    curves: Mapping[str, Sequence[float]]
    seconds: float
    graph: Path


@dataclass(frozen=True, eq=False)
class ChapterSix:
    """All networks, and what they learnt from and predicted.

    Parameters
    ----------
    learnt, unseen
        Reaches.
    outcomes
        By name, one a seed.
    settings
        What they were trained with.
    """

    learnt: Reaches
    unseen: Reaches
    outcomes: Mapping[str, tuple[Outcome, ...]]
    settings: Mapping[str, Any]

    @property
    def seconds(self) -> float:
        """Of all trainings together."""
        return sum(outcome.seconds for runs in self.outcomes.values() for outcome in runs)


def train_chapter(
    learnt: Reaches,
    unseen: Reaches,
    *,
    folder: Path,
    seeds: Sequence[int],
    quick: bool,
    workers: int,
    progress: Tell,
) -> ChapterSix:
    """Train what is not trained yet, and read the rest.

    Parameters
    ----------
    learnt
        To learn from.
    unseen
        To predict; of other plants.
    folder
        Of all outcomes.
    seeds
        One training of everything for each.
    quick
        The short schedule in place of the thesis' own.
    workers
        Processes; two of them share a seed's work evenly.
    progress
        Told how it goes; with several workers it has to be a function of a module.

    Raises
    ------
    ConfigurationError
        If a plant is in both sets.
    OutputExistsError
        If the folder holds something else, or a run with other settings.
    Interrupted
        At Ctrl-C; the same call goes on.
    """
    _require_apart(learnt, unseen)
    settings = {
        "schema": SCHEMA,
        "quick": quick,
        "learnt": _told(learnt),
        "unseen": _told(unseen),
    }
    claim_run(folder, RUN_FILE, settings, what="networks of chapter 6")
    jobs = [
        (learnt, unseen, folder, seed, kinds, quick, progress)
        for seed in seeds
        for kinds in UNITS
        if not _done(folder, seed, kinds)
    ]
    if workers > 1 and len(jobs) > 1:
        import joblib

        with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
            joblib.Parallel(n_jobs=workers)(joblib.delayed(_train)(*job) for job in jobs)
    else:
        for job in jobs:
            _train(*job)
    outcomes = {name: tuple(_read(folder, seed, name) for seed in seeds) for name in CHAPTER_MODELS}
    return ChapterSix(learnt, unseen, outcomes, {**settings, "seeds": list(seeds)})


def _require_apart(learnt: Reaches, unseen: Reaches) -> None:
    if both := set(learnt.groups) & set(unseen.groups):
        raise ConfigurationError(
            f"{unseen.name}: plant {min(both)} is also in {learnt.name}, which is learnt from; measure on other plants"
        )


def _told(reaches: Reaches) -> dict[str, Any]:
    """What tells one set of reaches from another."""
    digest = hashlib.sha256()
    for values in (reaches.boxes, reaches.joint.mean, reaches.pose.mean):
        digest.update(np.ascontiguousarray(values).tobytes())
    return {
        "photographs": len(reaches),
        "targets": len(reaches.target_ids),
        "plants": len(set(reaches.groups)),
        "sum": digest.hexdigest()[:16],
    }


def _names(kinds: Sequence[str]) -> list[str]:
    return [name for name in CHAPTER_MODELS if name.removeprefix("l-").split("-")[0] in kinds]


def _place(folder: Path, seed: int) -> Path:
    return folder / f"seed-{seed}"


def _done(folder: Path, seed: int, kinds: Sequence[str]) -> bool:
    return all((_place(folder, seed) / f"{name}.json").is_file() for name in _names(kinds))


def _train(
    learnt: Reaches,
    unseen: Reaches,
    folder: Path,
    seed: int,
    kinds: Sequence[Kind],
    quick: bool,
    progress: Tell,
) -> None:
    """Networks of one encoder and one seed. The tuned one goes on where the untuned one ended."""
    place = _place(folder, seed)
    work = place / f"work-{'-'.join(kinds)}"
    for space in SPACES:
        for kind in kinds:
            for tuned in (False,) if kind == "direct" else (False, True):
                config = _config(kind, space, tuned=tuned, quick=quick)
                if (place / f"{config.name}.json").is_file():
                    continue
                begun = monotonic()
                fitted = fit_planner(
                    config,
                    learnt,
                    seed=seed,
                    folder=work / f"{kind}-{space}",
                    shared=work / "shared",
                    progress=progress,
                )
                assert isinstance(fitted, DeepPrediction)
                _write(place, fitted, learnt, unseen, monotonic() - begun)
    shutil.rmtree(work, ignore_errors=True)


def _write(place: Path, fitted: DeepPrediction, learnt: Reaches, unseen: Reaches, seconds: float) -> None:
    """Arrays first, then the small file that says they are whole."""
    movements = fitted.predict(unseen)
    place.mkdir(parents=True, exist_ok=True)
    export_planner(fitted, place / f"{fitted.name}.onnx")
    np.savez(
        place / f"{fitted.name}.npz",
        mean=movements.mean,
        blocks=movements.blocks,
        latents=fitted.latents(learnt).astype(np.float32),
        unseen_latents=fitted.latents(unseen).astype(np.float32),
    )
    told = {"space": fitted.space, "seconds": round(seconds, 1), "curves": fitted.curves}
    write_text(place / f"{fitted.name}.json", as_json(told), force=True)


def _read(folder: Path, seed: int, name: str) -> Outcome:
    place = _place(folder, seed)
    try:
        told = json.loads((place / f"{name}.json").read_text())
        with np.load(place / f"{name}.npz", allow_pickle=False) as arrays:
            return Outcome(
                name,
                told["space"],
                seed,
                block_diagonal(arrays["mean"], arrays["blocks"]),
                np.asarray(arrays["latents"], dtype=np.float64),
                np.asarray(arrays["unseen_latents"], dtype=np.float64),
                told["curves"],
                float(told["seconds"]),
                place / f"{name}.onnx",
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(
            f"{place / name}: damaged ({error}); delete its .json and .npz, and it is trained again"
        ) from error
