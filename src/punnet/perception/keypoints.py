"""The five key-points of a blob with their visibility: geometry, and depth where there is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.perception.axis import BerryAxis, berry_axis, find_stem, fruit_keypoints
from punnet.perception.blobs import Blob
from punnet.scene import KEYPOINTS, Visibility

__all__ = ["KeypointConfig", "View", "locate_keypoints"]

Vector = NDArray[np.float64]
STEM_WEIGHT = 2.0


@dataclass(frozen=True, slots=True)
class KeypointConfig:
    """Where the picking point lies.

    Parameters
    ----------
    picking_height
        Metres above the calyx, used with depth and intrinsics. The picker cuts 5–30 mm above it.
    picking_share
        The same as a share of the berry's length, used without: 15 mm over a usual length of 42 mm.
    stem_reach
        How far to either side of the axis the stem is looked for, as a share of the berry's width.
    occlusion_step
        Metres by which something must be nearer than the berry to hide a key-point.

    Raises
    ------
    ConfigurationError
        If a value is not positive.
    """

    picking_height: float = 0.015
    picking_share: float = 0.36
    stem_reach: float = 0.4
    occlusion_step: float = 0.02

    def __post_init__(self) -> None:
        for name in ("picking_height", "picking_share", "stem_reach", "occlusion_step"):
            if not getattr(self, name) > 0:
                raise ConfigurationError(f"key-points: {name} must be positive, got {getattr(self, name)}")


@dataclass(frozen=True, slots=True)
class View:
    """What surrounds a blob, all at working size.

    Parameters
    ----------
    leaf
        (H, W) uint8 0/1, green pixels.
    labels
        (H, W) int32, the regions.
    depth
        (H, W) metres or None.
    focal
        Focal length in pixels or None.
    gravity_up
        (2,) unit vector away from the ground.
    """

    leaf: NDArray[np.uint8]
    labels: NDArray[np.int32]
    depth: NDArray[np.float32] | None
    focal: float | None
    gravity_up: Vector


def locate_keypoints(blob: Blob, view: View, config: KeypointConfig) -> tuple[Vector, NDArray[np.int64]]:
    """Key-points (5, 2) in working-size pixels of the whole image, NaN where absent, and visibility (5,)."""
    margin = max(4, round(0.4 * np.sqrt(blob.area)))
    mask, leaf, origin = _surroundings(blob, view, margin)
    axis = berry_axis(mask, leaf, view.gravity_up)
    fruit = fruit_keypoints(mask, axis) + origin
    picking, on_stem = _picking_point(blob, view, config, axis, fruit)
    if on_stem and np.linalg.norm(picking - fruit[1]) > 1.0:
        # The stem hangs on the middle of the calyx, opposite the tip: it tells the axis better than the
        # outline.
        towards_stem = _unit(picking - (axis.centre + origin))
        axis = BerryAxis(axis.centre, _unit(axis.up + STEM_WEIGHT * towards_stem), axis.calyx_evidence)
        fruit = fruit_keypoints(mask, axis) + origin
    points = np.concatenate((picking[None], fruit))
    return _with_visibility(points, on_stem, blob, view, config)


def _surroundings(blob: Blob, view: View, margin: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8], Vector]:
    rows, columns = blob.window
    mask = np.pad(blob.mask, margin)
    leaf = np.zeros_like(mask)
    top, left = rows.start - margin, columns.start - margin
    v0, u0 = max(top, 0), max(left, 0)
    v1, u1 = min(rows.stop + margin, view.leaf.shape[0]), min(columns.stop + margin, view.leaf.shape[1])
    leaf[v0 - top : v1 - top, u0 - left : u1 - left] = view.leaf[v0:v1, u0:u1]
    return mask, leaf, np.array([left, top], dtype=np.float64)


def _picking_point(
    blob: Blob, view: View, config: KeypointConfig, axis: BerryAxis, fruit: Vector
) -> tuple[Vector, bool]:
    top, bottom, left, right = fruit
    length = float(np.linalg.norm(top - bottom)) + 1.0
    width = float(np.linalg.norm(left - right)) + 1.0
    height = config.picking_share * length
    if view.focal is not None and np.isfinite(blob.depth):
        height = config.picking_height * view.focal / blob.depth
    # Above the calyx the stem bends from the berry's axis towards the vertical it hangs by.
    direction = axis.up + view.gravity_up
    expected = top + height * _unit(direction)
    stem = find_stem(
        view.leaf, top, expected, reach=config.stem_reach * width, thickness=max(3.0, 0.3 * width)
    )
    return (expected, False) if stem is None else (stem, True)


def _unit(vector: Vector) -> Vector:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9), dtype=np.float64)


def _with_visibility(
    points: Vector, on_stem: bool, blob: Blob, view: View, config: KeypointConfig
) -> tuple[Vector, NDArray[np.int64]]:
    codes = np.full(len(KEYPOINTS), int(Visibility.VISIBLE), dtype=np.int64)
    own = view.labels[blob.window][blob.mask > 0][0]
    height, width = view.labels.shape
    for k, (u, v) in enumerate(np.rint(points).astype(np.int64)):
        if not (0 <= u < width and 0 <= v < height):
            points[k] = np.nan
            codes[k] = Visibility.ABSENT
        elif (
            (k == 0 and not on_stem) or view.labels[v, u] not in (0, own) or _hidden(view, blob, u, v, config)
        ):
            codes[k] = Visibility.HIDDEN_BY_OTHER
    return points, codes


def _hidden(view: View, blob: Blob, u: int, v: int, config: KeypointConfig) -> bool:
    """Whether something stands in front of the berry at a pixel."""
    if view.depth is None or not np.isfinite(blob.depth):
        return False
    reading = float(view.depth[v, u])
    return 0 < reading < blob.depth - config.occlusion_step
