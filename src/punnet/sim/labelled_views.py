"""Three photographs of a plant, as Dataset-1 of the thesis has them, with their labels in the COCO dialect.

From afar the whole cluster is seen, from the middle a part of it, and near by one berry that the camera aims at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import make_transform, rotation_from_vector
from punnet.scene import Visibility
from punnet.sim.camera_effects import apply_effects, draw_effects, draw_night_effects
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.rendering import CameraRenderer
from punnet.sim.still_scene import PHOTO_CAMERA, PHOTO_INTRINSICS, StillScene
from punnet.sim.truth import (
    LEAST_PIXELS,
    keypoint_boxes,
    shown_berries,
    silhouette,
    true_keypoints,
)

__all__ = ["VIEWS", "LabelledView", "draw_pose", "label_berries", "photograph"]

VIEWS = {"far": (0.45, 0.65), "middle": (0.33, 0.45), "near": (0.20, 0.32)}
"""Metres from the camera to what it aims at."""

LEAST_COUNTED_PIXELS = 100
LEAST_COUNTED_SHARE = 0.2
"""A berry of which fewer pixels, or a smaller share of its outline, show is marked as crowd: neither wanted nor wrong."""

_AZIMUTH, _ELEVATION, _ROLL = np.radians(35.0), (np.radians(-25.0), np.radians(30.0)), np.radians(10.0)
_NEAREST, _MOST_NEAR = 0.14, 0.2  # metres; share of the image
_ATTEMPTS = 5
_PIXEL_DECIMALS = 2


@dataclass(frozen=True, eq=False)
class LabelledView:
    """A photograph with its labels.

    Parameters
    ----------
    view
        One of :data:`VIEWS`.
    rgb, depth
        uint8 (H, W, 3), and float32 (H, W) metres with the depth camera's errors.
    T_base_camera
        (4, 4).
    annotations
        One object a berry, in the COCO dialect, without ``id`` and ``image_id``.
    """

    view: str
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    T_base_camera: NDArray[np.float64]
    annotations: list[dict[str, Any]]


def photograph(
    scene: StillScene, renderer: CameraRenderer, rng: np.random.Generator
) -> Iterator[LabelledView]:
    """Take the three views of ``scene``; poses, light in the camera and noise are drawn from ``rng``."""
    sensor = StereoDepthModel()
    draw = draw_night_effects if scene.light == "lamp" else draw_effects
    for view in VIEWS:
        T, depth, segmentation = _aim(scene, renderer, rng, view)
        rgb = apply_effects(renderer.render_rgb(scene.data, PHOTO_CAMERA), draw(rng), rng)
        measured = sensor.apply(depth, rgb, rng)
        yield LabelledView(view, rgb, measured, T, label_berries(scene, T, segmentation))


def _aim(
    scene: StillScene, renderer: CameraRenderer, rng: np.random.Generator, view: str
) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.int32]]:
    """A pose from which something can be seen, with depth and geometry ids; the last one tried if none is good."""
    for _ in range(_ATTEMPTS):
        target = scene.targets[rng.integers(len(scene.targets))]
        T = draw_pose(scene, rng, view, target)
        scene.place_camera(T)
        depth, segmentation = renderer.render_geometry(scene.data, PHOTO_CAMERA)
        covered = ((depth > 0) & (depth < _NEAREST)).mean()
        shown = shown_berries(scene, segmentation)
        seen = (shown == target).sum() if view == "near" else (shown >= 0).sum()
        if covered < _MOST_NEAR and seen >= LEAST_COUNTED_PIXELS * (8 if view == "near" else 2):
            break
    return T, depth, segmentation


def draw_pose(scene: StillScene, rng: np.random.Generator, view: str, target: int) -> NDArray[np.float64]:
    """``T_base_camera`` on the robot's side of the plant."""
    centres = np.array([berry.centre for berry in scene.cluster.berries])
    middle = (centres.min(axis=0) + centres.max(axis=0)) / 2.0
    aim = {"far": middle, "middle": (middle + centres[target]) / 2.0, "near": centres[target]}[view]
    distance = rng.uniform(*VIEWS[view])
    aim = aim + rng.normal(0.0, 0.07 * distance, 3)
    azimuth, elevation = rng.uniform(-_AZIMUTH, _AZIMUTH), rng.uniform(*_ELEVATION)
    back = np.array(
        (-np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation))
    )
    right = np.cross(-back, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    upright = np.stack((right, np.cross(-back, right), -back), axis=1)
    roll = rotation_from_vector((0.0, 0.0, rng.uniform(-_ROLL, _ROLL)))
    return make_transform(upright @ roll, aim + distance * back)


def label_berries(
    scene: StillScene, T_base_camera: NDArray[np.float64], segmentation: NDArray[np.int32]
) -> list[dict[str, Any]]:
    """Label every berry of which at least 30 pixels show, in the COCO dialect.

    ``occlusion`` is the share of the fruit's outline inside the image that things other than the berry itself cover.
    A berry is marked as crowd (``iscrowd`` 1) if fewer than 100 of its pixels or less than 20% of its outline show.
    """
    shown = shown_berries(scene, segmentation)
    counts = np.bincount(shown[shown >= 0].ravel(), minlength=scene.berries)
    chosen = np.flatnonzero(counts >= LEAST_PIXELS)
    if not len(chosen):
        return []
    masks = np.stack([shown == index for index in chosen])
    keypoints = true_keypoints(scene, PHOTO_INTRINSICS, T_base_camera, chosen)
    boxes = keypoint_boxes(masks, keypoints.pixels)
    bodies = np.append(scene.model.geom_bodyid, -1)[segmentation]
    annotations = []
    for row, index in enumerate(chosen):
        hanging, mask = scene.cluster.berries[index], masks[row]
        outline = silhouette(scene, int(index), PHOTO_INTRINSICS, T_base_camera) | mask
        own = bodies == scene.model.body(scene.planted[index].body).id
        showing = float((outline & own).sum() / outline.sum())
        crowd = counts[index] < LEAST_COUNTED_PIXELS or showing < LEAST_COUNTED_SHARE
        annotations.append(
            {
                "category_id": 1 if hanging.berry.stage.pluckable else 2,
                **_box_and_mask(boxes[row], mask),
                "iscrowd": int(crowd),
                **_keypoint_fields(keypoints.pixels[row], keypoints.depths[row], keypoints.visibility[row]),
                "ripeness": round(hanging.berry.ripeness, 4),
                "stage": hanging.berry.stage.name.lower(),
                "occlusion": round(1.0 - showing, 4),
                "weight_g": round(hanging.berry.mass, 3),
                "berry_id": int(index),
            }
        )
    return annotations


def _box_and_mask(box: NDArray[np.float64], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """``bbox`` (xywh), ``area`` and ``segmentation`` (compressed run lengths)."""
    from faster_coco_eval.core import mask as rasteriser

    left, top, right, bottom = (round(float(value), _PIXEL_DECIMALS) for value in box)
    encoded = rasteriser.encode(np.asfortranarray(mask, dtype=np.uint8))
    return {
        "bbox": [left, top, round(right - left, _PIXEL_DECIMALS), round(bottom - top, _PIXEL_DECIMALS)],
        "area": int(mask.sum()),
        "segmentation": {"size": list(mask.shape), "counts": encoded["counts"].decode("ascii")},
    }


def _keypoint_fields(
    pixels: NDArray[np.float64], depths: NDArray[np.float64], codes: NDArray[np.int64]
) -> dict[str, Any]:
    """COCO's triples (which know no third kind of visibility), the full codes, and depths."""
    flags = np.where(codes == Visibility.HIDDEN_BY_OTHER, int(Visibility.HIDDEN_BY_ITSELF), codes)
    triples: list[float | int] = []
    for (u, v), flag in zip(pixels, flags, strict=True):
        here = flag != Visibility.ABSENT
        triples += [round(float(u), _PIXEL_DECIMALS), round(float(v), _PIXEL_DECIMALS)] if here else [0, 0]
        triples.append(int(flag))
    return {
        "keypoints": triples,
        "num_keypoints": int((flags > 0).sum()),
        "visibility_detail": codes.tolist(),
        "keypoint_depths_m": [round(float(d), 5) if np.isfinite(d) else None for d in depths],
    }
