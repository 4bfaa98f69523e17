"""Weight from geometry alone: silhouette and depth to an ellipsoid-like volume, times density.

For a ball of radius R whose centre is D away, the outline is seen under the half-angle α with sin α = R
/ D, and half of what shows of it is nearer than D − R/√2. So the median range m of the cloud and the
outline give D and R without circles: D = m / (1 − sin α / √2). A berry is no ball; its outline's area A
stands for R, and its volume is V = f · ⅔ A T with T the extent along the line of sight (an ellipsoid has
f = 1 exactly). T can't be seen; it is guessed from the outline, and corrected by how much the cloud
bulges towards the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.geometry import CameraIntrinsics
from punnet.scene import KEYPOINTS, Frame, Strawberries, Visibility
from punnet.weight.cloud import LAYER_GAP, berry_cloud, depth_layer, relief_height
from punnet.weight.estimator import WeightEstimates
from punnet.weight.silhouette import Silhouette, hidden_share, measure_silhouette, tidy_mask

__all__ = ["EllipsoidConfig", "EllipsoidEstimator"]

_MEDIAN_RANGE = math.sqrt(0.5)
_TOP, _BOTTOM = KEYPOINTS.index("top"), KEYPOINTS.index("bottom")
_GRAMS_PER_CUBIC_METRE = 1e6


@dataclass(frozen=True)
class EllipsoidConfig:
    """Constants of :class:`EllipsoidEstimator`; ``benchmarks/weight_constants.py`` prints the fitted ones.

    Parameters
    ----------
    density
        Grams per cubic centimetre (strawberries float: .85 … 1).
    shape_factor
        f in V = f · ⅔ A T: how much less a berry holds than an ellipsoid of the same outline.
    thickness_factor, elongation_exponent
        T = factor · √(length · width) · (length / width)^exponent of the outline, before the cloud is asked: a berry
        that looks broad is more often a wedge seen from its broad side. The calyx hides some of the length, so the
        factor from pictures is above the one from meshes.
    thickness_spread, relief_spread
        Relative standard deviations of that guess and of what the cloud's bulge says: who is believed.
    relief_gain
        Bulge that the camera shows of a berry's true half extent: stereo smooths it.
    shape_spread
        Relative standard deviation of shape and density together.
    calyx_share
        Share of the outline that the berry's own calyx and stem may cover without anything being hidden.
    hidden_gain
        Logarithm of the weight that is missed for each share of the outline hidden beyond that.
    least_pixels
        Fewest mask pixels of a berry that is weighed.
    range_limits
        Metres between which a berry's depth is believed.
    weight_limits
        Grams between which a result is believed.
    flatness
        A cloud that bulges less than this share of what its outline promises is no berry.
    coverage
        Nominal coverage of the interval.

    Raises
    ------
    ConfigurationError
        If a constant is out of its range.
    """

    density: float = 0.92
    shape_factor: float = 0.960
    thickness_factor: float = 0.915
    elongation_exponent: float = 0.30
    thickness_spread: float = 0.10
    relief_spread: float = 0.15
    relief_gain: float = 0.93
    shape_spread: float = 0.045
    calyx_share: float = 0.15
    hidden_gain: float = 0.6
    least_pixels: int = 60
    range_limits: tuple[float, float] = (0.08, 3.0)
    weight_limits: tuple[float, float] = (0.2, 120.0)
    flatness: float = 0.25
    coverage: float = 0.9

    def __post_init__(self) -> None:
        for name in (
            "density",
            "shape_factor",
            "thickness_factor",
            "thickness_spread",
            "relief_spread",
            "relief_gain",
            "shape_spread",
            "hidden_gain",
        ):
            if not 0 < getattr(self, name) < math.inf:
                raise ConfigurationError(f"ellipsoid: {name} must be positive, got {getattr(self, name)}")
        for name in ("range_limits", "weight_limits"):
            low, high = getattr(self, name)
            if not 0 < low < high:
                raise ConfigurationError(f"ellipsoid: {name} must rise from above 0, got {(low, high)}")
        if self.least_pixels < 20:
            raise ConfigurationError(f"ellipsoid: least_pixels must be at least 20, got {self.least_pixels}")
        if not 0 < self.coverage < 1 or not 0 <= self.flatness < 1:
            raise ConfigurationError("ellipsoid: coverage must lie in (0, 1) and flatness in [0, 1)")


class _NoEstimateError(Exception):
    """Why this berry can't be weighed; caught inside, becomes the reason."""


