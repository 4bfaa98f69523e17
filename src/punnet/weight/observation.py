"""What an estimator may see of one berry: crops of the frame, its points, and what was dropped on the way.

Everything that makes a weight impossible is refused here, once, for every estimator; the refusal is a sentence
that says why (:func:`observe` gives it in place of the observation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics
from punnet.scene import KEYPOINTS, Frame, Strawberries, Visibility
from punnet.scene.windows import mask_window
from punnet.weight.cloud import (
    LAYER_GAP,
    LEAST_POINTS,
    berry_points,
    depth_layer,
    median,
    relief_height,
)
from punnet.weight.completion import trace_contour
from punnet.weight.silhouette import (
    Silhouette,
    hidden_share,
    measure_silhouette,
    near_something_nearer,
    tidy_mask,
)

__all__ = ["LEAST_PIXELS", "RANGE_LIMITS", "BerryObservation", "observe"]

LEAST_PIXELS = 60
"""Fewest mask pixels of a berry that is weighed."""
RANGE_LIMITS = (0.08, 3.0)
"""Metres between which a berry's depth is believed."""

_MILLIMETRES_FROM = 50.0
_LEAST_READING_SHARE = 0.02
_FLATNESS = 0.2
"""A cloud that bulges less than this share of its outline's diameter is no berry: a picture, a leaf, a wall."""
_THINNEST = 2e-4
"""Metres: a cloud thinner than this in its thinnest direction has no hull to speak of."""
_SURROUNDINGS = 6
"""Pixels around the mask's box that are looked at for what hides the berry."""
_DEPTH_NOISE = 0.002
_MEDIAN_RANGE = math.sqrt(0.5)
_TOP, _BOTTOM = KEYPOINTS.index("top"), KEYPOINTS.index("bottom")


