"""A picture of the images a detector does worst on: what is annotated beside what was found."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage
from punnet.errors import ConfigurationError
from punnet.perception.comparing import ImageRecord
from punnet.perception.detector import Detector
from punnet.scene.overlay import draw_overlay

__all__ = ["draw_worst_images"]

TILE_WIDTH = 640
CAPTION_HEIGHT = 26
GAP = 6
DARK = (20, 20, 20)
WHITE = (255, 255, 255)


def draw_worst_images(
    images: Sequence[AnnotatedImage],
    records: Sequence[ImageRecord],
    detector: Detector,
    user_score: float,
    *,
    columns: int = 2,
) -> NDArray[np.uint8]:
    """A sheet of pairs, annotated on the left and found on the right, each with a line that counts its mistakes.

    Parameters
    ----------
    images
        The data set that was evaluated; its images are read and searched once more.
    records
        Which of them to show, in order.
    detector, user_score
        What found the berries, and from which score on they are drawn.
    columns
        Pairs beside one another.

    Raises
    ------
    ConfigurationError
        If there is no record.
    """
    if not records:
        raise ConfigurationError("worst images: there is none to draw")
    pairs = [_pair(images[record.index], record, detector, user_score) for record in records]
    height = max(pair.shape[0] for pair in pairs)
    pairs = [
        cv2.copyMakeBorder(
            pair, 0, height - pair.shape[0] + GAP, 0, GAP, cv2.BORDER_CONSTANT, value=WHITE
        ).astype(np.uint8)
        for pair in pairs
    ]
    columns = min(columns, len(pairs))
    blank = np.full_like(pairs[0], 255)
    pairs += [blank] * (-len(pairs) % columns)
    return np.vstack([np.hstack(pairs[i : i + columns]) for i in range(0, len(pairs), columns)])


def _pair(
    image: AnnotatedImage, record: ImageRecord, detector: Detector, user_score: float
) -> NDArray[np.uint8]:
    frame = image.frame()
    found = detector.detect(frame)
    pictures = [
        _reduced(draw_overlay(frame.rgb, berries))
        for berries in (image.berries(), found[found.scores >= user_score])
    ]
    pair = np.hstack(pictures)
    caption = np.full((CAPTION_HEIGHT, pair.shape[1], 3), WHITE, dtype=np.uint8)
    words = (
        f"{image.path.name}: {len(record.berries)} berries; {record.missed} missed, {record.misnamed} misnamed, "
        f"{len(record.false_classes)} false   (annotated | found)"
    )
    cv2.putText(caption, words, (6, CAPTION_HEIGHT - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.55, DARK, 1, cv2.LINE_AA)
    return np.vstack((caption, pair))


def _reduced(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    scale = TILE_WIDTH / picture.shape[1]
    size = (TILE_WIDTH, max(1, round(picture.shape[0] * scale)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
