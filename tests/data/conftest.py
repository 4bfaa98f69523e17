"""A labelled set on disk without any fault: two photographs, four berries, one of them crowd."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.scene.masks import encode_mask

HEIGHT, WIDTH = 60, 80


def clean_coco() -> dict[str, Any]:
    """A COCO object in Punnet's dialect: polygons and run lengths, with and without key-points."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[20:40, 30:50] = True
    keypoints = [40.0, 10.0, 1, 40.0, 20.0, 2, 40.0, 39.0, 2, 30.0, 30.0, 1, 49.0, 30.0, 2]
    return {
        "info": {"description": "drawn"},
        "images": [
            {"id": 1, "file_name": "a.png", "width": WIDTH, "height": HEIGHT, "group": "one"},
            {"id": 2, "file_name": "b.png", "width": WIDTH, "height": HEIGHT, "group": "two"},
        ],
        "annotations": [
            {
                "id": 1,
                "image_id": 1,
                "category_id": 1,
                "bbox": [30.0, 10.0, 20.0, 30.0],
                "area": 400,
                "iscrowd": 0,
                "segmentation": encode_mask(mask),
                "keypoints": keypoints,
                "num_keypoints": 5,
                "visibility_detail": [3, 2, 2, 1, 2],
                "ripeness": 1.0,
                "stage": "ripe",
                "occlusion": 0.1,
                "weight_g": 18.5,
            },
            {
                "id": 2,
                "image_id": 1,
                "category_id": 2,
                "bbox": [5.0, 5.0, 10.0, 10.0],
                "area": 100,
                "iscrowd": 0,
                "segmentation": [[5.0, 5.0, 15.0, 5.0, 15.0, 15.0, 5.0, 15.0]],
            },
            {
                "id": 3,
                "image_id": 2,
                "category_id": 2,
                "bbox": [1.0, 2.0, 20.0, 30.0],
                "area": 600,
                "iscrowd": 0,
            },
            {
                "id": 4,
                "image_id": 2,
                "category_id": 2,
                "bbox": [60.0, 2.0, 4.0, 4.0],
                "area": 16,
                "iscrowd": 1,
            },
        ],
        "categories": [{"id": 1, "name": "pluckable"}, {"id": 2, "name": "unpluckable"}],
    }


@pytest.fixture
def coco() -> dict[str, Any]:
    """The object; a test may damage it."""
    return clean_coco()


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    """A folder with ``a.png`` and ``b.png``."""
    folder = tmp_path / "set"
    folder.mkdir()
    for name, level in (("a.png", 90), ("b.png", 150)):
        cv2.imwrite(str(folder / name), np.full((HEIGHT, WIDTH, 3), level, np.uint8))
    return folder


@pytest.fixture
def coco_file(photographs: Path) -> Callable[[dict[str, Any]], Path]:
    """Write an object as ``annotations.json`` beside the photographs."""

    def write(data: dict[str, Any]) -> Path:
        path = photographs / "annotations.json"
        path.write_text(json.dumps(data))
        return path

    return write
