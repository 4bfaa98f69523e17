"""The figure of docs/simulator-looks.md: two wrist views, and berries of each ripeness stage close up.

python benchmarks/simulator_looks.py --out docs/figures/simulator-looks.jpg [--seed 18]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.sim import CameraRenderer, SimulatedRobot, StereoDepthModel, World, build_world
from punnet.sim.ripeness import RipenessStage

STAGES = list(RipenessStage)[: RipenessStage.ROTTEN]  # the harvest's plants have none that rot
TILE, COLUMNS = 192, 4


def close_up(world: World, renderer: CameraRenderer, index: int) -> NDArray[np.uint8]:
    """A square picture (TILE, TILE, 3) of one berry, from the robot's side."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = world.cluster.berries[index].centre
    camera.distance, camera.azimuth, camera.elevation = 0.10, 0.0, -5.0
    image = renderer.render_rgb(world.data, camera)
    margin = (image.shape[1] - image.shape[0]) // 2
    square = image[:, margin : margin + image.shape[0]]
    return np.asarray(cv2.resize(square, (TILE, TILE), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=18, help="of the first plant")
    arguments = parser.parse_args()
    views: list[NDArray[np.uint8]] = []
    tiles: dict[RipenessStage, list[NDArray[np.uint8]]] = {stage: [] for stage in STAGES}
    seed = arguments.seed
    while min(len(found) for found in tiles.values()) < COLUMNS:
        world = build_world(seed)
        if len(views) < 2:
            robot = SimulatedRobot(world, np.random.default_rng(seed), StereoDepthModel())
            views.append(robot.look().rgb)
            robot.close()
        with CameraRenderer(world.model, 640, 480) as renderer:
            for berry in world.cluster.berries:
                found = tiles[berry.berry.stage]
                if len(found) < COLUMNS:
                    found.append(close_up(world, renderer, berry.index))
        seed += 1
    grid = np.vstack([np.hstack(tiles[stage]) for stage in STAGES])
    picture = np.hstack([np.vstack(views), grid])
    cv2.imwrite(str(arguments.out), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 86])


if __name__ == "__main__":
    main()
