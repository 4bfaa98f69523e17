"""The folder of simulated demonstrations: how it is begun, gone on with, filled plant by plant, and completed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.demos import DemonstrationSet, Episode, Photograph, PictureFile, Trajectory, as_poses
from punnet.data.demos.punnet_folder import DESCRIPTION, SCHEMA, TRAJECTORIES
from punnet.data.demos.punnet_writer import describe_episodes, trajectory_archive
from punnet.outputs import write_bytes
from punnet.robot import JOINT_NAMES
from punnet.scene import Frame, Target
from punnet.sim.growing_folder import (
    DEPTH_UNIT,
    PICTURES_AND_SHARDS,
    finish_folder,
    json_bytes,
    open_folder,
    shard_path,
    write_pictures,
)

__all__ = ["FolderOfReaches"]

_POSES_OF = "flange"


class FolderOfReaches:
    """A folder that grows by one plant at a time.

    Parameters
    ----------
    folder
        The place.
    settings
        What decides its bytes.
    """

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        self.folder = folder
        self.settings = settings

    def open(self, *, force: bool) -> None:
        """Make the folder, or find that it holds the beginning of the same demonstrations.

        Raises
        ------
        OutputExistsError
            If it is complete and ``force`` not set, was begun with other settings, or is something else.
        FileFormatError
            If it is damaged.
        OutputError
            If it can't be made.
        """
        begun = {"schema": SCHEMA, "complete": False, "info": self.settings, "episodes": []}
        open_folder(
            self.folder,
            DESCRIPTION,
            begun,
            what="set of demonstrations",
            parts=PICTURES_AND_SHARDS,
            force=force,
            under="info",
        )

    def has(self, plant: int) -> bool:
        """Whether a plant's episodes are all there."""
        return shard_path(self.folder, plant).is_file()

    def write_photograph(self, name: str, frame: Frame) -> dict[str, Any]:
        """Write colour and depth; the photograph's entry of the shard."""
        assert frame.depth is not None
        assert frame.camera is not None
        assert frame.T_base_camera is not None
        rgb, depth = write_pictures(self.folder, name, frame.rgb, frame.depth)
        return {
            "rgb": rgb,
            "size": [frame.height, frame.width],
            "depth": depth,
            "depth_scale": DEPTH_UNIT,
            "camera": frame.camera.to_json(),
            "T_base_camera": frame.T_base_camera.tolist(),
        }

    def write_shard(self, plant: int, episodes: list[dict[str, Any]]) -> None:
        """Write a plant's episodes: from then on it counts as finished."""
        write_bytes(
            shard_path(self.folder, plant), json.dumps(episodes, allow_nan=False).encode(), force=True
        )

    def complete(self, plants: int) -> None:
        """Join the shards, in the order of the plants."""
        episodes, photographs = [], []
        for plant in range(plants):
            for entry in json.loads(shard_path(self.folder, plant).read_text()):
                episodes.append(self._episode(entry))
                photographs.append([entry["photograph"]])
        demonstrations = DemonstrationSet(
            tuple(episodes), self.folder.name, self.settings | {"poses_of": _POSES_OF}
        )
        described = describe_episodes(demonstrations, photographs)
        write_bytes(self.folder / TRAJECTORIES, trajectory_archive(demonstrations), force=True)
        write_bytes(self.folder / DESCRIPTION, json_bytes(described), force=True)
        finish_folder(self.folder)

    def _episode(self, entry: dict[str, Any]) -> Episode:
        joints, photograph = np.array(entry["joints"]), entry["photograph"]
        times = np.linspace(0.0, entry["duration"], len(joints))
        return Episode(
            id=entry["id"],
            joints=Trajectory(times, joints, JOINT_NAMES),
            poses=as_poses(times, entry["poses"]),
            photographs=(
                Photograph(
                    PictureFile(self.folder / photograph["rgb"]),
                    (photograph["size"][0], photograph["size"][1]),
                ),
            ),
            target=Target(box=np.array(entry["box"]), picking_point=np.array(entry["picking_point"])),
            target_id=entry["target_id"],
            group=entry["group"],
            extra={"world_seed": entry["world_seed"], "separation_fingers": "open"},
        )

    def megabytes(self) -> float:
        """On disk."""
        return sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file()) / 1e6
