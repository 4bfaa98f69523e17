"""Image files as people have them, and as they should not be."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np


def encoded(image: np.ndarray, suffix: str = ".png") -> bytes:
    """RGB, grey or RGBA pixels as a file's bytes."""
    order = {2: slice(None), 3: [2, 1, 0], 4: [2, 1, 0, 3]}
    channels = image if image.ndim == 2 else image[:, :, order[image.shape[2]]]
    return bytes(cv2.imencode(suffix, np.ascontiguousarray(channels))[1])


def turned_jpeg(image: np.ndarray, orientation: int) -> bytes:
    """A JPEG whose EXIF data say how it is to be turned."""
    tiff = b"MM\x00\x2a" + struct.pack(">IHHHIHH", 8, 1, 0x0112, 3, 1, orientation, 0) + bytes(4)
    segment = b"Exif\x00\x00" + tiff
    plain = encoded(image, ".jpg")
    return plain[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + plain[2:]


def boastful_png(width: int = 60_000, height: int = 60_000) -> bytes:
    """A few bytes that say they are 3.6 gigapixels."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(999)))
        + chunk(b"IEND", b"")
    )
