"""A factory of demonstrations: plants on many cores, each photographed from home and reached for again and again.

Every plant is drawn from (seed, its number) alone, so the same seed gives the same bytes however many workers there are
and however often the run was interrupted. A plant's shard is written last, in one step; a run that is started again in
the same folder makes only the plants that have none.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.errors import ConfigurationError
from punnet.geometry import quaternion_from_rotation
from punnet.outputs import Interrupted
from punnet.robot import Panda
from punnet.sim.demonstrations import (
    EXPLORING,
    REACH_LIKE,
    THESIS_LIKE,
    Demonstrations,
    ReachStyle,
    reach_to,
)
from punnet.sim.demonstrations_folder import FolderOfReaches
from punnet.sim.demonstrations_scene import (
    SCENES,
    TARGETS_A_PLANT,
    DemonstrationScene,
    SceneKind,
    grow_scene,
    photograph_scene,
)
from punnet.sim.simulated_robot import WRIST_CAMERA

__all__ = ["SPREADS", "DemonstrationReport", "regrow_scene", "simulate_demonstration_set"]

SPREADS: dict[str, ReachStyle] = {"reach": REACH_LIKE, "thesis": THESIS_LIKE, "exploring": EXPLORING}
"""How much reaches to the same berry differ, by name."""

GENERATOR = 1
"""Raised whenever the same seed gives other bytes."""
PLANTS_TRIED = 10


@dataclass(frozen=True)
class DemonstrationReport:
    """What a run has made.

    Parameters
    ----------
    folder
        Where the demonstrations are.
    episodes, targets, plants
        How many there are in it.
    made, kept
        Episodes made by this run, and by earlier ones.
    megabytes
        On disk.
    """

    folder: Path
    episodes: int
    targets: int
    plants: int
    made: int
    kept: int
    megabytes: float


def simulate_demonstration_set(
    folder: str | Path,
    *,
    configurations: int = 25,
    repeats: int = 10,
    seed: int = 0,
    scene: SceneKind = "single",
    spread: str = "reach",
    samples: int = 150,
    workers: int = 1,
    force: bool = False,
    progress: Callable[[int], None] | None = None,
) -> DemonstrationReport:
    """Demonstrate reaches in the simulator by the thesis' protocol, or go on with a run that was interrupted.

    Parameters
    ----------
    folder
        As :mod:`punnet.data.demos.punnet_folder` has it; made if it does not exist.
    configurations
        Target berries: one a plant for the scene ``single``, up to five a plant for ``multi``.
    repeats
        Reaches to each, with a photograph before each.
    seed
        Plants of different seeds are different, and so are their group names.
    scene
        A kind of :data:`~punnet.sim.demonstrations_scene.SCENES`.
    spread
        How much reaches to the same berry differ, a name in :data:`SPREADS`.
    samples
        Instants of each reach.
    workers
        Processes that work at a time.
    force
        Make a complete set anew.
    progress
        Told how many episodes are done, each time a plant is.

    Raises
    ------
    ConfigurationError
        If a number is out of range.
    OutputExistsError
        If the folder is complete, was begun with other settings, or was not made by Punnet.
    Interrupted
        By Ctrl-C; finished plants are kept, and gone on from when it is started again.
    """
    if (
        min(configurations, repeats, workers) < 1
        or samples < 2
        or seed < 0
        or scene not in SCENES
        or spread not in SPREADS
    ):
        raise ConfigurationError(
            f"demonstrations: configurations, repeats and workers must be ≥ 1, samples ≥ 2, seed ≥ 0, scene one of "
            f"{', '.join(SCENES)} and spread one of {', '.join(SPREADS)}; got {configurations}, {repeats}, {workers}, "
            f"{samples}, {seed}, {scene!r}, {spread!r}"
        )
    settings: dict[str, Any] = {
        "command": f"punnet demos simulate --configs {configurations} --repeats {repeats} --seed {seed} "
        f"--scene {scene} --spread {spread}",
        "generator": GENERATOR,
        "configurations": configurations,
        "repeats": repeats,
        "seed": seed,
        "scene": scene,
        "spread": spread,
        "samples": samples,
    }
    place = FolderOfReaches(Path(folder).expanduser().absolute(), settings)
    place.open(force=force)
    plants = math.ceil(configurations / TARGETS_A_PLANT[scene])
    counts = [min(TARGETS_A_PLANT[scene], configurations - k * TARGETS_A_PLANT[scene]) for k in range(plants)]
    missing = [plant for plant in range(plants) if not place.has(plant)]
    kept = done = (configurations - sum(counts[plant] for plant in missing)) * repeats
    if progress is not None:
        progress(done)
    try:
        for made in _run(place, [(plant, counts[plant]) for plant in missing], workers):
            done += made
            if progress is not None:
                progress(done)
    except KeyboardInterrupt as error:
        raise Interrupted(place.folder if any(map(place.has, range(plants))) else None) from error
    place.complete(plants)
    episodes = configurations * repeats
    return DemonstrationReport(
        place.folder, episodes, configurations, plants, episodes - kept, kept, place.megabytes()
    )


def _run(place: FolderOfReaches, plants: list[tuple[int, int]], workers: int) -> Iterator[int]:
    """Make plants (number, targets); yields how many episodes each has given, in the order in which they are done."""
    import joblib

    tasks = [joblib.delayed(_make_plant)(str(place.folder), place.settings, *plant) for plant in plants]
    if workers == 1:
        for function, arguments, _ in tasks:
            yield function(*arguments)
        return
    with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        yield from joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(tasks)


_render_context: Any = None  # one OpenGL context a process: to make one costs more than to draw a picture


def _worker_context() -> Any:
    global _render_context
    if _render_context is None:
        os.environ.setdefault("LP_NUM_THREADS", "1")  # of Mesa's software renderer, read when it starts
        from punnet.sim.gl_context import make_gl_context

        _render_context = make_gl_context(WRIST_CAMERA.width, WRIST_CAMERA.height)
    return _render_context


def _make_plant(folder: str, settings: dict[str, Any], plant: int, targets: int) -> int:
    """Grow a plant, photograph it and reach for its targets; its shard is written last. Runs in a worker."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        place = FolderOfReaches(Path(folder), settings)
        rng = np.random.default_rng([settings["seed"], plant])
        scene, reaches = _reachable(rng, settings, targets)
        entries = _episodes(place, rng, scene, reaches, plant)
        place.write_shard(plant, entries)
        return len(entries)
    finally:
        cv2.setNumThreads(threads)


