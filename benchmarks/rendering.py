"""What a picture costs on one core: each OpenGL back end that is installed, one after the other, in one run.

    python benchmarks/rendering.py [--repeats 9] [--json]

Two scenes at 640×480: a synthetic one of 12 berries and 30 leaves (60,576 triangles, nothing else), and the wrist
camera's first view of the simulator's world. Times are processor time of the whole process, pinned to one core, so that
other work on the machine counts little: the shortest of the repeats, in milliseconds.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import CAMERA_NAME
from punnet.sim.rendering import CameraRenderer, gl_backend
from punnet.sim.world import build_world

SETTINGS = ((0, 1024), (4, 1024), (4, 2048), (4, 4096))
PICTURES = ("render_rgb", "render_depth", "render_segmentation", "render_rgbd", "render_all")


def _ball(rings: int = 34, segments: int = 32) -> tuple[np.ndarray, np.ndarray]:
    theta = np.linspace(0, np.pi, rings)[1:-1, None]
    phi = np.linspace(0, 2 * np.pi, segments, endpoint=False)[None]
    belt = np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi), -1)
    vertices = np.concatenate(([[0, 0, 1]], belt.reshape(-1, 3), [[0, 0, -1]]))
    ring, column = np.meshgrid(np.arange(rings - 3), np.arange(segments), indexing="ij")
    a, b = 1 + ring * segments + column, 1 + ring * segments + (column + 1) % segments
    sides = [np.stack((a, a + segments, b), -1), np.stack((b, a + segments, b + segments), -1)]
    first, last = np.arange(segments), len(vertices) - 1 - segments + np.arange(segments)
    caps = [
        np.stack((0 * first, 1 + first, 1 + (first + 1) % segments), -1),
        np.stack((0 * first + len(vertices) - 1, np.roll(last, -1), last), -1),
    ]
    return vertices, np.concatenate([part.reshape(-1, 3) for part in (*sides, *caps)])


def synthetic_scene() -> mujoco.MjModel:
    spec, rng = mujoco.MjSpec(), np.random.default_rng(0)
    vertices, faces = _ball()
    for number in range(42):
        berry = number < 12
        size = (0.015, 0.015, 0.02) if berry else (0.03, 0.03, 0.002)
        count = len(faces) if berry else 1200
        spec.add_mesh(
            name=f"mesh{number}",
            uservert=(vertices * size).ravel(),
            userface=faces[:count].ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"mesh{number}",
            pos=rng.uniform((-0.15, -0.1, -0.55), (0.15, 0.1, -0.3)),
            quat=rng.normal(size=4),
            rgba=(0.8, 0.1, 0.1, 1) if berry else (0.1, 0.6, 0.1, 1),
        )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, pos=(0, 0, -1), size=(1, 1, 0.1))
    spec.worldbody.add_light(
        pos=(0.2, 0.3, 1), dir=(-0.2, -0.3, -1), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=True
    )
    spec.worldbody.add_camera(name=CAMERA_NAME, fovy=np.degrees(2 * np.arctan(240 / 615)))
    return spec.compile()


def shortest(action: Callable[[], Any], repeats: int) -> float:
    action()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return 1000.0 * min(times)


def measure_scene(
    name: str, model: mujoco.MjModel, data: mujoco.MjData, repeats: int
) -> list[dict[str, Any]]:
    quality = model.vis.quality
    rows = []
    own = (int(quality.offsamples), int(quality.shadowsize))
    for samples, shadow in dict.fromkeys((*SETTINGS, own)):
        start = time.process_time()
        with CameraRenderer(
            model, hidden_groups=(ARM_VISUAL,), samples=samples, shadow_size=shadow
        ) as renderer:
            row: dict[str, Any] = {"scene": name, "samples": samples, "shadow_map": shadow}
            row["make"] = 1000.0 * (time.process_time() - start)
            for picture in PICTURES:
                draw = getattr(renderer, picture)
                row[picture] = shortest(lambda draw=draw: draw(data, CAMERA_NAME), repeats)
        rows.append(row)
    return rows


def measure(repeats: int) -> dict[str, Any]:
    """Run in a process of its own for each back end."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    model = synthetic_scene()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows = measure_scene("synthetic", model, data, repeats)
    world = build_world(0)
    rows += measure_scene("world", world.model, world.data, repeats)
    with CameraRenderer(world.model, hidden_groups=(ARM_VISUAL,)) as renderer:
        rgb, depth = renderer.render_rgbd(world.data, CAMERA_NAME)
    rng = np.random.default_rng(0)
    sensor = shortest(lambda: StereoDepthModel().apply(depth, rgb, rng), 3 * repeats)
    return {"backend": gl_backend(), "rows": rows, "depth_sensor": sensor}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(measure(arguments.repeats)))
        return
    results = []
    for backend in ("egl", "osmesa"):
        child = subprocess.run(
            [sys.executable, __file__, "--child", "--repeats", str(arguments.repeats)],
            env={**os.environ, "MUJOCO_GL": backend},
            capture_output=True,
            text=True,
            check=False,
        )
        if child.returncode:
            print(f"{backend}: {child.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            continue
        results.append(json.loads(child.stdout))
    if arguments.json:
        print(json.dumps(results, indent=2))
        return
    columns = ("make", *PICTURES)
    print(
        f"{'back end':9}{'scene':11}{'samples':>8}{'shadow':>7}" + "".join(f"{c[-12:]:>14}" for c in columns)
    )
    for result in results:
        for row in result["rows"]:
            head = f"{result['backend']:9}{row['scene']:11}{row['samples']:8}{row['shadow_map']:7}"
            print(head + "".join(f"{row[c]:14.0f}" for c in columns))
        print(f"{result['backend']:9}depth sensor {result['depth_sensor']:.1f} ms")


if __name__ == "__main__":
    main()
