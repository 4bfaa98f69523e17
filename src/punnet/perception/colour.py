"""The classical line of thesis 3.1.1: colour threshold, morphology, watershed, geometric key-points.

It needs no training and no model file. It is the number to beat (docs/perception-baseline.md) and what the
harvest loop uses until a learned detector is given.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.perception.blobs import Blob, BlobConfig, describe_blobs, plausible, score
from punnet.perception.keypoints import KeypointConfig, View, locate_keypoints
from punnet.perception.regions import RegionConfig, berry_regions
from punnet.perception.segmentation import ColourThresholds, berry_pixels, lab_planes
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Frame, Strawberries

__all__ = ["ColourConfig", "ColourDetector"]

_LOG = logging.getLogger(__name__)
SMALLEST_SIDE = 16


@dataclass(frozen=True, slots=True)
class ColourConfig:
    """Settings of :class:`ColourDetector`.

    Parameters
    ----------
    thresholds, regions, blobs, keypoints
        Settings of the steps: colour, splitting and joining, plausibility, key-points.
    working_pixels
        Larger images are reduced to about this many pixels; masks come back at full size.
    ripe
        Ripeness from which a berry is pluckable. The default is that of people who label photographs (fitted to
        ``psd/dc_train``), and lies in the gap between the simulator's turning and ripe berries.
    score
        Detections below this score are dropped.
    most_berries
        At most this many berries are returned, those of highest score.
    mask_bytes
        Bound on N·H·W of the returned masks: of huge images the best berries that fit are kept, and the log
        says so.

    Raises
    ------
    ConfigurationError
        If a value is out of its range.
    """

    thresholds: ColourThresholds = field(default_factory=ColourThresholds)
    regions: RegionConfig = field(default_factory=RegionConfig)
    blobs: BlobConfig = field(default_factory=BlobConfig)
    keypoints: KeypointConfig = field(default_factory=KeypointConfig)
    working_pixels: int = 600_000
    ripe: float = 0.65
    score: float = 0.2
    most_berries: int = 100
    mask_bytes: int = 4_000_000_000

    def __post_init__(self) -> None:
        if self.working_pixels < 10_000 or self.most_berries < 1 or self.mask_bytes < 1:
            raise ConfigurationError(
                "colour detector: working_pixels ≥ 10000, most_berries ≥ 1 and mask_bytes ≥ 1 are needed, "
                f"got {self.working_pixels}, {self.most_berries}, {self.mask_bytes}"
            )
        if not (0 < self.ripe < 1 and 0 <= self.score < 1):
            raise ConfigurationError(
                f"colour detector: ripe must lie in (0, 1) and score in [0, 1), got {self.ripe}, {self.score}"
            )


class ColourDetector:
    """Finds berries by colour and shape.

    Ripe berries are found reliably; green ones only as far as their flesh is lighter and yellower than
    leaves.

    Parameters
    ----------
    config
        Settings; the defaults suit farm photographs and the simulator.
    """

    name = "colour"

    def __init__(self, config: ColourConfig | None = None) -> None:
        self.config = ColourConfig() if config is None else config

    def detect(self, frame: Frame) -> Strawberries:
        """Berries of ``frame``, best first, with masks, five key-points, class and ripeness.

        With ``frame.depth`` berries farther than ``config.blobs.farthest`` are dropped and touching ones
        parted where depth jumps; with ``frame.camera`` too, implausible diameters are dropped and the picking
        point lies a metric height above the calyx.
        """
        size = (frame.height, frame.width)
        if min(size) < SMALLEST_SIDE:
            return Strawberries.empty(size)
        scale = min(1.0, float(np.sqrt(self.config.working_pixels / (frame.height * frame.width))))
        rgb, depth = _reduce(frame, scale)
        lab = lab_planes(rgb)
        pixels = berry_pixels(lab, self.config.thresholds)
        labels = berry_regions(pixels, self.config.regions, depth)
        focal = None if frame.camera is None else frame.camera.fy * scale
        blobs = [
            (score(blob), blob)
            for blob in describe_blobs(labels, lab, depth, focal)
            if plausible(blob, self.config.blobs)
        ]
        blobs = self._best(blobs, size)
        if not blobs:
            return Strawberries.empty(size)
        view = View(leaf=pixels.leaf, labels=labels, depth=depth, focal=focal, gravity_up=gravity_up(frame))
        return self._assemble(frame, view, blobs)

    def _best(self, blobs: list[tuple[float, Blob]], size: tuple[int, int]) -> list[tuple[float, Blob]]:
        kept = sorted((pair for pair in blobs if pair[0] >= self.config.score), key=lambda pair: -pair[0])
        kept = kept[: self.config.most_berries]
        fitting = max(1, self.config.mask_bytes // (size[0] * size[1]))
        if len(kept) > fitting:
            _LOG.warning(
                "image of %d×%d: kept the masks of %d of %d berries; give a smaller image",
                *size[::-1],
                fitting,
                len(kept),
            )
        return kept[:fitting]

    def _assemble(self, frame: Frame, view: View, blobs: list[tuple[float, Blob]]) -> Strawberries:
        count, size = len(blobs), (frame.height, frame.width)
        # Zero pages that nobody writes cost no memory: only the berries' own windows are touched.
        masks = np.zeros((count, *size), dtype=np.bool_)
        keypoints = np.full((count, 5, 2), np.nan)
        visibility = np.zeros((count, 5), dtype=np.int64)
        boxes = np.zeros((count, 4))
        for i, (_, blob) in enumerate(blobs):
            mask_box = _paint(masks[i], blob, view.labels.shape)
            points, visibility[i] = locate_keypoints(blob, view, self.config.keypoints)
            keypoints[i] = to_full_size(points, view.labels.shape, size)
            boxes[i] = box_around(mask_box, keypoints[i], size)
        ripeness = np.array([blob.ripeness for _, blob in blobs])
        return Strawberries(
            image_size=size,
            boxes=boxes,
            scores=np.array([value for value, _ in blobs]),
            classes=np.where(ripeness >= self.config.ripe, PLUCKABLE, UNPLUCKABLE),
            masks=masks,
            keypoints=keypoints,
            visibility=visibility,
            ripeness=ripeness,
        )


def gravity_up(frame: Frame) -> NDArray[np.float64]:
    """(2,) unit vector in the image against gravity: from the camera's pose if known, else up."""
    upward = np.array([0.0, -1.0])
    if frame.T_base_camera is None:
        return upward
    # Row 3 of the rotation is the base's z axis in camera coordinates.
    seen = frame.T_base_camera[2, :2]
    length = float(np.linalg.norm(seen))
    # A camera that looks straight down sees no vertical.
    return upward if length < 0.2 else np.asarray(seen / length, dtype=np.float64)