def regrow_scene(info: Mapping[str, Any], plant: int) -> DemonstrationScene:
    """The scene of plant number ``plant`` of a set, to build its world again.

    Parameters
    ----------
    info
        Of the set, as :attr:`punnet.data.demos.DemonstrationSet.info` keeps it.
    plant
        0 for the first.

    Raises
    ------
    ConfigurationError
        If the set was not made by this version's :func:`simulate_demonstration_set`, or has no such plant.
    """
    try:
        settings = {
            name: info[name]
            for name in ("generator", "configurations", "repeats", "seed", "scene", "spread", "samples")
        }
    except KeyError as error:
        raise ConfigurationError(
            f"demonstrations: no simulated set, {error} is missing; its plants can't be grown again"
        ) from error
    most = TARGETS_A_PLANT[settings["scene"]]
    targets = min(most, settings["configurations"] - plant * most)
    if settings["generator"] != GENERATOR or plant < 0 or targets < 1:
        raise ConfigurationError(
            f"demonstrations: plant {plant} of a set of generator {settings['generator']} can't be grown again, this is "
            f"generator {GENERATOR}; simulate the set anew"
        )
    return _reachable(np.random.default_rng([settings["seed"], plant]), settings, targets)[0]


def _reachable(
    rng: np.random.Generator, settings: dict[str, Any], targets: int
) -> tuple[DemonstrationScene, Demonstrations]:
    """A plant and reaches to its targets; another plant where one of them can't be reached without strain."""
    style = SPREADS[settings["spread"]]
    tried = 0
    while True:
        tried += 1
        scene = grow_scene(rng, settings["scene"], targets, gl_context=_worker_context())
        try:
            return scene, reach_to(
                rng, scene.grip_points, settings["repeats"], settings["samples"], style=style
            )
        except ConfigurationError:
            if tried == PLANTS_TRIED:
                raise


def _episodes(
    place: FolderOfReaches,
    rng: np.random.Generator,
    scene: DemonstrationScene,
    reaches: Demonstrations,
    plant: int,
) -> list[dict[str, Any]]:
    """Photograph each target as often as it was reached for; the episodes' entries of the shard."""
    settings, arm = place.settings, Panda()
    group = f"plant-{settings['seed']}-{plant}"
    entries = []
    for number in range(len(reaches)):
        target = int(reaches.configuration[number])
        name = f"{plant:03d}-{target}-{number % settings['repeats']:02d}"
        flange = arm.forward_kinematics(reaches.joints[number])
        poses = np.concatenate((flange[:, :3, 3], quaternion_from_rotation(flange[:, :3, :3])), axis=1)
        entries.append(
            {
                "id": name,
                "target_id": f"{group}-berry-{int(scene.berries.ids[scene.targets[target]])}",
                "group": group,
                "box": scene.boxes[target].tolist(),
                "picking_point": scene.grip_points[target].tolist(),
                "duration": float(reaches.durations[number]),
                "joints": reaches.joints[number].tolist(),
                "poses": poses.tolist(),
                "photograph": place.write_photograph(name, photograph_scene(scene, rng)),
                "world_seed": scene.world_seed,
            }
        )
    return entries
