"""One affine map that moves image, masks, key-points and boxes together, and changes of light that move none."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.scene import KEYPOINTS, Visibility
from punnet.scene.windows import berry_box, mask_box

__all__ = ["Labels", "change_light", "random_view", "view"]

MIRRORED = [KEYPOINTS.index(n) for n in ("picking_point", "top", "bottom", "right_grasp", "left_grasp")]
LEAST_SHARE = 0.25  # of a berry's mask (or box) that must stay in the crop for it to count
LEAST_AREA = 40.0  # pixels
HALF = 0.5  # a box ends at the edges of its pixels, half a pixel from their centres

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Labels:
    """The annotations of an image as arrays; partial ones are marked.

    Parameters
    ----------
    boxes
        (N, 4) xyxy.
    classes
        (N,) 0 pluckable, 1 unpluckable.
    masks
        (N, H, W) uint8, zeros where there is none.
    has_mask
        (N,) bool.
    keypoints
        (N, 5, 2) pixels, NaN where absent or not annotated.
    allowed
        (N, 5, 4) bool, the visibility codes that the annotation allows.
    ripeness
        (N,) in 0…1 or NaN.
    ignored
        (K, 4) boxes of berries that are not counted.
    """

    boxes: NDArray[np.float64]
    classes: NDArray[np.int64]
    masks: NDArray[np.uint8]
    has_mask: NDArray[np.bool_]
    keypoints: NDArray[np.float64]
    allowed: NDArray[np.bool_]
    ripeness: NDArray[np.float64]
    ignored: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.boxes)


def random_view(
    rng: np.random.Generator, image: Image, labels: Labels, crop: tuple[int, int], scale: tuple[float, float]
) -> tuple[Image, Labels]:
    """A crop around a random berry (or place), resized, turned a little, mirrored half of the time."""
    height, width = image.shape[:2]
    factor = float(np.exp(rng.uniform(*np.log(scale))))
    angle = float(rng.normal(0.0, 6.0))
    flip = bool(rng.random() < 0.5)
    if len(labels) and rng.random() < 0.85:
        box = labels.boxes[rng.integers(len(labels))]
        centre = (box[:2] + box[2:]) / 2
        shift = rng.uniform(-0.35, 0.35, 2) * np.array([crop[1], crop[0]]) / factor
    else:
        centre, shift = rng.uniform((0, 0), (width, height)), np.zeros(2)
    half = np.array([crop[1], crop[0]]) / factor / 2
    low, high = half, np.array([width, height]) - half
    middle = np.where(low <= high, np.clip(centre + shift, low, np.maximum(high, low)), (low + high) / 2)
    return view(image, labels, crop, middle, factor=factor, angle=angle, mirrored=flip)


def view(
    image: Image,
    labels: Labels,
    crop: tuple[int, int],
    centre: NDArray[np.float64],
    *,
    factor: float = 1.0,
    angle: float = 0.0,
    mirrored: bool = False,
) -> tuple[Image, Labels]:
    """What a camera turned by ``angle`` degrees about ``centre`` sees, ``factor`` times as large, mirrored or not.

    Key-points move with the image, left and right grasp points change places in a mirror; key-points that leave the
    crop become absent; berries of which less than a quarter stays are ignored from then on.
    """
    height, width = crop
    turning = cv2.getRotationMatrix2D((float(centre[0]), float(centre[1])), angle, factor)
    A: NDArray[np.float64] = np.asarray(turning, dtype=np.float64)
    A[:, 2] += np.array([width, height]) / 2 - centre
    if mirrored:
        A = np.array([[-1.0, 0.0, width - 1.0], [0.0, 1.0, 0.0]]) @ np.vstack((A, (0.0, 0.0, 1.0)))
    shrinking = cv2.INTER_AREA if factor < 0.6 else cv2.INTER_LINEAR
    seen = cv2.warpAffine(image, A, (width, height), flags=shrinking, borderMode=cv2.BORDER_REFLECT_101)
    return np.asarray(seen, dtype=np.uint8), _moved(labels, A, (height, width), mirrored=mirrored)


def _moved(labels: Labels, A: NDArray[np.float64], size: tuple[int, int], *, mirrored: bool) -> Labels:
    height, width = size
    keypoints, allowed = _moved_keypoints(labels, A, size, mirrored=mirrored)
    masks = np.zeros((len(labels), height, width), dtype=np.uint8)
    boxes = _moved_boxes(labels.boxes - HALF, A) + HALF
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    clipped = _clip(boxes, size)
    share = np.prod(np.maximum(clipped[:, 2:] - clipped[:, :2], 0), axis=1) / np.maximum(areas, 1e-9)
    area = np.prod(clipped[:, 2:] - clipped[:, :2], axis=1)
    stretch = abs(float(np.linalg.det(A[:, :2])))
    for i in np.flatnonzero(labels.has_mask & (share > 0)):
        masks[i] = _moved_mask(labels.masks[i], A, size)
        area[i] = float(masks[i].sum())
        share[i] = area[i] / max(stretch * float(labels.masks[i].sum()), 1e-9)
        held = berry_box(masks[i], keypoints[i])
        clipped[i] = clipped[i] if held is None else held
    kept = (share >= LEAST_SHARE) & (area >= LEAST_AREA)
    some = (share > 0) & ~kept
    ignored = _clip(_moved_boxes(labels.ignored - HALF, A) + HALF, size)
    ignored = ignored[np.prod(np.maximum(ignored[:, 2:] - ignored[:, :2], 0), axis=1) > 0]
    return Labels(
        boxes=clipped[kept],
        classes=labels.classes[kept],
        masks=masks[kept],
        has_mask=labels.has_mask[kept],
        keypoints=keypoints[kept],
        allowed=allowed[kept],
        ripeness=labels.ripeness[kept],
        ignored=np.concatenate((ignored, clipped[some])),
    )


def _moved_keypoints(
    labels: Labels, A: NDArray[np.float64], size: tuple[int, int], *, mirrored: bool
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    points = labels.keypoints @ A[:, :2].T + A[:, 2]
    allowed = labels.allowed.copy()
    known = np.isfinite(points).all(axis=2)
    with np.errstate(invalid="ignore"):
        outside = known & ~((points >= 0) & (points < (size[1], size[0]))).all(axis=2)
    points[outside] = np.nan
    allowed[outside] = np.arange(len(Visibility)) == Visibility.ABSENT
    if mirrored:
        points, allowed = points[:, MIRRORED], allowed[:, MIRRORED]
    return points, allowed


def _moved_boxes(boxes: NDArray[np.float64], A: NDArray[np.float64]) -> NDArray[np.float64]:
    """Boxes around the moved corners, in the coordinates of pixel centres, which ``A`` is for."""
    corners = boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2) @ A[:, :2].T + A[:, 2]
    return np.concatenate((corners.min(axis=1), corners.max(axis=1)), axis=1)


def _clip(boxes: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    return np.clip(boxes, 0.0, (size[1], size[0], size[1], size[0]))


def _moved_mask(mask: NDArray[np.uint8], A: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.uint8]:
    """A mask, warped; only its surroundings are touched, since most of an image is not berry."""
    moved = np.zeros(size, dtype=np.uint8)
    left, top, right, bottom = mask_box(mask)
    if left == right:
        return moved
    piece = np.pad(mask[top:bottom, left:right] * np.uint8(255), 1)
    target = _moved_boxes(np.array([[left - 1.0, top - 1.0, right + 1.0, bottom + 1.0]]), A)[0]
    x0, y0 = np.maximum(np.floor(target[:2]), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(target[2:]) + 1, (size[1], size[0])).astype(int)
    if x1 <= x0 or y1 <= y0:
        return moved
    B = A.copy()
    B[:, 2] += A[:, :2] @ np.array([left - 1.0, top - 1.0]) - (x0, y0)
    moved[y0:y1, x0:x1] = cv2.warpAffine(piece, B, (int(x1 - x0), int(y1 - y0)), flags=cv2.INTER_LINEAR) > 127
    return moved


def change_light(rng: np.random.Generator, image: Image, strength: float = 1.0) -> Image:
    """Exposure, contrast, saturation, colour temperature, a little blur, noise and JPEG; hue hardly: it is ripeness.

    Parameters
    ----------
    rng
        Draws the changes.
    image
        (H, W, 3) RGB.
    strength
        Factor of the spreads of exposure, contrast, saturation and temperature. At 1 the exposure varies by a fifth
        or so, as one camera's does; at 2 by a half, as between cameras and farms.
    """
    values = image.astype(np.float32)
    gains = float(np.exp(rng.normal(0.0, 0.18 * strength))) * np.exp(rng.normal(0.0, 0.05 * strength, 3))
    values = values * gains.astype(np.float32)
    mean = values.mean()
    values = (values - mean) * np.float32(np.exp(rng.normal(0.0, 0.15 * strength))) + mean
    grey = values.mean(axis=2, keepdims=True)
    values = (values - grey) * np.float32(np.exp(rng.normal(0.0, 0.15 * strength))) + grey
    if rng.random() < 0.3:
        values = cv2.GaussianBlur(values, (0, 0), float(rng.uniform(0.4, 1.4)))
    if rng.random() < 0.4:
        values = values + rng.normal(0.0, rng.uniform(1.0, 8.0), values.shape).astype(np.float32)
    changed = np.clip(values, 0, 255).astype(np.uint8)
    if rng.random() < 0.3:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(45, 95))]
        changed = cv2.imdecode(cv2.imencode(".jpg", changed, quality)[1], cv2.IMREAD_COLOR)
    return np.asarray(changed, dtype=np.uint8)
