"""Where the picture of an episode is: a file, bytes inside another file, or an instant of a video."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import FileFormatError, ShapeError
from punnet.scene.frame import read_image

__all__ = [
    "EncodedPicture",
    "PictureFile",
    "PictureSource",
    "RawPicture",
    "VideoPicture",
    "mark_target",
    "read_depth",
    "target_picture",
]

_DECODING_SECONDS = 60.0
NETWORK_SIDE = 128
"""Side in pixels of the square image that the thesis' networks see."""


class PictureSource(Protocol):
    """Something that gives a picture when asked; its ``str`` says where it is."""

    def read(self) -> NDArray[np.uint8]:
        """(H, W, 3) RGB; FileFormatError if it can't be had."""


@dataclass(frozen=True)
class PictureFile:
    """A picture in a file of its own."""

    path: Path

    def __str__(self) -> str:
        return str(self.path)

    def read(self) -> NDArray[np.uint8]:
        """Read it, turned as its EXIF orientation says."""
        return read_image(self.path)


@dataclass(frozen=True, repr=False)
class EncodedPicture:
    """A PNG or JPEG among the bytes of another file; ``where`` names it."""

    content: bytes
    where: str

    def __str__(self) -> str:
        return self.where

    def read(self) -> NDArray[np.uint8]:
        """Decode it."""
        buffer = np.frombuffer(self.content, dtype=np.uint8)
        try:
            image = cv2.imdecode(buffer, cv2.IMREAD_COLOR) if buffer.size else None
        except cv2.error:
            image = None
        if image is None:
            raise FileFormatError(f"{self.where}: not an image, or damaged")
        return np.ascontiguousarray(image[:, :, ::-1], dtype=np.uint8)


@dataclass(frozen=True, eq=False, repr=False)
class RawPicture:
    """A picture that is already there; ``where`` says whence."""

    rgb: NDArray[np.uint8]
    where: str

    def __str__(self) -> str:
        return self.where

    def read(self) -> NDArray[np.uint8]:
        """Give it."""
        return self.rgb


@dataclass(frozen=True)
class VideoPicture:
    """An instant of a video, in seconds from its start."""

    path: Path
    time: float
    size: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.path} at {self.time:.3f} s"

    def read(self) -> NDArray[np.uint8]:
        """Decode that one picture; the last few are kept."""
        return _video_picture(self.path, self.time, self.size)


@lru_cache(maxsize=16)
def _video_picture(path: Path, time: float, size: tuple[int, int]) -> NDArray[np.uint8]:
    import imageio_ffmpeg

    if not path.is_file():
        raise FileFormatError(f"{path}: no such file; a video is needed")
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-nostdin", "-ss", f"{time:.6f}", "-i"]
    command += [str(path), "-frames:v", "1", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=_DECODING_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise FileFormatError(f"{path}: can't be decoded ({error})") from error
    if len(done.stdout) != size[0] * size[1] * 3:
        words = done.stderr.decode(errors="replace").strip().splitlines()
        reason = words[-1] if words else f"no picture of {size[1]}×{size[0]} there"
        raise FileFormatError(f"{path} at {time:.3f} s: can't be decoded ({reason})")
    picture = np.frombuffer(done.stdout, dtype=np.uint8).reshape(*size, 3)
    picture.setflags(write=False)
    return picture


def read_depth(path: Path, scale: float) -> NDArray[np.float32]:
    """Depth (H, W) in metres from a 16-bit PNG of ``scale`` metres a count.

    Raises
    ------
    FileFormatError
        If it is missing, damaged or of another kind.
    """
    try:
        encoded = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED) if encoded.size else None
    except (OSError, cv2.error) as error:
        raise FileFormatError(f"{path}: can't be read ({error}); a 16-bit depth PNG is needed") from error
    if image is None or image.dtype != np.uint16 or image.ndim != 2:
        raise FileFormatError(f"{path}: not a 16-bit PNG of one channel; depth is needed")
    return np.asarray(image.astype(np.float64) * scale, dtype=np.float32)


def mark_target(rgb: NDArray[np.uint8], box: ArrayLike) -> NDArray[np.uint8]:
    """A copy of the picture with the target's box (xyxy pixels) filled white, as the networks are told of it.

    Raises
    ------
    ShapeError
        If the box is empty or outside the picture.
    """
    marked = rgb.copy()
    marked[_pixels_inside(rgb, box)] = 255
    return marked


def target_picture(
    rgb: NDArray[np.uint8], box: ArrayLike | None, side: int = NETWORK_SIDE
) -> NDArray[np.uint8]:
    """What a network sees: the target marked (if a box is given), the whole squeezed to (side, side, 3).

    The aspect is not kept, as in the lab's code.

    Raises
    ------
    ShapeError
        If the box is empty or outside the picture.
    """
    values = rgb.astype(np.float32)
    if box is not None:
        values[_pixels_inside(rgb, box)] = 255.0
    # Across, then down: OpenCV is quicker at means over whole pixels, and the widths of cameras are multiples of 128.
    across = cv2.resize(values, (side, len(rgb)), interpolation=cv2.INTER_AREA)
    return np.asarray(np.rint(cv2.resize(across, (side, side), interpolation=cv2.INTER_AREA)), dtype=np.uint8)


def _pixels_inside(rgb: NDArray[np.uint8], box: ArrayLike) -> tuple[slice, slice]:
    x0, y0, x1, y1 = (float(value) for value in np.asarray(box, dtype=np.float64).ravel())
    height, width = rgb.shape[:2]
    left, top = max(0, round(x0)), max(0, round(y0))
    right, bottom = min(width, round(x1)), min(height, round(y1))
    if left >= right or top >= bottom:
        raise ShapeError(
            f"target box {[x0, y0, x1, y1]} (xyxy) is empty or outside the {width}×{height} picture"
        )
    return slice(top, bottom), slice(left, right)
