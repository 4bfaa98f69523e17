"""Pictures to an mp4 that a browser plays: H.264, yuv420p, index in front."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, OutputExistsError, RenderingError, ShapeError

__all__ = ["VideoWriter"]

_FINISHING_SECONDS = 120.0


class VideoWriter:
    """Writes RGB pictures to a video file, one :meth:`write` at a time.

    The file appears under its name only when it is whole: until then it grows beside it under a hidden name.
    Leaving the ``with`` block by an exception, Ctrl-C among them, keeps what was written so far as a whole,
    playable video. A video without a single picture leaves no file.

    Parameters
    ----------
    path
        The file to make, ``.mp4``; its folder is made if missing.
    fps
        Pictures per second of the video.
    size
        (width, height) in pixels of every picture. H.264 needs even numbers: an odd last one is cut off.
    quality
        x264's constant rate factor, 0 (lossless) … 51; 23 is its own default.
    force
        Replace a file that exists.

    Raises
    ------
    ConfigurationError
        If a number or the file's suffix is not usable.
    OutputExistsError
        If the file exists and ``force`` is not set.
    RenderingError
        If ffmpeg can't be started, or fails (disk full, folder not writable); its last words are passed on.
    """

    def __init__(
        self,
        path: str | Path,
        fps: float,
        size: tuple[int, int],
        *,
        quality: int = 23,
        force: bool = False,
    ) -> None:
        self.path = Path(path)
        self.frames_written = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._size = size
        _check(self.path, fps, size, quality)
        if self.path.is_dir() or (self.path.exists() and not force):
            raise OutputExistsError(f"{self.path}: exists; give another name or --force")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
            with tempfile.NamedTemporaryFile(
                prefix=f".{self.path.stem}-", suffix=".mp4", dir=self.path.parent, delete=False
            ) as file:
                self._partial = Path(file.name)
        except OSError as error:
            raise RenderingError(f"{self.path}: can't be written ({error.strerror})") from error
        try:
            self._process = _start_ffmpeg(self._partial, fps, size, quality, self._log)
        except (OSError, RuntimeError) as error:
            self._discard()
            raise RenderingError(
                f"{self.path}: ffmpeg can't be started ({error}); reinstall imageio-ffmpeg"
            ) from error

    def write(self, rgb: NDArray[np.uint8]) -> None:
        """Append one picture, uint8 (height, width, 3).

        Raises
        ------
        ShapeError
            If the picture is not of the video's size or not uint8.
        RenderingError
            If ffmpeg has stopped, or the writer is closed.
        """
        width, height = self._size
        if rgb.dtype != np.uint8 or rgb.shape != (height, width, 3):
            raise ShapeError(f"{self.path}: need uint8 {(height, width, 3)}, got {rgb.dtype} {rgb.shape}")
        if self._process is None or self._process.stdin is None:
            raise RenderingError(f"{self.path}: this video is closed; make a new one")
        try:
            self._process.stdin.write(np.ascontiguousarray(rgb).data)
        except (BrokenPipeError, OSError) as error:
            raise self._failure() from error
        self.frames_written += 1

    def close(self) -> None:
        """Finish the file and give it its name; may be called twice.

        Raises
        ------
        RenderingError
            If ffmpeg could not write the video.
        """
        process, self._process = self._process, None
        if process is None:
            return
        try:
            process.communicate(timeout=_FINISHING_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self.frames_written == 0:
            self._discard()
            return
        if process.returncode != 0:
            raise self._failure()
        self._log.close()
        self._partial.chmod(0o644)
        self._partial.replace(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
            return
        try:
            self.close()
        except RenderingError as second:  # the first failure is the one to report
            if error is not None:
                error.add_note(str(second))

    def _failure(self) -> RenderingError:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()
        self._log.seek(0)
        words = self._log.read().decode(errors="replace").strip().splitlines()
        self._discard()
        reason = words[-1] if words else "it said nothing"
        return RenderingError(
            f"{self.path}: ffmpeg could not write the video ({reason}); is there room on the disk?"
        )

    def _discard(self) -> None:
        self._partial.unlink(missing_ok=True)
        self._log.close()


def _check(path: Path, fps: float, size: tuple[int, int], quality: int) -> None:
    if path.suffix.lower() != ".mp4":
        raise ConfigurationError(f"{path}: a video's name must end in .mp4")
    if not 0 < fps <= 1000:
        raise ConfigurationError(f"{path}: fps must be in (0, 1000], got {fps}")
    if min(size) < 2:
        raise ConfigurationError(f"{path}: the picture must be at least 2×2 pixels, got {size}")
    if not 0 <= quality <= 51:
        raise ConfigurationError(f"{path}: quality is x264's 0…51, got {quality}")


def _start_ffmpeg(
    target: Path, fps: float, size: tuple[int, int], quality: int, log: IO[bytes]
) -> subprocess.Popen[bytes]:
    width, height = size
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-loglevel", "error", "-y"]
    command += [
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        f"{width}x{height}",
        "-r",
        f"{fps:g}",
    ]
    command += ["-i", "-", "-an", "-c:v", "libx264", "-preset", "veryfast", "-crf", str(quality)]
    command += ["-vf", f"crop={width - width % 2}:{height - height % 2}:0:0", "-pix_fmt", "yuv420p"]
    command += ["-movflags", "+faststart", str(target)]
    # A session of its own: Ctrl-C must reach us only, so that the file can be finished.
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log, start_new_session=True
    )
