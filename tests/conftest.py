"""Fixtures that every room's tests share."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.data.demos import DemonstrationSet

os.environ.setdefault("MPLBACKEND", "agg")

# PyTorch and Mesa's software renderer both bring LLVM: loaded after a picture was rendered, PyTorch crashes (triton).
with contextlib.suppress(ImportError):
    import torch  # noqa: F401
    import torchvision  # noqa: F401


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of local data beside the checkout (``../shared/data``); the test is skipped, saying so, without it."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"LOCAL DATA ABSENT: {folder} is not there; this check against real data did not run")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20261122)


@pytest.fixture(scope="session")
def reach_demonstrations() -> DemonstrationSet:
    """Simulated reaches, three to each of 15 berries on 5 plants; pictures are plain but for where the berry would be."""
    from punnet.data.demos import Episode, Photograph, Trajectory, as_poses
    from punnet.data.demos.pictures import RawPicture
    from punnet.geometry import CameraIntrinsics, quaternion_from_rotation
    from punnet.robot import HOME, JOINT_NAMES, T_FLANGE_CAMERA, Panda
    from punnet.scene import Target
    from punnet.sim.demonstrations import simulate_demonstrations

    arm, camera = Panda(), CameraIntrinsics(320, 240, 210.0, 210.0, 160.0, 120.0)
    pose = arm.forward_kinematics(HOME) @ T_FLANGE_CAMERA
    made = simulate_demonstrations(np.random.default_rng(7), 15, 3, samples=60)
    episodes = []
    for row, (joints, point, berry, duration) in enumerate(
        zip(made.joints, made.targets, made.configuration, made.durations, strict=True)
    ):
        x, y, z, _ = np.linalg.inv(pose) @ np.append(point - [0.0, 0.0, 0.03], 1.0)
        u, v = 210.0 * x / z + 160.0, 210.0 * y / z + 120.0
        half = 210.0 * 0.015 / z
        rgb = np.full((240, 320, 3), 70, dtype=np.uint8)
        cv2.circle(rgb, (round(u), round(v)), round(half), (200, 20, 20), -1)
        flange = arm.forward_kinematics(joints)
        times = np.linspace(0.0, duration, len(joints))
        quaternions = quaternion_from_rotation(flange[:, :3, :3])
        episodes.append(
            Episode(
                id=str(row),
                joints=Trajectory(times, joints, names=JOINT_NAMES),
                poses=as_poses(times, np.column_stack((flange[:, :3, 3], quaternions))),
                photographs=(
                    Photograph(RawPicture(rgb, "made"), (240, 320), camera=camera, T_base_camera=pose),
                ),
                target=Target(np.array([u - half, v - half, u + half, v + half]), picking_point=point),
                target_id=f"berry {berry}",
                group=f"plant {berry // 3}",
            )
        )
    return DemonstrationSet(tuple(episodes), name="made")


@pytest.fixture(scope="session")
def reach_run(reach_demonstrations: DemonstrationSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a training run: ``full`` in task and in joint space on ``reach_demonstrations``, in one bundle."""
    from punnet.train.planner.full import FullConfig
    from punnet.train.planner.training import train_planners

    folder = tmp_path_factory.mktemp("planner") / "made"
    train_planners(
        [FullConfig("task"), FullConfig("joint")],
        reach_demonstrations,
        data=["made"],
        folder=folder,
        seed=0,
        progress=lambda line: None,
    )
    return folder
