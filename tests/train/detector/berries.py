"""Small drawn sets of berries, cheap enough to train on in a test, and networks to match."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.coco import write_coco
from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.scene import Visibility
from punnet.train.detector.config import SLIM, Backbone, DetectorConfig, DetectorTraining

SIZE = (96, 128)
LEAF = (45, 95, 40)
STEM = (95, 140, 60)
COLOURS = ((190, 25, 30), (200, 210, 130))  # of pluckable and unpluckable
STAGES = ("ripe", "green")
VISIBLE = np.full(5, int(Visibility.VISIBLE))

SMALL: dict[str, Any] = {
    "pretrained": False,
    "channels": 8,
    "box_units": 16,
    "mask_channels": 8,
    "mask_layers": 1,
    "keypoint_channels": 8,
    "keypoint_layers": 1,
    "region_size": 8,
    "proposals_training": 20,
    "proposals": 12,
    "regions_an_image": 16,
    "detections": 6,
}


def small_config(backbone: Backbone = "efficientnet_lite0_fpn", **changes: Any) -> DetectorConfig:
    """A backbone with heads as slim as they go; refined by finer maps where they usually are."""
    finer = {"fine_channels": 4} if backbone in SLIM else {}
    return DetectorConfig.for_backbone(backbone, **{**SMALL, **finer, **changes})


def small_training(**changes: Any) -> DetectorTraining:
    """Four steps of one piece of an image, a checkpoint after two."""
    settings: dict[str, Any] = {
        "steps": 4,
        "batch": 1,
        "crop": (64, 96),
        "warm_up": 1,
        "validate_every": 2,
        "averaging": 0.5,
    }
    return DetectorTraining(**{**settings, **changes})


def draw_berry(
    image: NDArray[np.uint8], centre: tuple[int, int], radius: int, class_index: int, number: int
) -> Annotation:
    """An ellipse with a stem; its outline and key-points follow from how it was drawn."""
    u, v = centre
    rise = radius * 4 // 3
    mask = np.zeros(image.shape[:2], np.uint8)
    cv2.ellipse(mask, (u, v), (radius, rise), 0, 0, 360, 1, -1)
    cv2.line(image, (u, v - rise), (u, max(v - rise - radius, 0)), STEM, 2)
    image[mask > 0] = COLOURS[class_index]
    outline, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    points = np.array(
        [(u, max(v - rise - radius / 2, 0)), (u, v - rise), (u, v + rise), (u - radius, v), (u + radius, v)],
        dtype=np.float64,
    )
    x, y, width, height = cv2.boundingRect(mask)
    return Annotation(
        id=number,
        class_index=class_index,
        box=np.array([x, y, x + width, y + height], dtype=np.float64),
        segmentation=[outline[0].reshape(-1).astype(float).tolist()],
        keypoints=points,
        visibility=VISIBLE,
        ripeness=1.0 - class_index,
        stage=STAGES[class_index],
    )


def draw_scene(
    rng: np.random.Generator, first: int, berries: int = 2
) -> tuple[NDArray[np.uint8], list[Annotation]]:
    """Berries side by side before leaves."""
    height, width = SIZE
    noise = rng.normal(0, 12, (height, width, 3))
    image = np.clip(np.array(LEAF) + noise, 0, 255).astype(np.uint8)
    drawn = []
    for k in range(berries):
        centre = int((k + 0.5) * width / berries + rng.integers(-4, 5)), int(height / 2 + rng.integers(-4, 8))
        drawn.append(draw_berry(image, centre, int(rng.integers(10, 15)), int(rng.integers(2)), first + k))
    return image, drawn


def write_set(folder: Path, images: int = 2, berries: int = 2, seed: int = 0) -> Path:
    """A folder with photographs and ``annotations.json``."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    described = []
    for number in range(images):
        image, drawn = draw_scene(rng, first=1 + number * berries, berries=berries)
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), image[:, :, ::-1])
        described.append(AnnotatedImage(number + 1, path, SIZE[1], SIZE[0], tuple(drawn)))
    write_coco(Dataset(tuple(described), folder.name), folder / "annotations.json")
    return folder
