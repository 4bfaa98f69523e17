"""A factory of labelled images: plants on many cores or machines, one shard a plant, joined at the end.

Every plant is drawn from (seed, its number) alone, so the same seed gives the same bytes however many workers
there are and however often the run was interrupted. A shard is written last, in one step, once its images
are on disk; a run that is started again in the same folder makes only the plants that have none.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

import punnet
from punnet.errors import ConfigurationError, FileFormatError, OutputError, OutputExistsError
from punnet.outputs import MARKER_FILE
from punnet.scene import CLASSES, KEYPOINTS
from punnet.sim.labelled_views import VIEWS, LabelledView, photograph
from punnet.sim.rendering import CameraRenderer
from punnet.sim.still_scene import PHOTO_INTRINSICS, build_still_scene

__all__ = ["BACKENDS", "FactoryReport", "simulate_dataset"]

BACKENDS = ("loky", "ray")
Backend = Literal["loky", "ray"]

SCHEMA = "punnet-simulated-data/1"
GENERATOR = 1
"""Raised whenever the same seed gives other bytes."""

_DESCRIPTION, _ANNOTATIONS, _SHARDS = "data.json", "annotations.json", ".plants"
_JPEG_QUALITY = 92
_RAY_BATCH = 16
_DEPTH_UNIT = 0.001
_LICENCES = [
    {"id": 1, "name": "CC0 1.0", "url": "https://creativecommons.org/publicdomain/zero/1.0/"},
    {
        "id": 2,
        "name": "CC BY 4.0 (leaf textures, see punnet/sim/assets/leaves/ATTRIBUTION.txt)",
        "url": "https://creativecommons.org/licenses/by/4.0/",
    },
]


@dataclass(frozen=True)
class FactoryReport:
    """What a run has made.

    Parameters
    ----------
    folder
        Where the data set is.
    images, plants, annotations, crowd
        How many there are in it; ``annotations`` includes ``crowd``.
    made, kept
        Images made by this run, and by earlier ones.
    megabytes
        On disk.
    """

    folder: Path
    images: int
    plants: int
    annotations: int
    crowd: int
    made: int
    kept: int
    megabytes: float


def simulate_dataset(
    folder: str | Path,
    *,
    images: int,
    seed: int,
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
        How many; three views a plant, fewer of the last if it is no multiple of three.
    seed
        Plants of different seeds are different, and so are their group names.
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
        If the folder is complete, was made with other settings, or was not made by Punnet.
    """
    if images < 1 or workers < 1 or seed < 0:
        raise ConfigurationError(
            f"simulate: images and workers must be ≥ 1 and seed ≥ 0, got {images}, {workers}, {seed}"
        )
    if backend not in BACKENDS:
        raise ConfigurationError(f"simulate: backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    if backend == "ray":
        _register_ray()
    place = Path(folder).expanduser().absolute()
    description = _describe(images, seed)
    _open_folder(place, description, force)
    plants = math.ceil(images / len(VIEWS))
    missing = [plant for plant in range(plants) if not _shard_path(place, plant).is_file()]
    kept = sum(_views_of(plant, images) for plant in range(plants)) - sum(
        _views_of(plant, images) for plant in missing
    )
    done = kept
    if progress is not None:
        progress(done)
    for made in _run(place, seed, [(plant, _views_of(plant, images)) for plant in missing], workers, backend):
        done += made
        if progress is not None:
            progress(done)
    return _finish(place, description, plants, made=images - kept)


def _views_of(plant: int, images: int) -> int:
    return min(len(VIEWS), images - plant * len(VIEWS))


def _describe(images: int, seed: int) -> dict[str, Any]:
    """Write down what decides the bytes of the data set."""
    return {
        "schema": SCHEMA,
        "command": f"punnet data simulate --images {images} --seed {seed}",
        "punnet": punnet.__version__,
        "generator": GENERATOR,
        "images": images,
        "seed": seed,
        "complete": False,
    }


def _open_folder(place: Path, description: dict[str, Any], force: bool) -> None:
    """Make the folder, or find that it holds the beginning of the same data set."""
    if place.exists() and not place.is_dir():
        raise OutputError(
            f"{place}: can't be made, a file stands where a folder is needed; give another folder"
        )
    found = _read_description(place)
    if found is None and place.is_dir() and any(place.iterdir()):
        raise OutputExistsError(f"{place}: exists and is no simulated data set; give another folder")
    if found is not None and force:
        shutil.rmtree(place)
        found = None
    if found is not None:
        if found.get("complete"):
            raise OutputExistsError(f"{place}: is complete; give another folder or --force to make it anew")
        other = [name for name in description if description[name] != found.get(name)]
        if other:
            was = ", ".join(f"{name} {found.get(name)!r}" for name in other)
            raise OutputExistsError(
                f"{place}: was begun with {was}; go on with the same, give another folder, or --force"
            )
        return
    try:
        for name in ("rgb", "depth", _SHARDS):
            (place / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{place}: can't be written ({error.strerror}); give another folder") from error
    _write(place / MARKER_FILE, _json({"made_by": "punnet", "complete": False}))
    _write(place / "camera.json", _json({"depth_scale": _DEPTH_UNIT, "camera": PHOTO_INTRINSICS.to_json()}))
    _write(place / _DESCRIPTION, _json(description))


def _read_description(place: Path) -> dict[str, Any] | None:
    path = place / _DESCRIPTION
    if not path.is_file():
        return None
    try:
        found = json.loads(path.read_text())
    except ValueError as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error}); remove the folder") from error
    if not isinstance(found, dict) or found.get("schema") != SCHEMA:
        raise FileFormatError(
            f"{path}: no description of a simulated data set ({SCHEMA}); give another folder"
        )
    return found


