"""Pictures in ``sensor_msgs/Image`` and ``CompressedImage``."""

from __future__ import annotations

from typing import Any

import numpy as np

from punnet.data.demos.faults import EpisodeRefused
from punnet.data.demos.pictures import EncodedPicture, PictureSource, RawPicture

__all__ = ["picture_of"]

_ORDERS = {
    "rgb8": (3, (0, 1, 2)),
    "bgr8": (3, (2, 1, 0)),
    "rgba8": (4, (0, 1, 2)),
    "bgra8": (4, (2, 1, 0)),
    "mono8": (1, (0, 0, 0)),
    "8UC1": (1, (0, 0, 0)),
    "8UC3": (3, (2, 1, 0)),
}  # bytes a pixel, and which of them are red, green and blue


def picture_of(message: Any, topic: str) -> PictureSource | None:
    """The picture of a message; None if it shows no colours (depth, Bayer patterns).

    Raises
    ------
    EpisodeRefused
        If there are fewer bytes than its size needs.
    """
    content = np.asarray(message.data, dtype=np.uint8)
    if not hasattr(message, "encoding"):
        picture = EncodedPicture(content.tobytes(), topic)
        return None if "compressedDepth" in str(message.format) else picture
    encoding = str(message.encoding)
    if encoding not in _ORDERS:
        return None
    height, width, row = int(message.height), int(message.width), int(message.step)
    count, order = _ORDERS[encoding]
    if height < 1 or width < 1 or row < width * count or content.size < height * row:
        raise EpisodeRefused(
            [
                (
                    "unreadable-image",
                    f"{topic}: {content.size} bytes for {width}×{height} {encoding}, {row} a row",
                )
            ]
        )
    pixels = content[: height * row].reshape(height, row)[:, : width * count].reshape(height, width, count)
    return RawPicture(np.ascontiguousarray(pixels[:, :, list(order)]), topic)
