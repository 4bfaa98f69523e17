"""A small annotated set with known answers, and a detector that says what it was told to say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, Strawberries

SIZE = (60, 80)
CAMERA = CameraIntrinsics(80, 60, 100.0, 100.0, 39.5, 29.5)
# Of a square berry: its key-points as shares of its side, from its top-left corner.
PLACES = np.array([[0.5, -0.3], [0.5, 0], [0.5, 1], [0, 0.4], [1, 0.4]])


def keypoints_of(corner: tuple[int, int], side: int = 10) -> np.ndarray:
    return np.array(corner, float) + side * PLACES


def square(corner: tuple[int, int], number: int, *, side: int = 10, **fields: Any) -> Annotation:
    """A square berry with its top-left corner at (u, v)."""
    u, v = corner
    return Annotation(
        id=number,
        class_index=fields.pop("class_index", 0),
        box=np.array([u, v, u + side, v + side], float),
        segmentation=fields.pop("segmentation", [[u, v, u + side, v, u + side, v + side, u, v + side]]),
        keypoints=fields.pop("keypoints", keypoints_of(corner, side)),
        visibility=fields.pop("visibility", np.full(5, 2)),
        **fields,
    )


def image_of(folder: Path, number: int, *annotations: Annotation, **fields: Any) -> AnnotatedImage:
    """An image file of noise, and its annotations."""
    path = folder / f"{number}.png"
    noise = np.random.default_rng(number).integers(0, 255, (*SIZE, 3), dtype=np.uint8)
    cv2.imwrite(str(path), noise)
    return AnnotatedImage(number, path, SIZE[1], SIZE[0], annotations, **fields)


def set_of(*images: AnnotatedImage) -> Dataset:
    return Dataset(tuple(images), name="squares")


def found(
    corners: list[tuple[int, int]],
    *,
    side: int = 10,
    scores: list[float] | None = None,
    classes: list[int] | None = None,
    shift: tuple[float, float] = (0.0, 0.0),
    visibility: int = 2,
) -> Strawberries:
    """Square detections; key-points moved by ``shift`` (u, v)."""
    n = len(corners)
    masks = np.zeros((n, *SIZE), bool)
    for i, (u, v) in enumerate(corners):
        masks[i, v : v + side, u : u + side] = True
    return Strawberries(
        image_size=SIZE,
        boxes=np.array([[u, v, u + side, v + side] for u, v in corners], float).reshape(n, 4),
        scores=np.array([0.9] * n if scores is None else scores),
        classes=np.array([0] * n if classes is None else classes, int),
        masks=masks,
        keypoints=np.array([keypoints_of(c, side) for c in corners]).reshape(n, 5, 2) + np.array(shift),
        visibility=np.full((n, 5), visibility),
        ripeness=np.full(n, 0.8),
    )


class ToldDetector:
    """Says for each image, by its number, what it was told."""

    name = "told"

    def __init__(self, answers: dict[int, Strawberries]) -> None:
        self.answers = answers

    def detect(self, frame: Frame) -> Strawberries:
        return self.answers.get(int(frame.name), Strawberries.empty(SIZE))