@dataclass(frozen=True, eq=False)
class BerryObservation:
    """What one frame shows of one berry.

    Parameters
    ----------
    camera
        Of the whole image.
    window
        Rows and columns of the image that the crops show: the box of the mask.
    rgb, depth
        Crops: uint8 (h, w, 3), and float32 (h, w) metres with 0 = no reading.
    mask
        (h, w) bool, the berry's pixels: one piece, without specks and without what lies in another layer of depth.
    cloud
        (P, 3) metres in the camera frame, outliers removed, P ≥ 20.
    box
        (4,) xyxy pixels of the whole image, around berry and key-points, hidden parts too.
    dropped
        Pixels of the given mask that gave no point, by reason: ``no reading``, ``edge``, ``other layer``, ``outlier``.
    keypoints
        (5, 2) pixels of the whole image in the order of :data:`~punnet.scene.KEYPOINTS`, NaN where absent.
    visibility
        (5,) codes of :class:`~punnet.scene.Visibility`; 0 for all without key-points.
    ripeness
        0 green … 1 ripe all over, NaN unknown.
    hidden
        Share of the outline, 0 … 1, at which something nearer begins, as the depth tells (its own calyx: .1 to .2).
    contour, covered
        (K, 2) pixels of the whole image along the outline of the mask, and whether the berry goes on behind each, (K,).
    score
        How sure the detector is, 0 … 1; 1 for a berry that a person, or the simulator, has annotated.
    """

    camera: CameraIntrinsics
    window: tuple[slice, slice]
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    mask: NDArray[np.bool_]
    cloud: NDArray[np.float64]
    box: NDArray[np.float64]
    dropped: dict[str, int] = field(default_factory=dict)
    keypoints: NDArray[np.float64] = field(default_factory=lambda: np.full((len(KEYPOINTS), 2), np.nan))
    visibility: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(KEYPOINTS), np.int64))
    ripeness: float = math.nan
    hidden: float = 0.0
    contour: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    covered: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    score: float = 1.0

    @cached_property
    def crop_camera(self) -> CameraIntrinsics:
        """The camera of the crops: the same rays, pixels counted from the window's corner."""
        return _cropped(self.camera, self.window)

    @cached_property
    def crop_keypoints(self) -> NDArray[np.float64]:
        """(5, 2) pixels counted from the window's corner."""
        return np.asarray(self.keypoints - (self.window[1].start, self.window[0].start))

    @cached_property
    def outline(self) -> Silhouette:
        """The mask's outline as if the camera looked straight at the berry, per metre of distance."""
        ends = self.crop_keypoints[[_TOP, _BOTTOM]]
        axis = ends if np.isfinite(ends).all() else None
        return measure_silhouette(self.crop_camera, self.mask, axis)

    @cached_property
    def distance(self) -> float:
        """Metres from the camera to the berry's middle, from the median range m of the cloud.

        A ball of radius R whose middle is D away is seen under the half-angle α with sin α = R / D, and half of
        what shows of it is nearer than D − R/√2: D = m / (1 − sin α / √2). The outline's area stands for R.
        """
        return median(self.ranges) / (1.0 - _MEDIAN_RANGE * self._sine)

    @cached_property
    def ranges(self) -> NDArray[np.float64]:
        """(P,) metres from the camera to the points of the cloud."""
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", self.cloud, self.cloud)))

    @cached_property
    def scale(self) -> float:
        """Metres for one unit of :attr:`outline`: its distance.

        The outline is the ball's rim as the camera sees it, nearer than the middle: R = D cos α · tan α.
        """
        return self.distance * math.sqrt(1.0 - self._sine**2)

    @cached_property
    def pixel_area(self) -> float:
        """Square metres that one pixel shows at the berry, across the line of sight to it.

        Far from the image's middle a pixel looks at the berry aslant and from farther away: less of it is in the pixel.
        """
        slant = float(self.outline.R_view_camera[2, 2])
        return self.scale**2 * slant**3 / (self.camera.fx * self.camera.fy)

    @property
    def _sine(self) -> float:
        return math.sin(math.atan(math.sqrt(self.outline.area / math.pi)))

    @cached_property
    def view(self) -> NDArray[np.float64]:
        """The cloud (P, 3) as seen straight on: x, y across the line of sight to the berry, and the range; metres."""
        turned = self.cloud @ self.outline.R_view_camera.T
        turned[:, :2] *= (self.scale / turned[:, 2])[:, None]
        turned[:, 2] = self.ranges
        return turned

    @cached_property
    def relief(self) -> float:
        """Metres by which the cloud bulges as half an ellipsoid over the outline; NaN for too few points."""
        return relief_height(self.view, self.outline.dome(self.view[:, :2] / self.scale))


class _NotWeighableError(Exception):
    """Why this berry can't be weighed; caught inside, becomes the reason."""


def observe(frame: Frame, berries: Strawberries) -> list[BerryObservation | str]:
    """What ``frame`` shows of each of ``berries``; a text is the reason why that berry can't be weighed.

    Nothing raises here: no depth or camera, depth in another unit, an empty or foreign mask, hardly a pixel or a
    reading, a cloud as flat as a picture, each gives its sentence.
    """
    observations: list[BerryObservation | str] = []
    for index in range(len(berries)):
        try:
            observations.append(_observe_one(frame, berries, index))
        except _NotWeighableError as why:
            observations.append(str(why))
    return observations


