"""The folder of simulated demonstrations: how it is begun, gone on with, filled plant by plant, and completed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.demos import DemonstrationSet, Episode, Photograph, PictureFile, Trajectory, as_poses
from punnet.data.demos.punnet_folder import DESCRIPTION, SCHEMA, TRAJECTORIES
from punnet.data.demos.punnet_writer import describe_episodes, trajectory_archive
from punnet.errors import FileFormatError, OutputError, OutputExistsError
from punnet.outputs import MARKER_FILE
from punnet.robot import JOINT_NAMES
from punnet.scene import Frame, Target
from punnet.sim.growing_folder import DEPTH_UNIT, json_bytes, write_pictures, write_whole

__all__ = ["FolderOfReaches"]

_SHARDS = ".plants"
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
        OutputError
            If it can't be made.
        """
        place = self.folder
        if place.exists() and not place.is_dir():
            raise OutputError(f"{place}: a file stands where a folder is needed; give another folder")
        found = self._found()
        if found is None and place.is_dir() and any(place.iterdir()):
            raise OutputExistsError(f"{place}: exists and holds no demonstrations; give another folder")
        if found is not None and force:
            shutil.rmtree(place)
            found = None
        if found is not None:
            self._require_same(found)
            return
        try:
            for name in ("rgb", "depth", _SHARDS):
                (place / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{place}: can't be written ({error.strerror}); give another folder") from error
        write_whole(place / MARKER_FILE, json_bytes({"made_by": "punnet", "complete": False}))
        begun = {"schema": SCHEMA, "complete": False, "info": self.settings, "episodes": []}
        write_whole(place / DESCRIPTION, json_bytes(begun))

    def _found(self) -> dict[str, Any] | None:
        path = self.folder / DESCRIPTION
        if not path.is_file():
            return None
        try:
            found = json.loads(path.read_text())
        except ValueError as error:
            raise FileFormatError(f"{path}: not readable as JSON ({error}); remove the folder") from error
        if not isinstance(found, dict) or found.get("schema") != SCHEMA:
            raise FileFormatError(f"{path}: no description of demonstrations ({SCHEMA}); give another folder")
        return found

    def _require_same(self, found: dict[str, Any]) -> None:
        if found.get("complete"):
            raise OutputExistsError(
                f"{self.folder}: is complete; give another folder or --force to make it anew"
            )
        info = found.get("info")
        info = info if isinstance(info, dict) else {}
        other = [name for name, value in self.settings.items() if info.get(name) != value]
        other = [name for name in other if name != "command"] or other  # it says the same in one line
        if other:
            was = ", ".join(f"{name} {info.get(name)!r}" for name in other)
            raise OutputExistsError(
                f"{self.folder}: was begun with {was}; go on with the same, give another folder, or --force"
            )

    def has(self, plant: int) -> bool:
        """Whether a plant's episodes are all there."""
        return self._shard(plant).is_file()

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
        write_whole(self._shard(plant), json.dumps(episodes, allow_nan=False).encode())

    def complete(self, plants: int) -> None:
        """Join the shards, in the order of the plants."""
        episodes, photographs = [], []
        for plant in range(plants):
            for entry in json.loads(self._shard(plant).read_text()):
                episodes.append(self._episode(entry))
                photographs.append([entry["photograph"]])
        demonstrations = DemonstrationSet(
            tuple(episodes), self.folder.name, self.settings | {"poses_of": _POSES_OF}
        )
        write_whole(self.folder / TRAJECTORIES, trajectory_archive(demonstrations))
        write_whole(self.folder / DESCRIPTION, json_bytes(describe_episodes(demonstrations, photographs)))
        write_whole(self.folder / MARKER_FILE, json_bytes({"made_by": "punnet", "complete": True}))
        shutil.rmtree(self.folder / _SHARDS)
        for half in (*(self.folder / "rgb").glob(".*"), *(self.folder / "depth").glob(".*")):
            half.unlink()  # begun by a run that was killed

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

    def _shard(self, plant: int) -> Path:
        return self.folder / _SHARDS / f"{plant:06d}.json"
