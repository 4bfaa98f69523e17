"""What folders that grow plant by plant are written with: pictures and JSON, each file in one step."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import OutputError

__all__ = ["DEPTH_UNIT", "json_bytes", "write_pictures", "write_whole"]

DEPTH_UNIT = 0.001
"""Metres that one count of a depth picture stands for."""

_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 92]
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 3]


def write_pictures(
    folder: Path, name: str, rgb: NDArray[np.uint8], depth: NDArray[np.float32]
) -> tuple[str, str]:
    """Write colours (H, W, 3) as JPEG and depth (H, W), metres, as 16-bit PNG; their places in the folder."""
    rgb_place, depth_place = f"rgb/{name}.jpg", f"depth/{name}.png"
    write_whole(folder / rgb_place, _encoded(".jpg", rgb[:, :, ::-1], _JPEG))
    counts = np.rint(depth / np.float32(DEPTH_UNIT)).astype(np.uint16)
    write_whole(folder / depth_place, _encoded(".png", counts, _PNG))
    return rgb_place, depth_place


def json_bytes(value: Any) -> bytes:
    """Indented JSON; NaN is refused."""
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file in one step: there is never half of it. What a killed run leaves beside begins with a dot."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_bytes(content)
    beside.replace(path)


def _encoded(suffix: str, image: NDArray[Any], options: list[int]) -> bytes:
    done, encoded = cv2.imencode(suffix, image, options)
    if not done:
        raise OutputError(f"an image of {image.shape} could not be encoded as {suffix}")
    return bytes(encoded.tobytes())
