from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from punnet.data.demos import read_demos, read_readable_demos
from punnet.data.demos.bag_pictures import picture_of
from punnet.data.demos.bags import read_bags
from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.formats import guess_demo_format
from tests.data.demos.recordings import JOINTS, KINDS, NAMES, Recorder, joint_state, record


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_recording(tmp_path: Path, kind: str) -> None:
    path = record(tmp_path, kind)
    assert guess_demo_format(path) == "bag"
    (episode,) = read_demos(path)
    assert episode.joints is not None
    assert episode.joints.names == NAMES[::-1]  # the order of the messages; fingers are no joints of the arm
    np.testing.assert_allclose(episode.joints.values, JOINTS[:, ::-1])
    np.testing.assert_allclose(episode.joints.times, np.arange(20) * 0.05, atol=1e-6)
    assert episode.poses is not None
    np.testing.assert_allclose(episode.poses.values[:, 0], JOINTS[:, 0])
    np.testing.assert_allclose(np.abs(episode.poses.values[0, 3:]), [0, 0, 0.6, 0.8])
    assert episode.home is not None
    assert (episode.home.rgb() == [0, 0, 200]).all()
    assert episode.home.camera is not None
    assert episode.home.camera.fy == 11.0
    assert episode.home.time == pytest.approx(-1.0, abs=1e-6)


def test_without_stamps_the_time_of_recording_counts(tmp_path: Path) -> None:
    (episode,) = read_demos(record(tmp_path, "rosbag2", stamped=False))
    np.testing.assert_allclose(episode.movement.times, np.arange(20) * 0.05, atol=1e-6)


def test_a_folder_of_recordings_passes_over_the_bad_one(tmp_path: Path) -> None:
    record(tmp_path, "rosbag1", "one")
    record(tmp_path, "rosbag2", "two")
    bad = JOINTS.copy()
    bad[3, 2] = np.nan
    record(tmp_path, "mcap-folder", "three", joints=bad)
    (tmp_path / "four.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(200))
    reading = read_readable_demos(tmp_path)
    assert [episode.id for episode in reading.episodes] == ["one", "two"]
    assert {(fault.episode, fault.code) for fault in reading.left_out} == {
        ("three", "not-finite"),
        ("four", "unreadable"),
    }


def test_a_recording_of_one_sample_or_none(tmp_path: Path) -> None:
    record(tmp_path, "rosbag2", "single", joints=JOINTS[:1])
    assert [fault.code for fault in read_readable_demos(tmp_path).left_out] == ["too-short"]
    path = tmp_path / "other"
    recorder = Recorder(path, "rosbag2")
    with recorder.writer:
        recorder.write("/text", recorder.make("std_msgs/msg/String", data="no joints"), 0.0)
    reading = read_readable_demos(path)
    assert [fault.code for fault in reading.left_out] == ["missing-field"]
    assert "/text (std_msgs/msg/String)" in reading.left_out[0].message


def test_a_topic_can_be_named(tmp_path: Path) -> None:
    path = tmp_path / "two_arms"
    recorder = Recorder(path, "rosbag2")
    with recorder.writer:
        for number in range(10):
            for side, count in (("left", 2), ("right", 3)):
                message = joint_state(
                    recorder, tuple("abc"[:count]), np.full(count, 0.1 * number), 10.0 + number
                )
                recorder.write(f"/{side}/joint_states", message, float(number))
            extra = joint_state(recorder, ("a", "b", "c"), np.full(3, 0.1), 10.5 + number)
            recorder.write("/right/joint_states", extra, number + 0.5)
    assert len(read_bags(path).episodes[0].movement.names) == 3
    assert len(read_bags(path, topic="/left/joint_states").episodes[0].movement.names) == 2
    assert "no topic /gone" in read_bags(path, topic="/gone").left_out[0].message


class Message:
    """An image message of given fields."""

    def __init__(self, **fields: object) -> None:
        self.__dict__.update(fields)


@pytest.mark.parametrize(
    ("encoding", "pixel", "expected"),
    [
        ("rgb8", [1, 2, 3], [1, 2, 3]),
        ("bgr8", [1, 2, 3], [3, 2, 1]),
        ("rgba8", [1, 2, 3, 9], [1, 2, 3]),
        ("bgra8", [1, 2, 3, 9], [3, 2, 1]),
        ("mono8", [7], [7, 7, 7]),
    ],
)
def test_encodings_and_padded_rows(encoding: str, pixel: list[int], expected: list[int]) -> None:
    rows = [[*pixel * 3, 99, 99] for _ in range(2)]
    data = np.array(rows, dtype=np.uint8).ravel()
    message = Message(encoding=encoding, height=2, width=3, step=len(rows[0]), data=data)
    picture = picture_of(message, "/a")
    assert picture is not None
    assert picture.read().tolist() == [[expected] * 3] * 2


def test_pictures_without_colours_and_short_ones() -> None:
    empty = np.zeros(4, np.uint8)
    assert picture_of(Message(encoding="16UC1", height=1, width=1, step=2, data=empty), "/a") is None
    assert picture_of(Message(format="16UC1; compressedDepth png", data=empty), "/a") is None
    with pytest.raises(EpisodeRefused, match="4 bytes for 9×9"):
        picture_of(Message(encoding="rgb8", height=9, width=9, step=27, data=empty), "/a")
