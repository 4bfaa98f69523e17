"""A factory of labelled images: plants on many cores or machines, one shard a plant, joined at the end.

Every plant is drawn from (seed, its number) alone, so the same seed gives the same bytes however many workers
there are and however often the run was interrupted. A shard is written last, in one step, once its images
are on disk; a run that is started again in the same folder makes only the plants that have none.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.errors import ConfigurationError
from punnet.sim.labelled_views import VIEWS, photograph
from punnet.sim.protocols import VARIED, protocol_of
from punnet.sim.rendering import CameraRenderer
from punnet.sim.simulated_folder import (
    FactoryReport,
    complete,
    describe,
    is_finished,
    open_set,
    write_shard,
    write_view,
)
from punnet.sim.still_scene import PHOTO_INTRINSICS, build_still_scene
from punnet.sim.workers import Backend, require_backend, run_jobs

__all__ = ["simulate_dataset"]


def simulate_dataset(
    folder: str | Path,
    *,
    images: int | None = None,
    seed: int,
    protocol: str = VARIED.name,
    workers: int = 1,
    backend: Backend = "loky",
    force: bool = False,
    progress: Callable[[int], None] | None = None,
) -> FactoryReport:
    """Make a data set of labelled RGB-D images, or go on with one that was interrupted.

    Parameters
    ----------
    folder
        Holds ``annotations.json`` (COCO), ``rgb/*.jpg``, ``depth/*.png`` (16 bit, millimetres), ``camera.json`` and
        ``data.json`` (what made it). Made if it does not exist.
    images
        How many; three views a plant, fewer of the last if it is no multiple of three. The protocol's number if None.
    seed
        Plants of different seeds are different, and so are their group names.
    protocol
        One of :data:`~punnet.sim.protocols.PROTOCOLS`.
    workers
        Processes (``loky``) or tasks at a time (``ray``).
    backend
        ``ray`` spreads plants over the cluster that Ray is connected to; the folder must be shared by its machines.
    force
        Make a complete data set anew.
    progress
        Told how many images are done, each time a plant is.

    Raises
    ------
    ConfigurationError
        If a number is out of range, or Ray is asked for and not installed.
    OutputExistsError
        If the folder is complete, was begun with other settings, or was not made by Punnet.
    """
    kind = protocol_of(protocol)
    images = kind.images if images is None else images
    if images < 1 or workers < 1 or seed < 0:
        raise ConfigurationError(
            f"simulate: images and workers must be ≥ 1 and seed ≥ 0, got {images}, {workers}, {seed}"
        )
    require_backend("simulate", backend)
    place = Path(folder).expanduser().absolute()
    description = describe(images, seed, kind)
    open_set(place, description, force=force)
    plants = math.ceil(images / len(VIEWS))
    missing = [plant for plant in range(plants) if not is_finished(place, plant)]
    kept = sum(_views_of(plant, images) for plant in range(plants)) - sum(
        _views_of(plant, images) for plant in missing
    )
    done = kept
    if progress is not None:
        progress(done)
    wanted = [(plant, _views_of(plant, images)) for plant in missing]
    for made in _run(place, seed, kind.name, wanted, workers, backend):
        done += made
        if progress is not None:
            progress(done)
    return complete(place, description, plants, made=images - kept)


def _views_of(plant: int, images: int) -> int:
    return min(len(VIEWS), images - plant * len(VIEWS))


def _run(
    place: Path, seed: int, protocol: str, plants: list[tuple[int, int]], workers: int, backend: Backend
) -> Iterator[int]:
    """Make plants (number, views); yields how many images each has given, in the order in which they are done."""
    jobs = [(str(place), seed, protocol, plant, views) for plant, views in plants]
    # The renderer and OpenCV are told in the worker itself that they have one core.
    return run_jobs(_make_plant, jobs, workers, backend)


_render_context: Any = None  # one OpenGL context a process: to make one costs more than to draw a picture


def _worker_context() -> Any:
    global _render_context
    if _render_context is None:
        os.environ.setdefault("LP_NUM_THREADS", "1")  # of Mesa's software renderer, read when it starts
        cv2.setNumThreads(1)
        from punnet.sim.gl_context import make_gl_context

        _render_context = make_gl_context(PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    return _render_context


def _make_plant(place: str, seed: int, protocol: str, plant: int, views: int) -> int:
    """Grow, photograph and label one plant; its shard is written last. Runs in a worker."""
    kind = protocol_of(protocol)
    folder, group = Path(place), f"{kind.group}-{seed}-{plant}"
    context = _worker_context()
    rng = np.random.default_rng([seed, plant, *kind.stream])
    scene = build_still_scene(rng, kind)
    entries = []
    size = (PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    with CameraRenderer(scene.model, *size, shared_context=context) as renderer:
        for _, labelled in zip(range(views), photograph(scene, renderer, rng), strict=False):
            entries.append(write_view(folder, f"{plant:06d}-{labelled.view}", group, scene.setting, labelled))
    write_shard(folder, plant, entries)
    return views