class EllipsoidEstimator:
    """Weighs by silhouette, depth and an ellipsoid-like volume; needs no training.

    Parameters
    ----------
    config
        Constants; defaults if None.
    """

    name = "ellipsoid"

    def __init__(self, config: EllipsoidConfig | None = None) -> None:
        self.config = config or EllipsoidConfig()

    def estimate(self, frame: Frame, berries: Strawberries) -> WeightEstimates:
        """Grams with an interval for each of ``berries``; NaN with a reason where the frame can't tell."""
        count = len(berries)
        grams = np.full(count, np.nan)
        intervals = np.full((count, 2), np.nan)
        reasons: list[str | None] = [None] * count
        for i in range(count):
            try:
                grams[i], intervals[i] = self._weigh(frame, berries, i)
            except _NoEstimateError as why:
                reasons[i] = str(why)
        return WeightEstimates(grams, intervals, tuple(reasons), self.config.coverage)

    def _weigh(self, frame: Frame, berries: Strawberries, index: int) -> tuple[float, tuple[float, float]]:
        camera, depth, mask = self._inputs(frame, berries, index)
        cloud = berry_cloud(camera, depth, mask)
        nearest, farthest = self._checked_layer(cloud, mask)
        other = (depth > 0) & ((depth < nearest - LAYER_GAP) | (depth > farthest + LAYER_GAP))
        own = tidy_mask(mask & ~other)
        if own.sum() < self.config.least_pixels:
            raise _NoEstimateError("the mask shows hardly anything of the depth of the berry")
        outline = measure_silhouette(camera, own, _axis(berries, index))
        ranges = np.linalg.norm(cloud, axis=1)
        sine = math.sin(math.atan(math.sqrt(outline.area / math.pi)))
        distance = float(np.median(ranges)) / (1.0 - _MEDIAN_RANGE * sine)
        # The outline is the ball's rim as the camera sees it, nearer than its centre: R = D cos α · tan α.
        scale = distance * math.sqrt(1.0 - sine * sine)
        hidden = self._hidden(depth, own, cloud)
        thickness, spread = self._thickness(outline, scale, cloud, ranges, hidden)
        area = outline.area * scale * scale
        volume = self.config.shape_factor * 2.0 / 3.0 * area * thickness
        weight = volume * _GRAMS_PER_CUBIC_METRE * self.config.density
        weight *= math.exp(self.config.hidden_gain * hidden)
        low, high = self.config.weight_limits
        if not low <= weight <= high:
            raise _NoEstimateError(f"{weight:.3g} g is no berry's weight; check mask, depth and camera")
        pixels = math.sqrt(outline.area) * camera.fx
        return weight, self._interval(weight, spread, pixels, hidden)

    def _inputs(
        self, frame: Frame, berries: Strawberries, index: int
    ) -> tuple[CameraIntrinsics, NDArray[np.float32], NDArray[np.bool_]]:
        if frame.depth is None:
            raise _NoEstimateError("the frame has no depth")
        if frame.camera is None:
            raise _NoEstimateError("the frame has no camera intrinsics")
        if berries.masks is None:
            raise _NoEstimateError("the berry has no mask")
        mask = berries.masks[index]
        if mask.shape != frame.depth.shape:
            raise _NoEstimateError(f"the mask is {mask.shape}, the depth {frame.depth.shape}")
        pixels = int(mask.sum())
        if pixels == 0:
            raise _NoEstimateError("the mask is empty")
        if pixels < self.config.least_pixels:
            raise _NoEstimateError(f"the mask has only {pixels} pixels")
        if not frame.depth[mask].any():
            raise _NoEstimateError("no depth reading on the berry")
        median = float(np.median(frame.depth[mask & (frame.depth > 0)]))
        low, high = self.config.range_limits
        if median > 50.0:
            raise _NoEstimateError(
                f"depth of {median:.0f} m: is it in millimetres? A frame's depth is in metres"
            )
        if not low <= median <= high:
            raise _NoEstimateError(f"depth of {median:.2f} m is not within {low}…{high} m")
        return frame.camera, frame.depth, mask

    def _checked_layer(self, cloud: NDArray[np.float64], mask: NDArray[np.bool_]) -> tuple[float, float]:
        needed = max(20, int(0.05 * mask.sum()))
        if len(cloud) < needed:
            raise _NoEstimateError(f"only {len(cloud)} depth readings on the berry, {needed} needed")
        return depth_layer(cloud[:, 2])

    def _thickness(
        self,
        outline: Silhouette,
        scale: float,
        cloud: NDArray[np.float64],
        ranges: NDArray[np.float64],
        hidden: float,
    ) -> tuple[float, float]:
        """Extent along the line of sight in metres, and its relative standard deviation."""
        config = self.config
        elongation = min(
            max(outline.length / outline.width, 0.8), 1.6
        )  # beyond, part of the outline is missing
        guess = config.thickness_factor * elongation**config.elongation_exponent
        guess *= math.sqrt(outline.length * outline.width) * scale
        view = cloud @ outline.R_view_camera.T
        across = view[:, :2] / view[:, 2:]
        height = relief_height(np.column_stack((across * scale, ranges)), outline.dome(across))
        bulge = 2.0 * height / config.relief_gain
        if bulge < config.flatness * guess:
            raise _NoEstimateError("the cloud is flat: a picture, a leaf, or depth too coarse to tell")
        if math.isnan(bulge):
            return guess, config.thickness_spread
        bulge = min(max(bulge, 0.7 * guess), 1.4 * guess)
        # A dome that is partly hidden is fitted off its middle: believe it less.
        doubt = config.relief_spread * (1.0 + 4.0 * hidden)
        share = config.thickness_spread**2 / (config.thickness_spread**2 + doubt**2)
        spread = 1.0 / math.sqrt(config.thickness_spread**-2 + doubt**-2)
        return guess * (bulge / guess) ** share, spread

    def _hidden(
        self, depth: NDArray[np.float32], own: NDArray[np.bool_], cloud: NDArray[np.float64]
    ) -> float:
        """Share of the outline, beyond the calyx, where something is in front of the berry's nearer half."""
        share = hidden_share(depth, own, float(np.median(cloud[:, 2])) - _DEPTH_NOISE)
        return max(0.0, share - self.config.calyx_share) / (1.0 - self.config.calyx_share)

    def _interval(self, weight: float, thickness: float, pixels: float, hidden: float) -> tuple[float, float]:
        """Log-normal interval; what is hidden can only add weight, so it widens the upper side most."""
        outline = 1.5 * 2.0 / pixels  # the outline is known to about a pixel all around
        known = math.hypot(self.config.shape_spread, thickness, outline, _DISTANCE_SPREAD)
        quantile = NormalDist().inv_cdf(0.5 + self.config.coverage / 2.0)
        below = quantile * math.hypot(known, self.config.hidden_gain * hidden)
        above = quantile * math.hypot(known, 4.0 * self.config.hidden_gain * hidden)
        return weight * math.exp(-below), weight * math.exp(above)


_DEPTH_NOISE = 0.002
_DISTANCE_SPREAD = 0.02
"""Relative error of the weight by the distance's: V grows with its cube, and stereo is good to 2–3 mm."""


def _axis(berries: Strawberries, index: int) -> NDArray[np.float64] | None:
    """(2, 2) pixels of top and bottom where both are known."""
    if berries.keypoints is None or berries.visibility is None:
        return None
    known = berries.visibility[index, [_TOP, _BOTTOM]] != Visibility.ABSENT
    ends = berries.keypoints[index, [_TOP, _BOTTOM]]
    return ends if known.all() and np.isfinite(ends).all() else None
