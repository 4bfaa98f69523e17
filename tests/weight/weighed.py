"""A data set of weighed ellipsoids on disk: photographs, depth and annotations as a camera would give them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.geometry import CameraIntrinsics
from tests.weight.scenes import ellipsoid_grams, ellipsoid_scene

SMALL = CameraIntrinsics(320, 240, 307.5, 307.5, 159.5, 119.5)


def run_lengths(mask: np.ndarray) -> dict[str, Any]:
    from faster_coco_eval.core import mask as rasteriser

    encoded = rasteriser.encode(np.asfortranarray(mask, dtype=np.uint8))
    return {"size": list(mask.shape), "counts": encoded["counts"].decode("ascii")}


def weighed_image(folder: Path, number: int, *, radius: float, group: str, **changes: Any) -> AnnotatedImage:
    """One ripe berry, ``radius`` metres thick, 0.3 m before the camera; ``changes`` to its annotation."""
    half_axes = (radius, 1.25 * radius, radius)
    frame, mask = ellipsoid_scene((0.0, 0.0, 0.3), half_axes, camera=SMALL)
    rgb, depth = folder / f"{number}.png", folder / f"{number}-depth.png"
    cv2.imwrite(str(rgb), frame.rgb[:, :, ::-1])
    assert frame.depth is not None
    cv2.imwrite(str(depth), np.rint(frame.depth * 1000.0).astype(np.uint16))
    rows, columns = np.nonzero(mask)
    annotation = Annotation(
        id=number,
        class_index=0,
        box=np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], dtype=float),
        segmentation=run_lengths(mask),
        ripeness=1.0,
        occlusion=0.0,
        weight=ellipsoid_grams(half_axes),
    )
    return AnnotatedImage(
        id=number,
        path=rgb,
        width=SMALL.width,
        height=SMALL.height,
        annotations=(replace(annotation, **changes),),
        depth_path=depth,
        camera=SMALL,
        group=group,
    )


def weighed_dataset(folder: Path, radii: list[float]) -> Dataset:
    """A berry an image, a plant a berry."""
    return Dataset(
        tuple(
            weighed_image(folder, number, radius=radius, group=f"plant-{number}")
            for number, radius in enumerate(radii, start=1)
        ),
        name="weighed",
    )