def _run(
    place: Path, seed: int, plants: list[tuple[int, int]], workers: int, backend: Backend
) -> Iterator[int]:
    """Make plants (number, views); yields how many images each has given, in the order in which they are done."""
    import joblib

    tasks = [joblib.delayed(_make_plant)(str(place), seed, plant, views) for plant, views in plants]
    if backend == "ray":
        with joblib.parallel_config(backend="ray", n_jobs=workers):
            # Ray gives results only when all of a call are there: batches, so that there is progress.
            for start in range(0, len(tasks), _RAY_BATCH * workers):
                yield from joblib.Parallel(n_jobs=workers)(tasks[start : start + _RAY_BATCH * workers])
        return
    # Workers share the cores: one thread each for NumPy; the renderer and OpenCV are told in the worker itself.
    with joblib.parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        yield from joblib.Parallel(n_jobs=workers, return_as="generator_unordered")(tasks)


def _register_ray() -> None:
    """Let joblib work on the Ray cluster that this machine is connected to, or on this machine as a cluster of one."""
    try:
        from ray.util.joblib import register_ray  # type: ignore[import-not-found]
    except ImportError as error:
        raise ConfigurationError("simulate: --backend ray needs Ray: pip install 'punnet[scale]'") from error
    register_ray()


_render_context: Any = None  # one OpenGL context a process: to make one costs more than to draw a picture


def _worker_context() -> Any:
    global _render_context
    if _render_context is None:
        os.environ.setdefault("LP_NUM_THREADS", "1")  # of Mesa's software renderer, read when it starts
        cv2.setNumThreads(1)
        from punnet.sim.gl_context import make_gl_context

        _render_context = make_gl_context(PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    return _render_context


def _make_plant(place: str, seed: int, plant: int, views: int) -> int:
    """Grow, photograph and label one plant; its shard is written last. Runs in a worker."""
    folder, group = Path(place), f"plant-{seed}-{plant}"
    context = _worker_context()
    rng = np.random.default_rng([seed, plant])
    scene = build_still_scene(rng)
    entries = []
    size = (PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    with CameraRenderer(scene.model, *size, shared_context=context) as renderer:
        for _, labelled in zip(range(views), photograph(scene, renderer, rng), strict=False):
            entries.append(
                _write_view(folder, f"{plant:06d}-{labelled.view}", group, scene.setting, labelled)
            )
    _write(_shard_path(folder, plant), _json(entries))
    return views


def _write_view(folder: Path, name: str, group: str, setting: str, labelled: LabelledView) -> dict[str, Any]:
    """Write colour and depth; the image's entry of the shard."""
    rgb, depth = f"rgb/{name}.jpg", f"depth/{name}.png"
    _write(folder / rgb, _encoded(".jpg", labelled.rgb[:, :, ::-1], cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))
    counts = np.rint(labelled.depth / np.float32(_DEPTH_UNIT)).astype(np.uint16)
    _write(folder / depth, _encoded(".png", counts, cv2.IMWRITE_PNG_COMPRESSION, 3))
    image = {
        "file_name": rgb,
        "width": PHOTO_INTRINSICS.width,
        "height": PHOTO_INTRINSICS.height,
        "depth_path": depth,
        "camera": PHOTO_INTRINSICS.to_json(),
        "T_base_camera": [[round(float(v), 7) for v in row] for row in labelled.T_base_camera],
        "group": group,
        "view": labelled.view,
        "setting": setting,
    }
    return {"image": image, "annotations": labelled.annotations}


def _finish(place: Path, description: dict[str, Any], plants: int, *, made: int) -> FactoryReport:
    """Join the shards into ``annotations.json``, in the order of the plants."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for plant in range(plants):
        for entry in json.loads(_shard_path(place, plant).read_text()):
            images.append({"id": len(images) + 1, **entry["image"]})
            for annotation in entry["annotations"]:
                ids = {"id": len(annotations) + 1, "image_id": len(images)}
                annotations.append(ids | annotation)
    skeleton = [[1, 2], [2, 3], [4, 5]]
    categories = [
        {"id": number, "name": name, "keypoints": list(KEYPOINTS), "skeleton": skeleton}
        for number, name in enumerate(CLASSES, start=1)
    ]
    description = description | {"complete": True}
    document = {
        "info": {"description": "Simulated strawberries, labelled exactly", **description},
        "licenses": _LICENCES,
        "images": images,
        "annotations": annotations,
        "categories": categories,
    }
    _write(place / _ANNOTATIONS, json.dumps(document, allow_nan=False, separators=(",", ":")).encode())
    _write(place / _DESCRIPTION, _json(description))
    _write(place / MARKER_FILE, _json({"made_by": "punnet", "complete": True}))
    shutil.rmtree(place / _SHARDS)
    for half in (*(place / "rgb").glob(".*"), *(place / "depth").glob(".*")):
        half.unlink()  # begun by a run that was killed
    size = sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
    return FactoryReport(
        folder=place,
        images=len(images),
        plants=plants,
        annotations=len(annotations),
        crowd=sum(annotation["iscrowd"] for annotation in annotations),
        made=made,
        kept=len(images) - made,
        megabytes=size / 1e6,
    )


def _shard_path(place: Path, plant: int) -> Path:
    return place / _SHARDS / f"{plant:06d}.json"


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _encoded(suffix: str, image: NDArray[Any], *options: int) -> bytes:
    done, encoded = cv2.imencode(suffix, image, list(options))
    if not done:
        raise OutputError(f"an image of {image.shape} could not be encoded as {suffix}")
    return bytes(encoded.tobytes())


def _write(path: Path, content: bytes) -> None:
    """Write a file in one step: there is never half of it."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_bytes(content)
    beside.replace(path)