def _observe_one(frame: Frame, berries: Strawberries, index: int) -> BerryObservation:
    camera, depth, mask = _inputs(frame, berries, index)
    window = mask_window(mask, _SURROUNDINGS)
    depth, mask = np.where(np.isfinite(depth[window]), depth[window], np.float32(0.0)), mask[window]
    _check_readings(depth, mask)
    surroundings = _cropped(camera, window)
    points, dropped = berry_points(surroundings, depth, mask)
    needed = max(LEAST_POINTS, int(_LEAST_READING_SHARE * mask.sum()))
    if len(points) < needed:
        raise _NotWeighableError(f"only {len(points)} depth readings on the berry, {needed} needed")
    nearest, farthest = depth_layer(points[:, 2])
    other = (depth > 0) & ((depth < nearest - LAYER_GAP) | (depth > farthest + LAYER_GAP))
    own = tidy_mask(mask & ~other)
    if own.sum() < LEAST_PIXELS:
        raise _NotWeighableError("the mask shows hardly anything of the depth of the berry")
    before = median(points[:, 2]) - _DEPTH_NOISE
    near = near_something_nearer(depth, own, before)
    contour, covered = trace_contour(own, near)
    inner = mask_window(own, 0)
    outer = (_shifted(inner[0], window[0].start), _shifted(inner[1], window[1].start))
    keypoints, visibility = _keypoints(berries, index)
    observation = BerryObservation(
        camera=camera,
        window=outer,
        rgb=frame.rgb[outer],
        depth=depth[inner],
        mask=own[inner],
        cloud=points,
        box=berries.boxes[index],
        dropped=dropped,
        keypoints=keypoints,
        visibility=visibility,
        ripeness=float(berries.ripeness[index]),
        hidden=hidden_share(own, near),
        contour=contour + np.array((window[1].start, window[0].start)),
        covered=covered,
        score=float(berries.scores[index]),
    )
    _check_relief(observation)
    return observation


def _inputs(
    frame: Frame, berries: Strawberries, index: int
) -> tuple[CameraIntrinsics, NDArray[np.float32], NDArray[np.bool_]]:
    if frame.depth is None:
        raise _NotWeighableError("the frame has no depth")
    if frame.camera is None:
        raise _NotWeighableError("the frame has no camera intrinsics")
    if berries.masks is None:
        raise _NotWeighableError("the berry has no mask")
    mask = berries.masks[index]
    if mask.shape != frame.depth.shape:
        raise _NotWeighableError(f"the mask is {mask.shape}, the depth {frame.depth.shape}")
    pixels = int(np.count_nonzero(mask))
    if pixels == 0:
        raise _NotWeighableError("the mask is empty")
    if pixels < LEAST_PIXELS:
        raise _NotWeighableError(f"the mask has only {pixels} pixels, {LEAST_PIXELS} needed")
    return frame.camera, frame.depth, mask


def _check_readings(depth: NDArray[np.float32], mask: NDArray[np.bool_]) -> None:
    readings = depth[mask & (depth > 0)]
    if not readings.size:
        raise _NotWeighableError("no depth reading on the berry")
    typical = median(readings)
    low, high = RANGE_LIMITS
    if typical > _MILLIMETRES_FROM:
        raise _NotWeighableError(
            f"depth of {typical:.0f} m: is it in millimetres? A frame's depth is in metres"
        )
    if not low <= typical <= high:
        raise _NotWeighableError(
            f"depth of {typical:.3g} m is not within {low}…{high} m; check the depth's unit (depth_scale)"
        )


def _check_relief(observation: BerryObservation) -> None:
    outline = observation.outline
    diameter = 2.0 * math.sqrt(outline.area / math.pi) * observation.scale
    centred = observation.view - observation.view.mean(axis=0)
    thinnest = float(np.linalg.eigvalsh(centred.T @ centred)[0]) / len(centred)
    if thinnest < _THINNEST**2 or 2.0 * observation.relief < _FLATNESS * diameter:
        raise _NotWeighableError("the cloud is flat: a picture, a leaf, or depth too coarse to tell")


def _keypoints(berries: Strawberries, index: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    if berries.keypoints is None or berries.visibility is None:
        return np.full((len(KEYPOINTS), 2), np.nan), np.zeros(len(KEYPOINTS), np.int64)
    points, codes = berries.keypoints[index].copy(), berries.visibility[index].copy()
    absent = (codes == Visibility.ABSENT) | ~np.isfinite(points).all(axis=1)
    points[absent], codes[absent] = np.nan, int(Visibility.ABSENT)
    return points, codes


def _shifted(window: slice, by: int) -> slice:
    return slice(window.start + by, window.stop + by)


def _cropped(camera: CameraIntrinsics, window: tuple[slice, slice]) -> CameraIntrinsics:
    rows, columns = window
    return CameraIntrinsics(
        columns.stop - columns.start,
        rows.stop - rows.start,
        camera.fx,
        camera.fy,
        camera.cx - columns.start,
        camera.cy - rows.start,
    )
