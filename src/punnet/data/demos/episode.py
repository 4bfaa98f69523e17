"""Demonstrations: episodes of what the camera saw, how the arm moved and what it reached for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.pictures import PictureSource
from punnet.data.demos.trajectory import Trajectory, WeightDistribution
from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, Target

__all__ = ["DemonstrationSet", "Episode", "Photograph"]


@dataclass(frozen=True, eq=False)
class Photograph:
    """One picture of an episode; files are opened when they are asked for.

    Parameters
    ----------
    picture
        Where the colours are.
    size
        (H, W), None if it is not known before the picture is read.
    time
        When it was taken, on the clock of the episode's trajectories.
    depth_path
        16-bit PNG aligned to the colours, ``depth_scale`` metres a count.
    camera
        Intrinsics, None unknown.
    T_base_camera
        (4, 4) pose of the optical frame, None unknown.

    Raises
    ------
    ShapeError
        If the size or the depth's scale is impossible.
    """

    picture: PictureSource
    size: tuple[int, int] | None = None
    time: float = 0.0
    depth_path: Path | None = None
    depth_scale: float = 0.001
    camera: CameraIntrinsics | None = None
    T_base_camera: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.size is not None and (len(self.size) != 2 or min(self.size) < 1):
            raise ShapeError(f"photograph: size must be (H, W), got {self.size}")
        if not 0 < self.depth_scale < 1:
            raise ShapeError(
                f"photograph: depth_scale must be metres a count, in (0, 1), got {self.depth_scale}"
            )

    def rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3).

        Raises
        ------
        FileFormatError
            If the file is missing or damaged.
        ShapeError
            If the picture is of another size than stated.
        """
        rgb = self.picture.read()
        if self.size is not None and rgb.shape[:2] != self.size:
            raise ShapeError(f"{self.picture}: is {rgb.shape[:2]} (H, W), stated is {self.size}")
        return rgb

    def frame(self, name: str = "frame") -> Frame:
        """Colours with depth, camera and pose, as far as they are known.

        Raises
        ------
        FileFormatError
            If a file is missing or damaged.
        ShapeError
            If sizes disagree.
        """
        from punnet.data.demos.pictures import read_depth

        return Frame(
            rgb=self.rgb(),
            depth=None if self.depth_path is None else read_depth(self.depth_path, self.depth_scale),
            camera=self.camera,
            T_base_camera=self.T_base_camera,
            timestamp=self.time,
            name=name,
        )


@dataclass(frozen=True, eq=False)
class Episode:
    """One demonstrated reach, or the distribution of several to the same target.

    Parameters
    ----------
    id
        Unique in its set.
    joints, poses
        The movement in joint and in task space; at least one of them.
    photographs
        In the order of their times; the first is the one from home, before the movement.
    target
        What it reached for, in the first photograph.
    target_id
        Repeats of the same reach share it; the episode's own id if not given.
    group
        Plant or scene: what shares it never stands on both sides of a split.
    joint_weights, task_weights
        Given where the source keeps weights in place of trajectories; then ``joints`` and ``poses`` are their
        means.
    extra
        Every other field of the source.

    Raises
    ------
    ShapeError
        If there is no movement, a space is the other one's, or the target lies outside the photograph.
    """

    id: str
    joints: Trajectory | None = None
    poses: Trajectory | None = None
    photographs: tuple[Photograph, ...] = ()
    target: Target | None = None
    target_id: str = ""
    group: str | None = None
    joint_weights: WeightDistribution | None = None
    task_weights: WeightDistribution | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"episode '{self.id}'"
        if self.joints is None and self.poses is None:
            raise ShapeError(f"{where}: has neither joints nor poses; a demonstration is a movement")
        for space, parts in (
            ("joint", (self.joints, self.joint_weights)),
            ("task", (self.poses, self.task_weights)),
        ):
            if any(part is not None and part.space != space for part in parts):
                raise ShapeError(f"{where}: what is given as its {space} space is of the other one")
        if not self.target_id:
            object.__setattr__(self, "target_id", self.id)
        if self.target is not None and self.photographs and self.photographs[0].size is not None:
            height, width = self.photographs[0].size
            x0, y0, x1, y1 = self.target.box
            if not (x0 < x1 and y0 < y1) or x1 <= 0 or y1 <= 0 or x0 >= width or y0 >= height:
                raise ShapeError(
                    f"{where}: target box {self.target.box.tolist()} (xyxy) is empty or outside its "
                    f"{width}×{height} photograph"
                )

    @property
    def movement(self) -> Trajectory:
        """Joints if there are any, else poses."""
        found = self.joints if self.joints is not None else self.poses
        assert found is not None
        return found

    @property
    def home(self) -> Photograph | None:
        """The first photograph."""
        return self.photographs[0] if self.photographs else None


