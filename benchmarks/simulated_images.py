"""What a simulated image costs: images a second and megabytes, for one and more workers, and where the time goes.

    python benchmarks/simulated_images.py --images 300 --seed 0 --workers 1 2 [--json]

The rate counts everything from the first worker's start to the finished ``annotations.json``; it needs a quiet machine.
The parts are processor time (OpenGL's thread included) in one process after a plant to warm up; ``--workers`` with
no number measures only them, which a busy machine spoils less.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("LP_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import numpy as np

from punnet.sim.camera_effects import apply_effects, draw_effects
from punnet.sim.dataset_factory import simulate_dataset
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.gl_context import make_gl_context
from punnet.sim.labelled_views import VIEWS, LabelledView, draw_pose, label_berries
from punnet.sim.rendering import CameraRenderer
from punnet.sim.simulated_folder import describe, open_folder, write_view
from punnet.sim.still_scene import PHOTO_CAMERA, PHOTO_INTRINSICS, build_still_scene

BAR = 6.0


def rate(images: int, seed: int, workers: int) -> dict[str, float]:
    """Images a second, end to end."""
    with tempfile.TemporaryDirectory() as place:
        start = time.perf_counter()
        report = simulate_dataset(Path(place) / "set", images=images, seed=seed, workers=workers)
        seconds = time.perf_counter() - start
    return {
        "workers": workers,
        "images_per_second": report.images / seconds,
        "megabytes_per_image": report.megabytes / report.images,
        "berries_per_image": report.annotations / report.images,
    }


def parts(plants: int, seed: int, folder: Path) -> dict[str, float]:
    """Mean processor milliseconds an image of each part, in one process."""
    cv2.setNumThreads(1)
    size = (PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    context = make_gl_context(*size)
    spent: dict[str, float] = {}

    @contextmanager
    def timed(name: str) -> Iterator[None]:
        start = time.process_time()
        yield
        spent[name] = spent.get(name, 0.0) + time.process_time() - start

    for plant in range(plants + 1):
        if plant == 1:
            spent.clear()
        rng = np.random.default_rng([seed, plant])
        with timed("plant and surroundings"):
            scene = build_still_scene(rng)
        with timed("upload to OpenGL"):
            renderer = CameraRenderer(scene.model, *size, shared_context=context)
        for view in VIEWS:
            T = draw_pose(scene, rng, view, 0)
            scene.place_camera(T)
            with timed("depth and geometry ids"):
                depth, segmentation = renderer.render_geometry(scene.data, PHOTO_CAMERA)
            with timed("colour with shadows"):
                rgb = renderer.render_rgb(scene.data, PHOTO_CAMERA)
            with timed("camera effects"):
                rgb = apply_effects(rgb, draw_effects(rng), rng)
            with timed("depth camera"):
                measured = StereoDepthModel().apply(depth, rgb, rng)
            with timed("labels"):
                labels = label_berries(scene, T, segmentation)
            with timed("JPEG and PNG"):
                write_view(folder, view, "plant", scene.setting, LabelledView(view, rgb, measured, T, labels))
        renderer.close()
    return {name: 1000 * seconds / (plants * len(VIEWS)) for name, seconds in spent.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--images", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--plants", type=int, default=10, help="plants for the parts")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rates = [rate(options.images, options.seed, workers) for workers in options.workers]
    with tempfile.TemporaryDirectory() as place:
        open_folder(Path(place), describe(3, options.seed), force=False)
        costs = parts(options.plants, options.seed, Path(place))
    costs["all"] = sum(costs.values())
    if options.json:
        print(json.dumps({"rates": rates, "milliseconds": costs}, indent=2))
        return
    if rates:
        print("| workers | images/s | MB an image | berries an image |\n|---|---|---|---|")
    for row in rates:
        print(
            f"| {row['workers']} | {row['images_per_second']:.1f} | {row['megabytes_per_image']:.3f} | "
            f"{row['berries_per_image']:.1f} |"
        )
    print(f"\nbar: two workers ≥ {BAR:.0f} images/s\n\n| part | processor ms an image |\n|---|---|")
    for name, value in costs.items():
        print(f"| {name} | {value:.0f} |")


if __name__ == "__main__":
    main()
