"""A small set of demonstrations: an arm of three joints reaches for berries on a wall, photographed from home."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from punnet.data.demos import (
    DemonstrationSet,
    Episode,
    Photograph,
    PictureFile,
    Trajectory,
    as_poses,
)
from punnet.geometry import CameraIntrinsics
from punnet.scene import Target

SIZE = (48, 64)
CAMERA = CameraIntrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
NAMES = ("shoulder", "elbow", "wrist")


def smooth(start: NDArray[np.float64], end: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """From rest to rest, (samples, D)."""
    phase = np.linspace(0.0, 1.0, samples)[:, None]
    return start + (end - start) * (3 * phase**2 - 2 * phase**3)


def reach(name: str, end: NDArray[np.float64], *, samples: int = 61, seconds: float = 2.0) -> Episode:
    """A movement of 3 joints and of the tool to ``end`` (3,)."""
    times = np.linspace(0.0, seconds, samples)
    joints = smooth(np.zeros(3), np.array([end[1], end[2] - 0.7, 0.4]), samples)
    turn = smooth(np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.1, 0.2, 0.0, 0.97]), samples)
    poses = np.concatenate((smooth(np.array([0.3, 0.0, 0.7]), end, samples), turn), axis=1)
    return Episode(id=name, joints=Trajectory(times, joints, NAMES), poses=as_poses(times, poses))


def berries_on_a_wall(
    folder: Path, rng: np.random.Generator, scenes: int = 3, targets: int = 6
) -> DemonstrationSet:
    """Two reaches to each target; the box tells where in the wall it hangs, up to a few millimetres."""
    episodes = []
    for scene in range(scenes):
        path = folder / f"scene{scene}.png"
        picture = rng.integers(0, 255, (*SIZE, 3), dtype=np.uint8)
        cv2.imwrite(str(path), picture)
        depth = folder / f"depth{scene}.png"
        cv2.imwrite(str(depth), rng.integers(300, 900, SIZE, dtype=np.uint16))
        photograph = Photograph(
            PictureFile(path), SIZE, depth_path=depth, camera=CAMERA, T_base_camera=np.eye(4)
        )
        for target in range(targets):
            u, v = rng.uniform(8, 56), rng.uniform(8, 40)
            box = np.array([u - 4, v - 5, u + 4, v + 5])
            for repeat in range(2):
                at = np.array([0.55 + rng.normal(0, 0.02), (32 - u) * 0.006, 0.7 + (24 - v) * 0.006])
                one = reach(f"{scene}-{target}-{repeat}", at + rng.normal(0.0, 0.003, 3))
                episodes.append(
                    Episode(
                        id=one.id,
                        joints=one.joints,
                        poses=one.poses,
                        photographs=(photograph,),
                        target=Target(box=box, picking_point=at),
                        target_id=f"{scene}-{target}",
                        group=f"plant-{scene}",
                        extra={"who": "test"},
                    )
                )
    return DemonstrationSet(tuple(episodes), "wall", {"made_for": "tests"})


@pytest.fixture
def wall(tmp_path: Path, rng: np.random.Generator) -> DemonstrationSet:
    """36 reaches to 18 berries of 3 plants."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    return berries_on_a_wall(folder, rng)


@pytest.fixture
def small_wall(tmp_path: Path, rng: np.random.Generator) -> DemonstrationSet:
    """4 reaches to 2 berries of one plant."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    return berries_on_a_wall(folder, rng, scenes=1, targets=2)


@pytest.fixture(scope="session")
def make_reach() -> Callable[..., Episode]:
    """Build one reach."""
    return reach
