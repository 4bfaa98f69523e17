"""The videos of a LeRobot dataset: each episode's pictures as frames of one rate, several episodes a file."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import OutputError

__all__ = ["CODEC", "PIXELS", "encode_episode", "even_size", "join_videos"]

CODEC, PIXELS = "h264", "yuv420p"
_KEY_FRAMES = 30
"""Frames from one that can be decoded by itself to the next."""

_SECONDS = 600.0


def even_size(size: tuple[int, int]) -> tuple[int, int]:
    """(H, W) rounded up to even numbers, which H.264 needs."""
    return size[0] + size[0] % 2, size[1] + size[1] % 2


def encode_episode(
    pictures: list[NDArray[np.uint8]], shown: NDArray[np.int64], fps: float, place: Path
) -> None:
    """Write a video of ``len(shown)`` frames, frame k showing ``pictures[shown[k]]``.

    Odd sizes are padded by repeating the last row or column.

    Raises
    ------
    OutputError
        If ffmpeg fails; its last words are passed on.
    """
    with tempfile.TemporaryDirectory(prefix="punnet-") as folder:
        files = []
        for number, picture in enumerate(pictures):
            height, width = even_size((picture.shape[0], picture.shape[1]))
            padding = ((0, height - picture.shape[0]), (0, width - picture.shape[1]), (0, 0))
            files.append(Path(folder) / f"picture{number}.bmp")
            cv2.imwrite(
                str(files[-1]), np.ascontiguousarray(np.pad(picture, padding, mode="edge")[:, :, ::-1])
            )
        for frame, which in enumerate(shown):
            (Path(folder) / f"{frame:07d}.bmp").symlink_to(files[which])
        source = ["-framerate", f"{fps:g}", "-i", str(Path(folder) / "%07d.bmp")]
        coding = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "18", "-g", str(_KEY_FRAMES), "-bf", "0"]
        _ffmpeg([*source, *coding, "-pix_fmt", PIXELS, "-threads", "1", str(place)])


def join_videos(parts: list[Path], place: Path) -> None:
    """One video of several that were encoded alike, one after the other.

    Raises
    ------
    OutputError
        If ffmpeg fails; its last words are passed on.
    """
    with tempfile.NamedTemporaryFile("w", suffix=".txt", encoding="utf-8") as listing:
        listing.writelines(f"file '{part}'\n" for part in parts)
        listing.flush()
        _ffmpeg(
            [
                "-f",
                "concat",
                "-safe",
                "0",
                "-i",
                listing.name,
                "-c",
                "copy",
                "-movflags",
                "+faststart",
                str(place),
            ]
        )


def _ffmpeg(arguments: list[str]) -> None:
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-nostdin", "-v", "error", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise OutputError(f"{arguments[-1]}: video can't be encoded ({error})") from error
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines()
        raise OutputError(
            f"{arguments[-1]}: video can't be encoded ({words[-1] if words else 'ffmpeg failed'})"
        )
