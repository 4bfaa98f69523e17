"""Videos: playable, whole or absent, kept when interrupted, clear when something fails."""

from __future__ import annotations

from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, OutputExistsError, RenderingError, ShapeError
from punnet.sim import video as video_module
from punnet.sim.video import VideoWriter


def _picture(brightness: int, width: int = 64, height: int = 48) -> NDArray[np.uint8]:
    picture = np.zeros((height, width, 3), dtype=np.uint8)
    picture[:, : width // 2] = (brightness, 0, 0)
    return picture


def _frames(path: Path) -> list[NDArray[np.uint8]]:
    capture = cv2.VideoCapture(str(path))
    frames = []
    while True:
        more, frame = capture.read()
        if not more:
            return frames
        frames.append(frame[:, :, ::-1])


def test_pictures_come_back_in_order_and_colour(tmp_path: Path) -> None:
    path = tmp_path / "made" / "pick.mp4"
    with VideoWriter(path, 25, (64, 48)) as video:
        for brightness in (60, 120, 240):
            video.write(_picture(brightness))
        assert not path.exists()  # nothing half-made under its name
    frames = _frames(path)
    assert [frame.shape for frame in frames] == [(48, 64, 3)] * 3
    for frame, brightness in zip(frames, (60, 120, 240), strict=True):
        assert frame[24, 8, 0] == pytest.approx(brightness, abs=12)
        assert frame[24, 8, 2] < 25
    assert list(path.parent.iterdir()) == [path]


def test_a_browser_can_play_it(tmp_path: Path) -> None:
    path = tmp_path / "pick.mp4"
    with VideoWriter(path, 12.5, (64, 48)) as video:
        video.write(_picture(200))
    reader = imageio_ffmpeg.read_frames(str(path))
    about = next(reader)
    reader.close()
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p")
    assert about["fps"] == pytest.approx(12.5)
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # index in front: plays while it loads


def test_an_odd_last_row_is_cut_off(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "odd.mp4", 10, (65, 49)) as video:
        video.write(_picture(200, 65, 49))
    assert _frames(tmp_path / "odd.mp4")[0].shape == (48, 64, 3)


def test_an_interruption_keeps_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "pick.mp4"
    with pytest.raises(KeyboardInterrupt):
        _write_two_and_be_interrupted(path)
    assert len(_frames(path)) == 2


def _write_two_and_be_interrupted(path: Path) -> None:
    with VideoWriter(path, 25, (64, 48)) as video:
        video.write(_picture(100))
        video.write(_picture(200))
        raise KeyboardInterrupt


def test_no_pictures_leave_no_file(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "empty.mp4", 25, (64, 48)):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_needs_force(tmp_path: Path) -> None:
    path = tmp_path / "pick.mp4"
    path.write_text("mine")
    with pytest.raises(OutputExistsError, match="--force"):
        VideoWriter(path, 25, (64, 48))
    assert path.read_text() == "mine"
    with VideoWriter(path, 25, (64, 48), force=True) as video:
        video.write(_picture(90))
    assert len(_frames(path)) == 1


def test_a_folder_in_its_place_is_refused_even_with_force(tmp_path: Path) -> None:
    (tmp_path / "pick.mp4").mkdir()
    with pytest.raises(OutputExistsError):
        VideoWriter(tmp_path / "pick.mp4", 25, (64, 48), force=True)


def test_a_file_in_place_of_the_folder_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(RenderingError, match="can't be written"):
        VideoWriter(tmp_path / "out" / "pick.mp4", 25, (64, 48))


def test_a_full_disk_is_reported_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    start = video_module._start_ffmpeg
    monkeypatch.setattr(
        "punnet.sim.video._start_ffmpeg", lambda target, *rest: start(Path("/dev/full"), *rest)
    )
    with pytest.raises(RenderingError, match="ffmpeg could not write"):
        _write_many(tmp_path / "pick.mp4")
    assert list(tmp_path.iterdir()) == []


def _write_many(path: Path) -> None:
    rng = np.random.default_rng(0)
    with VideoWriter(path, 25, (64, 48)) as video:
        for _ in range(50):
            video.write(rng.integers(0, 256, (48, 64, 3), dtype=np.uint8))


def test_ffmpeg_dying_midway_is_reported(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "pick.mp4", 25, (640, 480))
    picture = _picture(9, 640, 480)
    video.write(picture)
    assert video._process is not None
    video._process.kill()
    with pytest.raises(RenderingError, match="ffmpeg could not write"):
        _write_forever(video, picture)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(RenderingError, match="closed"):
        video.write(picture)


def _write_forever(video: VideoWriter, picture: NDArray[np.uint8]) -> None:
    for _ in range(100):
        video.write(picture)


def test_a_missing_ffmpeg_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", lambda: "/nowhere/ffmpeg")
    with pytest.raises(RenderingError, match="reinstall imageio-ffmpeg"):
        VideoWriter(tmp_path / "pick.mp4", 25, (64, 48))
    assert list(tmp_path.iterdir()) == []


def test_wrong_pictures_and_settings_are_refused(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "pick.mp4", 25, (64, 48)) as video:
        with pytest.raises(ShapeError, match="need uint8"):
            video.write(_picture(1, 48, 64))
        with pytest.raises(ShapeError, match="need uint8"):
            video.write(np.zeros((48, 64, 3)))  # type: ignore[arg-type]
    for path, rate, size, quality in (
        ("pick.avi", 25.0, (64, 48), 23),
        ("pick.mp4", 0.0, (64, 48), 23),
        ("pick.mp4", 25.0, (64, 1), 23),
        ("pick.mp4", 25.0, (64, 48), 99),
    ):
        with pytest.raises(ConfigurationError):
            VideoWriter(tmp_path / path, rate, size, quality=quality)
