"""Drawn scenes with known answers: what the detector must say about them follows from how they were drawn."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

GRAVEL = (190, 182, 172)
LEAF = (45, 95, 40)
STEM = (95, 140, 60)
RIPE = (185, 25, 30)
TURNING = (225, 150, 95)
PALE = (205, 210, 130)

Image = NDArray[np.uint8]


def gravel(height: int = 480, width: int = 640, seed: int = 0) -> Image:
    """Grey-pink ground with noise, as it lies under table-top rows."""
    noise = np.random.default_rng(seed).normal(0.0, 6.0, (height, width, 1))
    return np.clip(np.array(GRAVEL) + noise, 0, 255).astype(np.uint8)


def hang_berry(
    image: Image,
    centre: tuple[int, int],
    *,
    length: int = 60,
    width: int = 48,
    colour: tuple[int, int, int] = RIPE,
    tilt_deg: float = 0.0,
) -> NDArray[np.bool_]:
    """Draw stem, conic fruit and calyx; return the fruit's mask. ``tilt_deg`` turns the tip to the right."""
    around = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    # A drop: round shoulders above, narrowing to the tip below.
    along = np.cos(around)
    across = np.sin(around) * (0.5 + 0.2 * along) / 0.53
    turn = np.radians(tilt_deg)
    up = np.array([-np.sin(turn), -np.cos(turn)])
    left = np.array([up[1], -up[0]])
    outline = np.array(centre) + np.outer(along * length / 2, up) + np.outer(across * width / 2, left)
    fruit = np.zeros(image.shape[:2], np.uint8)
    cv2.fillPoly(fruit, [np.rint(outline).astype(np.int32)], 1)
    top = np.array(centre) + up * length / 2
    cv2.line(image, _pixel(top), _pixel(top + np.array([0.0, -1.2 * length])), STEM, 3)
    image[fruit > 0] = colour
    for angle in (-60, -20, 20, 60):
        lean = np.radians(angle) + turn
        sepal = top + 0.22 * width * np.array([-np.sin(lean), -np.cos(lean)])
        cv2.line(image, _pixel(top - 2 * up), _pixel(sepal), LEAF, 4)
    return (fruit > 0) & (image == np.array(colour)).all(axis=2)


def iou(one: NDArray[np.bool_], two: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((one & two).sum() / (one | two).sum())


def _pixel(point: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
