"""ROS recordings made for tests, of every kind that is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

KINDS = ("rosbag1", "rosbag2", "mcap-folder", "mcap", "db3")
NAMES = tuple(f"panda_joint{number}" for number in range(1, 8))
JOINTS = np.linspace(0, 1, 20)[:, None] * np.arange(1.0, 8.0) * 0.1
SECOND = 1_000_000_000
START = 1_700_000_000


class Recorder:
    """Writes messages of one recording, ROS 1 or 2."""

    def __init__(self, path: Path, kind: str) -> None:
        self.is_one = kind == "rosbag1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is_one else Stores.ROS2_HUMBLE)
        self.writer: Any
        if self.is_one:
            self.writer = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if kind.startswith("mcap") else StoragePlugin.SQLITE3
            self.writer = Writer2(path, version=9, storage_plugin=plugin)
        self.connections: dict[str, Any] = {}

    def header(self, seconds: float) -> Any:
        types = self.store.types
        nano = round(seconds * SECOND)
        stamp = types["builtin_interfaces/msg/Time"](sec=nano // SECOND, nanosec=nano % SECOND)
        more = {"seq": 0} if self.is_one else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="base", **more)

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def write(self, topic: str, message: Any, seconds: float) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialise = self.store.serialize_ros1 if self.is_one else self.store.serialize_cdr
        nano = START * SECOND + round(seconds * SECOND)
        self.writer.write(self.connections[topic], nano, serialise(message, kind))


def joint_state(recorder: Recorder, names: tuple[str, ...], positions: Any, stamp: float) -> Any:
    return recorder.make(
        "sensor_msgs/msg/JointState",
        header=recorder.header(stamp),
        name=list(names),
        position=np.asarray(positions, dtype=np.float64),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )


def record(
    folder: Path, kind: str, name: str = "reach", *, joints: np.ndarray = JOINTS, stamped: bool = True
) -> Path:
    """A reach with fingers, poses, a photograph and its camera; the path to read."""
    path = folder / (f"{name}.bag" if kind == "rosbag1" else name)
    recorder = Recorder(path, kind)
    with recorder.writer:
        _picture(recorder)
        for number, row in enumerate(joints):
            time = number * 0.05
            stamp = START + time if stamped else 0.0
            arm = joint_state(recorder, (*NAMES[::-1], "panda_finger_joint1"), [*row[::-1], 0.04], stamp)
            recorder.write("/joint_states", arm, time)
            fingers = joint_state(recorder, ("panda_finger_joint1",), [0.04], stamp)
            if number % 2:
                recorder.write("/joint_states", fingers, time + 0.01)
            _pose(recorder, row, stamp or START + time, time)
    if kind == "mcap":
        return next(path.glob("*.mcap"))
    return next(path.glob("*.db3")) if kind == "db3" else path


def _pose(recorder: Recorder, row: np.ndarray, stamp: float, time: float) -> None:
    point = recorder.make("geometry_msgs/msg/Point", x=float(row[0]), y=0.1, z=0.7)
    turn = recorder.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.6, w=-0.8)
    pose = recorder.make("geometry_msgs/msg/Pose", position=point, orientation=turn)
    message = recorder.make("geometry_msgs/msg/PoseStamped", header=recorder.header(stamp), pose=pose)
    recorder.write("/pose", message, time)


def _picture(recorder: Recorder) -> None:
    pixels = np.zeros((6, 8, 3), dtype=np.uint8)
    pixels[..., 0] = 200  # blue, as bgr8
    common = {"header": recorder.header(START - 1.0), "height": 6, "width": 8, "is_bigendian": 0}
    picture = recorder.make("sensor_msgs/msg/Image", **common, encoding="bgr8", step=24, data=pixels.ravel())
    depth = recorder.make(
        "sensor_msgs/msg/Image", **common, encoding="16UC1", step=16, data=np.zeros(96, dtype=np.uint8)
    )
    recorder.write("/camera/depth/image_raw", depth, -1.0)
    recorder.write("/camera/color/image_raw", picture, -1.0)
    letters = "DKRP" if recorder.is_one else "dkrp"
    matrix = np.array([10.0, 0, 3.5, 0, 11.0, 2.5, 0, 0, 1])
    values = dict(zip(letters, (np.zeros(5), matrix, np.eye(3).ravel(), np.zeros(12)), strict=True))
    roi = recorder.make(
        "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    common.pop("is_bigendian")
    info = recorder.make(
        "sensor_msgs/msg/CameraInfo", **common, distortion_model="plumb_bob", binning_x=0, binning_y=0, roi=roi, **values
    )  # fmt: skip
    recorder.write("/camera/color/camera_info", info, -1.0)
