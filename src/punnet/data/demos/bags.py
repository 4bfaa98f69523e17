"""ROS recordings without ROS: rosbag1 (``.bag``), rosbag2 (folder with ``metadata.yaml``), single ``.mcap`` and ``.db3`` files.

One recording is one demonstration. Joints come from ``sensor_msgs/JointState``, poses from ``geometry_msgs/PoseStamped``,
the photograph from the first message of an ``Image`` or ``CompressedImage`` topic, its intrinsics from ``CameraInfo``. Of
several topics of a kind the one with the most messages is taken; depth pictures and finger joints are passed over. A topic
can be named where that guess is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.demos.bag_pictures import picture_of
from punnet.data.demos.episode import Episode, Photograph
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.reading import Reading, trajectory_of
from punnet.errors import ConfigurationError, PunnetError, ShapeError
from punnet.geometry import CameraIntrinsics

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

__all__ = ["is_bag", "read_bags"]

JOINT_STATE = "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseStamped"
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

_SUFFIXES = (".bag", ".mcap", ".db3")
_FINGER = re.compile(r"finger|gripper|hand", re.IGNORECASE)
_NANO = 1e-9


def is_bag(path: Path) -> bool:
    """Whether the path is a recording or a folder of them."""
    return bool(_recordings(path))


def read_bags(path: str | Path, *, topic: str | None = None) -> Reading:
    """Read one recording, or a folder of them, each an episode.

    Parameters
    ----------
    path
        The recording or the folder.
    topic
        Of the joint states; the one with the most messages if not given.

    Raises
    ------
    ConfigurationError
        If the package that reads them is not installed.
    """
    _require_rosbags()
    path = Path(path)
    reading = Reading(path)
    for recording in _recordings(path):
        with reading.episode(recording.stem, recording):
            reading.add(_episode(recording, topic))
    return reading


def _recordings(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix in _SUFFIXES else []
    if not path.is_dir():
        return []
    if (path / "metadata.yaml").is_file():
        return [path]
    inside = [
        place
        for place in path.iterdir()
        if (place.is_file() and place.suffix in _SUFFIXES) or (place / "metadata.yaml").is_file()
    ]
    return sorted(inside)


def _require_rosbags() -> None:
    try:
        import rosbags.highlevel  # noqa: F401
    except ImportError as error:
        raise ConfigurationError(
            "ROS recordings need the package rosbags: pip install 'punnet[ros]'"
        ) from error


def _episode(recording: Path, topic: str | None) -> Episode:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if recording.suffix == ".bag" else Stores.ROS2_HUMBLE)
    try:
        with AnyReader([recording], default_typestore=store) as bag:
            return _assembled(recording, bag, topic)
    except PunnetError:
        raise
    except Exception as error:  # a damaged recording makes rosbags fail in as many ways as there are bytes
        raise EpisodeRefused(
            [("unreadable", f"not a readable recording ({type(error).__name__}: {error})")]
        ) from error


def _assembled(recording: Path, bag: AnyReader, topic: str | None) -> Episode:
    joint_topic = _topic(bag, (JOINT_STATE,), topic)
    if joint_topic is None:
        there = ", ".join(sorted(f"{name} ({info.msgtype})" for name, info in bag.topics.items())) or "none"
        wanted = f"topic {topic}" if topic else "topic"
        raise EpisodeRefused([("missing-field", f"no {wanted} of {JOINT_STATE}; topics: {there}")])
    times, positions, names = _joint_states(bag, joint_topic)
    start = times[0] if len(times) else 0.0
    pose_topic = _topic(bag, (POSE,), None)
    poses = None
    if pose_topic is not None:
        moments, values = _poses(bag, pose_topic)
        if len(moments) > 1:
            poses = trajectory_of(moments - start, values, space="task")
    photograph = _photograph(bag, start)
    return Episode(
        id=recording.stem,
        joints=trajectory_of(times - start, positions, names=names),
        poses=poses,
        photographs=() if photograph is None else (photograph,),
        extra={"topic": joint_topic, "start_time": float(start)},
    )


def _topic(bag: AnyReader, kinds: tuple[str, ...], wanted: str | None) -> str | None:
    found = [
        (info.msgcount, name)
        for name, info in bag.topics.items()
        if info.msgtype in kinds and info.msgcount and (wanted is None or name == wanted)
    ]
    return max(found)[1] if found else None


def _messages(bag: AnyReader, topic: str) -> Iterator[tuple[float, Any]]:
    """Time in seconds and message; the header's time where it has one, else when it was recorded."""
    connections = [connection for connection in bag.connections if connection.topic == topic]
    for connection, nanoseconds, raw in bag.messages(connections=connections):
        message: Any = bag.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp
        stamped = float(stamp.sec) + float(stamp.nanosec) * _NANO
        yield (stamped if stamped > 0 else nanoseconds * _NANO), message