@dataclass(frozen=True, eq=False)
class DemonstrationSet:
    """Demonstrations of one arm.

    Parameters
    ----------
    episodes
        In the order of the source.
    name
        What to call the set in tables and messages.
    info
        What is known of the set as a whole.

    Raises
    ------
    ShapeError
        If two episodes share an id, or they are of arms with other joints.
    """

    episodes: tuple[Episode, ...]
    name: str = "demonstrations"
    info: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "episodes", tuple(self.episodes))
        seen: set[str] = set()
        for episode in self.episodes:
            if episode.id in seen:
                raise ShapeError(f"{self.name}: episode id '{episode.id}' is given twice")
            seen.add(episode.id)
        names = {episode.joints.names for episode in self.episodes if episode.joints is not None}
        if len(names) > 1:
            raise ShapeError(f"{self.name}: episodes are of arms with other joints: {sorted(names)}")

    def __len__(self) -> int:
        return len(self.episodes)

    def __iter__(self) -> Iterator[Episode]:
        return iter(self.episodes)

    def __getitem__(self, index: int) -> Episode:
        return self.episodes[index]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, empty if no episode has any."""
        return next((episode.joints.names for episode in self.episodes if episode.joints is not None), ())

    @property
    def targets(self) -> dict[str, list[int]]:
        """Indices of the episodes of each target, in order of appearance."""
        return self._gathered(lambda episode: episode.target_id)

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the episodes of each group; one without a group is its target's."""
        return self._gathered(lambda episode: episode.target_id if episode.group is None else episode.group)

    def _gathered(self, key: Callable[[Episode], str]) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for index, episode in enumerate(self.episodes):
            found.setdefault(key(episode), []).append(index)
        return found

    def subset(self, indices: Iterable[int]) -> DemonstrationSet:
        """The episodes at ``indices``, in that order.

        Raises
        ------
        ConfigurationError
            If an index is out of range.
        """
        chosen = [int(index) for index in indices]
        if outside := [index for index in chosen if not 0 <= index < len(self)]:
            raise ConfigurationError(f"{self.name}: no episode {outside[0]}; there are {len(self)}")
        return replace(self, episodes=tuple(self.episodes[index] for index in chosen))

    def resampled(self, samples: int = 150) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Joints (N, T, J) and poses (N, T, 7) of all episodes, evenly over each.

        Raises
        ------
        ConfigurationError
            If an episode lacks one of them; the message names it.
        """
        joints, poses = [], []
        for episode in self.episodes:
            if episode.joints is None or episode.poses is None:
                missing = "joints" if episode.joints is None else "poses"
                raise ConfigurationError(f"{self.name}: episode '{episode.id}' has no {missing}")
            joints.append(episode.joints.resampled(samples))
            poses.append(episode.poses.resampled(samples))
        count = len(self.joint_names)
        return (
            np.asarray(joints).reshape(-1, samples, count),
            np.asarray(poses).reshape(-1, samples, 7),
        )