def _reduce(frame: Frame, scale: float) -> tuple[NDArray[np.uint8], NDArray[np.float32] | None]:
    if scale >= 1.0:
        return frame.rgb, frame.depth
    size = (max(SMALLEST_SIDE, round(frame.width * scale)), max(SMALLEST_SIDE, round(frame.height * scale)))
    rgb = cv2.resize(frame.rgb, size, interpolation=cv2.INTER_AREA)
    # Depth is picked, not averaged: a mean across an edge is a place where nothing is.
    depth = None if frame.depth is None else cv2.resize(frame.depth, size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(rgb, dtype=np.uint8), None if depth is None else np.asarray(depth, dtype=np.float32)


def to_full_size(
    points: NDArray[np.float64], working: tuple[int, ...], size: tuple[int, int]
) -> NDArray[np.float64]:
    """Pixel centres (..., 2) of a working image (H, W) to those of the full image."""
    factor = np.array([size[1] / working[1], size[0] / working[0]])
    return np.asarray((points + 0.5) * factor - 0.5, dtype=np.float64)


def _paint(mask: NDArray[np.bool_], blob: Blob, working: tuple[int, ...]) -> NDArray[np.float64]:
    """Draw a blob's mask into the full-size ``mask``; return its box xyxy, far edges exclusive."""
    rows, columns = blob.window
    height, width = mask.shape
    v0, v1 = (round(edge * height / working[0]) for edge in (rows.start, rows.stop))
    u0, u1 = (round(edge * width / working[1]) for edge in (columns.start, columns.stop))
    v1, u1 = max(v1, v0 + 1), max(u1, u0 + 1)
    enlarged = cv2.resize(blob.mask * np.uint8(255), (u1 - u0, v1 - v0), interpolation=cv2.INTER_LINEAR)
    mask[v0:v1, u0:u1] = np.asarray(enlarged) > 127
    return np.array([u0, v0, u1, v1], dtype=np.float64)


def box_around(
    box: NDArray[np.float64], keypoints: NDArray[np.float64], size: tuple[int, int]
) -> NDArray[np.float64]:
    """Enlarge ``box`` (4,) xyxy to contain ``keypoints`` (5, 2), within the image (DESIGN.md section 4)."""
    known = keypoints[np.isfinite(keypoints).all(axis=1)]
    low = np.minimum(box[:2], known.min(axis=0)) if len(known) else box[:2]
    high = np.maximum(box[2:], known.max(axis=0)) if len(known) else box[2:]
    limit = np.array([size[1], size[0]], dtype=np.float64)
    return np.concatenate((np.clip(low, 0, limit), np.clip(high, 0, limit)))