def _joint_states(
    bag: AnyReader, topic: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[str, ...]]:
    """Times, positions and names of the arm's joints, in the order of the first message; other messages may differ."""
    names: tuple[str, ...] = ()
    times, rows = [], []
    for time, message in _messages(bag, topic):
        here = tuple(str(name) for name in message.name)
        positions = np.asarray(message.position, dtype=np.float64)
        if not names:
            names = tuple(name for name in here if not _FINGER.search(name)) or here
            if not names:
                names = tuple(f"q{number + 1}" for number in range(len(positions)))
        if not here:
            here = names
        if len(here) != len(positions):
            raise EpisodeRefused(
                [
                    (
                        "length-mismatch",
                        f"{topic}: {len(here)} names for {len(positions)} positions in one message",
                    )
                ]
            )
        by_name = dict(zip(here, positions.tolist(), strict=True))
        if not all(name in by_name for name in names):
            continue  # another publisher on the same topic: the gripper's joints alone
        times.append(time)
        rows.append([by_name[name] for name in names])
    return np.asarray(times), np.asarray(rows).reshape(len(rows), len(names)), names


def _poses(bag: AnyReader, topic: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    times, rows = [], []
    for time, message in _messages(bag, topic):
        place, turn = message.pose.position, message.pose.orientation
        times.append(time)
        rows.append([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    return np.asarray(times), np.asarray(rows, dtype=np.float64).reshape(-1, 7)


def _photograph(bag: AnyReader, start: float) -> Photograph | None:
    topics = sorted(
        (-info.msgcount, name)
        for name, info in bag.topics.items()
        if info.msgtype in IMAGES and info.msgcount and "depth" not in name
    )
    for _, topic in topics:
        time, message = next(_messages(bag, topic))
        picture = picture_of(message, topic)
        if picture is not None:
            size = picture.read().shape
            return Photograph(
                picture, (size[0], size[1]), time=time - start, camera=_camera(bag, topic, (size[0], size[1]))
            )
    return None


def _camera(bag: AnyReader, image_topic: str, size: tuple[int, int]) -> CameraIntrinsics | None:
    """Intrinsics of the ``camera_info`` beside the image topic, if they are for that size."""
    namespace = image_topic.rsplit("/", 1)[0].removesuffix("/compressed")
    for place in (namespace, namespace.rsplit("/", 1)[0]):
        topic = _topic(bag, (CAMERA_INFO,), f"{place}/camera_info")
        if topic is None:
            continue
        _, message = next(_messages(bag, topic))
        matrix = np.asarray(getattr(message, "k", None) if hasattr(message, "k") else message.K).reshape(3, 3)
        if (message.height, message.width) != size:
            return None
        try:
            return CameraIntrinsics(
                size[1],
                size[0],
                float(matrix[0, 0]),
                float(matrix[1, 1]),
                float(matrix[0, 2]),
                float(matrix[1, 2]),
            )
        except ShapeError:
            return None  # an uncalibrated camera writes zeros
    return None
